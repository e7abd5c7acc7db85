//! A server inside this process: a free port, a database of its own, and limits to choose.

use std::net::SocketAddr;
use std::path::Path;
use std::time::Duration;

use palpate_client::{Client, RetryPolicy};
use palpate_server::{Limits, Location, ServeError, ServeOptions, serve};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use tonic::transport::Channel;

use super::{Caller, Http, Transport, database, soon};

/// A running server; stopped when it is dropped, gracefully by [`Server::stop`].
pub(crate) struct Server {
    pub(crate) address: SocketAddr,
    folder: TempDir,
    shutdown: CancellationToken,
    serving: JoinHandle<Result<(), ServeError>>,
}

impl Server {
    pub(crate) async fn start() -> Self {
        Self::with_limits(Limits::default()).await
    }

    pub(crate) async fn with_limits(limits: Limits) -> Self {
        Self::with_options(ServeOptions { limits, ..ServeOptions::default() }).await
    }

    /// Whatever database the options name, it is a temporary one.
    pub(crate) async fn with_options(options: ServeOptions) -> Self {
        Self::over(tempfile::tempdir().unwrap(), options).await
    }

    /// A server over the database in a folder, or why it refused to start.
    pub(crate) async fn over_folder(folder: TempDir) -> Result<Self, String> {
        let mut server = Self::over(folder, ServeOptions::default()).await;
        // Whoever calls before it serves waits, and is cut when it ends instead.
        let answer = server.http().get("/livez").send();
        let answered = soon("the server serves or ends", answer).await;
        if answered.is_ok() {
            return Ok(server);
        }
        let ended = soon("the server ends", &mut server.serving).await;
        Err(ended.expect("it does not panic").expect_err("it ends because it refuses").to_string())
    }

    pub(super) async fn over(folder: TempDir, options: ServeOptions) -> Self {
        let database = database::location(&folder.path().join("palpate.db")).await;
        Self::serving(folder, ServeOptions { database, ..options }).await
    }

    async fn serving(folder: TempDir, options: ServeOptions) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let shutdown = CancellationToken::new();
        let serving = tokio::spawn(serve(listener, options, shutdown.clone()));
        Self { address, folder, shutdown, serving }
    }

    /// A server over this log; a relative path is one in a folder of its own.
    pub(crate) async fn on(database: Location) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let database = match database {
            Location::File(path) => Location::File(folder.path().join(path)),
            shared @ Location::Postgres(_) => shared,
        };
        Self::serving(folder, ServeOptions { database, ..ServeOptions::default() }).await
    }

    /// Stops gracefully, and waits until the server has ended by itself.
    pub(crate) async fn stop(self) -> TempDir {
        self.shutdown.cancel();
        soon("the server ends", self.serving).await.unwrap().unwrap();
        self.folder
    }

    /// Stops the server and starts another one over the same database.
    pub(crate) async fn restart(self) -> Self {
        Self::over(self.stop().await, ServeOptions::default()).await
    }

    /// The same with what happens to the database in between.
    pub(crate) async fn restart_after(self, happens: impl AsyncFnOnce(&Path)) -> Self {
        let folder = self.stop().await;
        happens(&folder.path().join("palpate.db")).await;
        Self::over(folder, ServeOptions::default()).await
    }

    /// A server over a database that is there already.
    pub(crate) async fn over_copy_of(database: &Path) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::copy(database, folder.path().join("palpate.db")).unwrap();
        Self::over(folder, ServeOptions::default()).await
    }

    /// Another server over the database as it is on disk at this moment, changed by `happens`: as after a crash.
    pub(crate) async fn after_a_crash(&self, happens: impl FnOnce(&Path)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for entry in std::fs::read_dir(self.folder.path()).unwrap() {
            let entry = entry.unwrap();
            std::fs::copy(entry.path(), folder.path().join(entry.file_name())).unwrap();
        }
        happens(folder.path());
        Self::over(folder, ServeOptions::default()).await
    }

    /// The folder of the database.
    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    pub(crate) fn http(&self) -> Http {
        Http::new(self.url())
    }

    /// A connection for the generated gRPC clients.
    pub(crate) fn channel(&self) -> Channel {
        channel_to(self.address)
    }

    /// A caller of this transport.
    pub(crate) fn caller(&self, transport: Transport) -> Caller {
        Caller::new(transport, self.channel(), self.http())
    }

    pub(crate) fn grpc(&self) -> Caller {
        self.caller(Transport::Grpc)
    }

    /// The client that robots use.
    pub(crate) async fn client(&self) -> Client {
        patient_client(&self.url()).await
    }
}

/// A connection that is made at the first call.
pub(super) fn channel_to(address: SocketAddr) -> Channel {
    Channel::from_shared(format!("http://{address}")).unwrap().connect_lazy()
}

/// A client that tries again until the tests' patience is over, and waits as long as a server asks.
pub(crate) async fn patient_client(url: &str) -> Client {
    let retry = RetryPolicy {
        max_attempts: 1000,
        first_wait: Duration::from_millis(2),
        longest_wait: Duration::from_secs(2),
    };
    Client::builder(url).retry(retry).deadline(Duration::from_secs(20)).connect().await.unwrap()
}
