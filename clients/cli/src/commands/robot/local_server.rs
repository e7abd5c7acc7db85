//! A real server inside this process: a free port of the loopback, a database of its own.

use std::path::Path;

use palpate_client::Client;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::{CancellationToken, DropGuard};

use crate::commands::simulations;
use crate::failure::Failure;
use palpate_server::{ServeError, ServeOptions, serve};

/// How many more robots can be started from the page.
const SIMULATED_ROBOTS: usize = 4;

/// A server that runs beside the command.
#[derive(Debug)]
pub(in crate::commands) struct LocalServer {
    /// Where it is reached.
    pub(in crate::commands) url: String,
    /// Ends it, at the latest when this is dropped: its database is then free for another one.
    shutdown: DropGuard,
    task: JoinHandle<Result<(), ServeError>>,
}

impl LocalServer {
    /// Starts a server over the database at `database` and connects to it.
    pub(in crate::commands) async fn start(database: &Path) -> Result<(Self, Client), Failure> {
        let listener = TcpListener::bind("127.0.0.1:0").await?;
        let address = listener.local_addr()?;
        let url = format!("http://{address}");
        let shutdown = CancellationToken::new();
        let additional_routes = simulations::router(address, SIMULATED_ROBOTS, shutdown.clone());
        let options =
            ServeOptions { database: database.into(), additional_routes, ..ServeOptions::default() };
        let task = tokio::spawn(serve(listener, options, shutdown.clone()));
        match Client::connect(&url).await {
            Ok(client) => Ok((Self { url, shutdown: shutdown.drop_guard(), task }, client)),
            Err(error) => {
                // A server that could not start says more than the connection it did not answer.
                shutdown.cancel();
                task.await??;
                Err(error.into())
            }
        }
    }

    /// Stops gracefully: everything acknowledged is in the database.
    pub(in crate::commands) async fn stop(self) -> Result<(), Failure> {
        drop(self.shutdown);
        Ok(self.task.await??)
    }
}
