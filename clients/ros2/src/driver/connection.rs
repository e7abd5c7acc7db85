//! The connection to the server: made from the parameters, and patient.
//!
//! A call is sent again until it is answered or finally refused, and each time it is told whether the server answers.

use std::path::Path;
use std::time::Duration;

use palpate_client::{Client, ClientBuilder, Code, Error, RetryPolicy};
use tokio::sync::mpsc;
use tokio::time::sleep;

use super::Update;
use crate::parameters::Parameters;

/// How long one attempt of a call may take; a fit of many touches takes seconds.
const DEADLINE: Duration = Duration::from_secs(20);
/// Wait before the second attempt; it doubles with each further one.
const FIRST_WAIT: Duration = Duration::from_millis(200);
/// The longest wait between two attempts.
const LONGEST_WAIT: Duration = Duration::from_secs(2);

/// A client, and who is told.
pub(super) struct Connection {
    parameters: Parameters,
    client: Client,
    updates: mpsc::Sender<Update>,
}

impl Connection {
    /// Waits until the server is there.
    pub(super) async fn open(parameters: &Parameters, updates: mpsc::Sender<Update>) -> Result<Self, String> {
        let mut wait = FIRST_WAIT;
        loop {
            // Files are read each time: a token may be renewed while the server is away.
            match builder(parameters)?.connect().await {
                Ok(client) => return Ok(Self { parameters: parameters.clone(), client, updates }),
                Err(error) if error.is_transient() => {
                    let _ = updates.send(Update::Server(Err(error.to_string()))).await;
                }
                Err(error) => return Err(format!("parameter server: {error}")),
            }
            sleep(wait).await;
            wait = (2 * wait).min(LONGEST_WAIT);
        }
    }

    pub(super) fn client(&self) -> &Client {
        &self.client
    }

    pub(super) async fn tell(&self, update: Update) {
        // Nobody listens only while the program ends.
        let _ = self.updates.send(update).await;
    }

    /// Sends a call until it is answered or finally refused. Where the token is not taken, its file is read again: who runs
    /// the server may have made a new one.
    pub(super) async fn deliver<A, F>(&mut self, call: impl Fn(Client) -> F) -> Result<A, Error>
    where
        F: Future<Output = Result<A, Error>>,
    {
        let mut wait = FIRST_WAIT;
        loop {
            let error = match call(self.client.clone()).await {
                Ok(answer) => {
                    self.tell(Update::Server(Ok(()))).await;
                    return Ok(answer);
                }
                Err(error) if is_final(&error) => {
                    self.tell(Update::Server(Ok(()))).await;
                    return Err(error);
                }
                Err(error) => error,
            };
            self.tell(Update::Server(Err(error.to_string()))).await;
            let asked_for = error.refusal().and_then(|refusal| refusal.retry_after).unwrap_or_default();
            sleep(wait.max(asked_for)).await;
            wait = (2 * wait).min(LONGEST_WAIT);
            self.renew(&error).await;
        }
    }

    /// Connects anew where the token was not taken.
    pub(super) async fn renew(&mut self, error: &Error) {
        if error.code() == Code::Unauthenticated
            && let Ok(builder) = builder(&self.parameters)
            && let Ok(client) = builder.connect().await
        {
            self.client = client;
        }
    }
}

fn builder(parameters: &Parameters) -> Result<ClientBuilder, String> {
    let text = |name: &str, path: &Path| {
        std::fs::read_to_string(path)
            .map_err(|error| format!("parameter {name}: {}: {error}", path.display()))
    };
    let Parameters { server, token_file, ca, certificate, key, .. } = parameters;
    // Attempts are counted here, so that diagnostics say what is going on.
    let once = RetryPolicy { max_attempts: 1, ..RetryPolicy::default() };
    let mut builder = Client::builder(server).deadline(DEADLINE).retry(once);
    let or_environment = |path: &Path, variable: &str| match path.as_os_str().is_empty() {
        false => Some(path.to_owned()),
        true => std::env::var_os(variable).filter(|value| !value.is_empty()).map(Into::into),
    };
    if let Some(file) = or_environment(token_file, "PALPATE_TOKEN_FILE") {
        builder = builder.token(&text("token_file", &file)?);
    } else if let Some(token) = std::env::var("PALPATE_TOKEN").ok().filter(|token| !token.is_empty()) {
        builder = builder.token(&token);
    }
    if let Some(file) = or_environment(ca, "PALPATE_CA").filter(|_| server.starts_with("https://")) {
        builder = builder.certificate_authority(&text("ca", &file)?);
    }
    match (certificate.as_os_str().is_empty(), key.as_os_str().is_empty()) {
        (true, true) => Ok(builder),
        (false, false) => Ok(builder.certificate(&text("certificate", certificate)?, &text("key", key)?)),
        _ => Err("parameters certificate and key: give both, or none".to_owned()),
    }
}

/// Whether sending the same again is of no use: it is about this very call, or about a fault of the server.
///
/// A token that expired or a disk that is full is mended by a person, and what was touched must not be lost by then.
fn is_final(error: &Error) -> bool {
    match error.code() {
        Code::Unauthenticated | Code::PermissionDenied => false,
        Code::ResourceExhausted => matches!(error.reason(), "TOO_LARGE" | "HEADER_TOO_LARGE"),
        _ => !error.is_transient(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(change: fn(&mut Parameters)) -> String {
        let mut parameters = Parameters::default();
        change(&mut parameters);
        builder(&parameters).err().unwrap()
    }

    #[test]
    fn files_that_are_not_there_are_named_with_their_parameter() {
        let missing = problem(|parameters| parameters.token_file = "/nowhere/token".into());
        assert!(missing.contains("token_file") && missing.contains("/nowhere/token"), "{missing}");
        let half = problem(|parameters| parameters.key = "/nowhere/key".into());
        assert!(half.contains("certificate and key"), "{half}");
    }

    #[tokio::test]
    async fn an_address_that_is_none_ends_the_waiting() {
        let parameters = Parameters { server: "http://not an address".to_owned(), ..Parameters::default() };
        let (tell, _updates) = mpsc::channel(1);
        let error = Connection::open(&parameters, tell).await.err().unwrap();
        assert!(error.contains("parameter server") && error.contains("not an address"), "{error}");
    }
}
