//! How a client is set up: where the server is, how long to wait for it, how often to try again.

use std::time::Duration;

use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Certificate, ClientTlsConfig, Endpoint, Identity};
use tonic::{Request, Status};

use crate::error::causes;
use crate::{Client, Error, RetryPolicy};

/// A dead connection is noticed after at most the sum of these two.
const KEEP_ALIVE_INTERVAL: Duration = Duration::from_secs(20);
const KEEP_ALIVE_TIMEOUT: Duration = Duration::from_secs(10);
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Settings of a [`Client`]; made by [`Client::builder`].
#[derive(Clone)]
pub struct ClientBuilder {
    url: String,
    deadline: Duration,
    retry: RetryPolicy,
    token: Option<String>,
    authority: Option<String>,
    identity: Option<(String, String)>,
}

impl std::fmt::Debug for ClientBuilder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { url, deadline, retry, token, authority: _, identity } = self;
        f.debug_struct("ClientBuilder")
            .field("url", url)
            .field("deadline", deadline)
            .field("retry", retry)
            .field("has_token", &token.is_some())
            .field("has_certificate", &identity.is_some())
            .finish_non_exhaustive()
    }
}

impl ClientBuilder {
    pub(crate) fn new(url: &str) -> Self {
        // People type what the server prints in its log, which may be just host and port.
        let url = if url.contains("://") { url.to_owned() } else { format!("http://{url}") };
        Self {
            url,
            deadline: Duration::from_secs(10),
            retry: RetryPolicy::default(),
            token: None,
            authority: None,
            identity: None,
        }
    }

    /// How long each attempt of a call may take; 10 s unless set. The server is told and gives up by then, too.
    pub fn deadline(mut self, deadline: Duration) -> Self {
        self.deadline = deadline;
        self
    }

    /// How often and how patiently a call is tried again.
    pub fn retry(mut self, retry: RetryPolicy) -> Self {
        self.retry = retry;
        self
    }

    /// Says who calls: a token that `palpate token create` made on the server. Over `http://` it can be read on the way.
    pub fn token(mut self, token: &str) -> Self {
        self.token = Some(token.trim().to_owned());
        self
    }

    /// Trusts a server whose certificate comes from this authority, in PEM, instead of those that the system trusts;
    /// for `https://`.
    pub fn certificate_authority(mut self, pem: &str) -> Self {
        self.authority = Some(pem.to_owned());
        self
    }

    /// Says who calls by a certificate and its private key, both in PEM; for `https://`.
    pub fn certificate(mut self, certificate_pem: &str, key_pem: &str) -> Self {
        self.identity = Some((certificate_pem.to_owned(), key_pem.to_owned()));
        self
    }

    /// Connects to the server. A connection that breaks later is made anew by itself.
    ///
    /// # Errors
    /// [`Error::Url`] when the address cannot be one, [`Error::Tls`] when certificates cannot be used, [`Error::Token`]
    /// when the token is none, [`Error::Connect`] when nobody answers there.
    pub async fn connect(self) -> Result<Client, Error> {
        let bearer = self.token.as_deref().map(Bearer::new).transpose()?.unwrap_or_default();
        let is_encrypted = self.url.starts_with("https://");
        if !is_encrypted && (self.authority.is_some() || self.identity.is_some()) {
            let detail = "certificates are for https://, and the address is not".to_owned();
            return Err(Error::Tls { url: self.url, detail });
        }
        let endpoint = Endpoint::from_shared(self.url.clone())
            .and_then(|endpoint| endpoint.user_agent(concat!("palpate-client/", env!("CARGO_PKG_VERSION"))))
            .map_err(|source| Error::Url { url: self.url.clone(), source })?
            .connect_timeout(CONNECT_TIMEOUT)
            .http2_keep_alive_interval(KEEP_ALIVE_INTERVAL)
            .keep_alive_timeout(KEEP_ALIVE_TIMEOUT)
            .keep_alive_while_idle(true)
            .tcp_nodelay(true);
        let endpoint = if is_encrypted { self.encrypted(endpoint)? } else { endpoint };
        let channel =
            endpoint.connect().await.map_err(|source| Error::Connect { url: self.url.clone(), source })?;
        Ok(Client::over(InterceptedService::new(channel, bearer), self.deadline, self.retry))
    }

    fn encrypted(&self, endpoint: Endpoint) -> Result<Endpoint, Error> {
        let tls = ClientTlsConfig::new();
        let tls = match &self.authority {
            Some(pem) => tls.ca_certificate(Certificate::from_pem(pem)),
            None => tls.with_native_roots(),
        };
        let tls = match &self.identity {
            Some((certificate, key)) => tls.identity(Identity::from_pem(certificate, key)),
            None => tls,
        };
        endpoint.tls_config(tls).map_err(|error| Error::Tls { url: self.url.clone(), detail: causes(&error) })
    }
}

/// Puts the token on each call.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bearer(Option<MetadataValue<Ascii>>);

impl Bearer {
    fn new(token: &str) -> Result<Self, Error> {
        let is_one = !token.is_empty() && token.bytes().all(|byte| byte.is_ascii_graphic());
        let mut value: MetadataValue<Ascii> =
            format!("Bearer {token}").parse().ok().filter(|_| is_one).ok_or(Error::Token)?;
        // Never shown by `Debug`, and not kept by the compression of headers.
        value.set_sensitive(true);
        Ok(Self(Some(value)))
    }
}

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(value) = &self.0 {
            request.metadata_mut().insert("authorization", value.clone());
        }
        Ok(request)
    }
}

#[cfg(test)]
mod tests {
    use crate::{Client, Error};

    #[tokio::test]
    async fn an_address_that_cannot_be_one_is_named_in_the_error() {
        let error = Client::connect("http://not an address").await.unwrap_err();
        assert!(matches!(error, Error::Url { .. }), "{error:?}");
        assert!(error.to_string().contains("not an address"), "{error}");
    }

    #[tokio::test]
    async fn certificates_are_not_given_to_who_asks_for_none_and_what_is_none_is_refused() {
        let error = Client::builder("http://127.0.0.1:7257").certificate_authority("x").connect().await;
        assert!(matches!(error, Err(Error::Tls { .. })), "{error:?}");
        let error =
            Client::builder("https://127.0.0.1:7257").certificate("x", "y").connect().await.unwrap_err();
        assert!(matches!(error, Error::Tls { .. }), "{error:?}");
    }

    #[tokio::test]
    async fn a_token_is_never_shown_and_what_cannot_be_one_is_refused() {
        let secret = "palpate_0123456789ab_feedfeed";
        let shown = format!("{:?}", Client::builder("127.0.0.1:1").token(secret));
        assert!(!shown.contains("feed") && shown.contains("127.0.0.1:1"), "{shown}");
        for wrong in ["", "two words", "line\nbreak", "\u{fc}"] {
            let error = Client::builder("127.0.0.1:1").token(wrong).connect().await.unwrap_err();
            assert!(matches!(error, Error::Token), "{wrong}: {error:?}");
        }
    }

    #[tokio::test]
    async fn a_port_where_nobody_listens_gives_an_error_that_says_what_to_do() {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        drop(listener);
        let error = Client::connect(&address.to_string()).await.unwrap_err();
        assert!(matches!(error, Error::Connect { .. }), "{error:?}");
        assert!(error.to_string().contains("palpate serve"), "{error}");
    }
}
