//! A server on a free port, over a database of its own, that can be stopped and started again.

use std::net::SocketAddr;
use std::time::Duration;

use palpate_client::Client;
use palpate_client::proto::v1::event::Kind;
use palpate_client::proto::v1::{ContactResult, Event, ListEventsRequest};
use palpate_ros2::names::Names;
use palpate_ros2::parameters::Parameters;
use palpate_ros2::ros_args::{Given, RosArgs};
use palpate_server::access::{NewToken, Scope, Tokens};
use palpate_server::{ServeError, ServeOptions, serve};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Something is surely broken if it takes longer.
pub(crate) const LONG: Duration = Duration::from_secs(60);

pub(crate) struct Server {
    pub(crate) address: SocketAddr,
    folder: TempDir,
    shutdown: CancellationToken,
    serving: JoinHandle<Result<(), ServeError>>,
}

impl Server {
    pub(crate) async fn start() -> Self {
        Self::over(tempfile::tempdir().unwrap(), "127.0.0.1:0".parse().unwrap()).await
    }

    /// One that asks for tokens, and the two that it knows.
    pub(crate) async fn start_with_tokens() -> (Self, [String; 2]) {
        let folder = tempfile::tempdir().unwrap();
        let mut tokens = Tokens::open(&folder.path().join("palpate.db").into()).await.unwrap();
        let mut made = Vec::new();
        for name in ["old", "new"] {
            let token = NewToken {
                name: name.to_owned(),
                scope: Scope::Robot,
                experiments: None,
                lasts: None,
                most_sessions: None,
                most_bytes: None,
                compute_share: 1.0,
            };
            made.push(tokens.create(&token).await.unwrap().token);
        }
        tokens.close().await.unwrap();
        let options = ServeOptions { require_tokens: true, ..ServeOptions::default() };
        let server = Self::with_options(folder, "127.0.0.1:0".parse().unwrap(), options).await;
        (server, made.try_into().unwrap())
    }

    /// Takes the first of the two tokens back while the server runs.
    pub(crate) async fn revoke_old(&self) {
        let mut tokens = Tokens::open(&self.folder.path().join("palpate.db").into()).await.unwrap();
        tokens.revoke("old").await.unwrap();
        tokens.close().await.unwrap();
    }

    async fn over(folder: TempDir, address: SocketAddr) -> Self {
        Self::with_options(folder, address, ServeOptions::default()).await
    }

    async fn with_options(folder: TempDir, address: SocketAddr, options: ServeOptions) -> Self {
        let listener = TcpListener::bind(address).await.unwrap();
        let address = listener.local_addr().unwrap();
        let shutdown = CancellationToken::new();
        let options = ServeOptions { database: folder.path().join("palpate.db").into(), ..options };
        let serving = tokio::spawn(serve(listener, options, shutdown.clone()));
        Self { address, folder, shutdown, serving }
    }

    /// Stops it, and gives back what starts it again.
    pub(crate) async fn stop(self) -> Stopped {
        self.shutdown.cancel();
        tokio::time::timeout(LONG, self.serving).await.unwrap().unwrap().unwrap();
        Stopped { address: self.address, folder: self.folder }
    }

    pub(crate) fn parameters(&self, yaml: &[(&str, &str)]) -> Parameters {
        let mut given = vec![Given::Value("server".to_owned(), format!("http://{}", self.address))];
        given.extend(yaml.iter().map(|(name, value)| Given::Value((*name).to_owned(), (*value).to_owned())));
        Parameters::read(&given, &names(&[])).unwrap()
    }

    pub(crate) async fn client(&self) -> Client {
        Client::connect(&self.address.to_string()).await.unwrap()
    }

    pub(crate) async fn events(&self, session_id: &str) -> Vec<Event> {
        let request =
            ListEventsRequest { session_id: session_id.to_owned(), page_size: 100, ..Default::default() };
        self.client().await.list_events(request).await.unwrap().events
    }

    /// What became of each approach, by the log.
    pub(crate) async fn results(&self, session_id: &str) -> Vec<ContactResult> {
        let events = self.events(session_id).await.into_iter();
        events
            .filter_map(|event| match event.kind {
                Some(Kind::ContactResult(result)) => Some(result),
                _ => None,
            })
            .collect()
    }
}

pub(crate) struct Stopped {
    address: SocketAddr,
    folder: TempDir,
}

impl Stopped {
    pub(crate) async fn start(self) -> Server {
        Server::over(self.folder, self.address).await
    }
}

/// A node `/palpate` with these remappings.
pub(crate) fn names(rules: &[(&str, &str)]) -> Names {
    let rules = rules.iter().map(|(from, to)| ((*from).to_owned(), (*to).to_owned())).collect();
    RosArgs { rules, ..RosArgs::default() }.names("palpate").unwrap()
}
