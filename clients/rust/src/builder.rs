//! How a client is set up: where the server is, how long to wait for it, how often to try again.

use std::time::Duration;

use tonic::transport::Endpoint;

use crate::{Client, Error, RetryPolicy};

/// A dead connection is noticed after at most the sum of these two.
const KEEP_ALIVE_INTERVAL: Duration = Duration::from_secs(20);
const KEEP_ALIVE_TIMEOUT: Duration = Duration::from_secs(10);
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Settings of a [`Client`]; made by [`Client::builder`].
#[derive(Debug, Clone)]
pub struct ClientBuilder {
    url: String,
    deadline: Duration,
    retry: RetryPolicy,
}

impl ClientBuilder {
    pub(crate) fn new(url: &str) -> Self {
        // People type what the server prints in its log, which may be just host and port.
        let url = if url.contains("://") { url.to_owned() } else { format!("http://{url}") };
        Self { url, deadline: Duration::from_secs(10), retry: RetryPolicy::default() }
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

    /// Connects to the server. A connection that breaks later is made anew by itself.
    ///
    /// # Errors
    /// [`Error::Url`] when the address cannot be one, [`Error::Tls`] when it asks for encryption, [`Error::Connect`]
    /// when nobody answers there.
    pub async fn connect(self) -> Result<Client, Error> {
        if self.url.starts_with("https://") {
            return Err(Error::Tls { url: self.url });
        }
        let endpoint = Endpoint::from_shared(self.url.clone())
            .and_then(|endpoint| endpoint.user_agent(concat!("palpate-client/", env!("CARGO_PKG_VERSION"))))
            .map_err(|source| Error::Url { url: self.url.clone(), source })?
            .connect_timeout(CONNECT_TIMEOUT)
            .http2_keep_alive_interval(KEEP_ALIVE_INTERVAL)
            .keep_alive_timeout(KEEP_ALIVE_TIMEOUT)
            .keep_alive_while_idle(true)
            .tcp_nodelay(true);
        let channel = endpoint.connect().await.map_err(|source| Error::Connect { url: self.url, source })?;
        Ok(Client::over(channel, self.deadline, self.retry))
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
    async fn an_address_that_asks_for_encryption_is_not_spoken_to_in_the_clear() {
        let error = Client::connect("https://127.0.0.1:7257").await.unwrap_err();
        assert!(matches!(error, Error::Tls { .. }), "{error:?}");
        assert!(error.to_string().contains("write http://"), "{error}");
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
