//! A server as a process of its own, which can be killed.

use std::net::SocketAddr;
use std::path::Path;
use std::process::{ExitStatus, Stdio};
use std::sync::{Arc, Mutex};

use serde_json::Value;
use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::process::{Child, Command};

use super::server::channel_to;
use super::{Caller, Http, Transport, database, soon};

/// A running `palpate serve`; killed when it is dropped.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    pub(crate) address: SocketAddr,
    log: Arc<Mutex<String>>,
}

/// The program.
const UNDER_TEST: &str = env!("CARGO_BIN_EXE_palpate-under-test");

impl Process {
    /// Starts the program on a free port and waits until its log says which.
    pub(crate) async fn serve(database: &Path) -> Self {
        Self::serve_with(database, |_| {}).await
    }

    /// The same with more for the program, such as its environment.
    pub(crate) async fn serve_with(database: &Path, more: impl FnOnce(&mut Command)) -> Self {
        Self::serve_at("127.0.0.1:0", database, more).await
    }

    /// The same with another program, such as one of another version.
    pub(crate) async fn serve_of(program: &Path, database: &Path) -> Self {
        Self::serve_as(program, "127.0.0.1:0", database, "info", |_| {}).await
    }

    /// The same at an address to choose, with more for the program.
    pub(crate) async fn serve_at(listen: &str, database: &Path, more: impl FnOnce(&mut Command)) -> Self {
        Self::serve_as(UNDER_TEST.as_ref(), listen, database, "info", more).await
    }

    /// The same with this much in its log.
    pub(crate) async fn serve_logging(database: &Path, level: &str, more: impl FnOnce(&mut Command)) -> Self {
        Self::serve_as(UNDER_TEST.as_ref(), "127.0.0.1:0", database, level, more).await
    }

    async fn serve_as(
        program: &Path,
        listen: &str,
        database: &Path,
        level: &str,
        more: impl FnOnce(&mut Command),
    ) -> Self {
        let mut command = Command::new(program);
        command
            .args(["--log-format", "json", "--log", level, "serve", "--listen", listen, "--database"])
            .arg(database::argument(database).await)
            .stderr(Stdio::piped())
            .kill_on_drop(true);
        more(&mut command);
        let mut child = command.spawn().unwrap();
        let mut log = BufReader::new(child.stderr.take().unwrap()).lines();
        let address = loop {
            let line = soon("the server's log", log.next_line()).await.unwrap().expect("the server starts");
            let line: Value = serde_json::from_str(&line).unwrap();
            if let Some(api) = line["api"].as_str() {
                break api.split_once("://").unwrap().1.parse().unwrap();
            }
        };
        // A log that nobody reads would fill its pipe and stop the server.
        let said = Arc::new(Mutex::new(String::new()));
        let saying = said.clone();
        tokio::spawn(async move {
            while let Ok(Some(line)) = log.next_line().await {
                saying.lock().unwrap().push_str(&(line + "\n"));
            }
        });
        Self { child, address, log: said }
    }

    /// What the program says where it cannot start.
    pub(crate) async fn refusal(database: &Path) -> String {
        Self::refusal_with(database, |_| {}).await
    }

    /// The same with more for the program, such as its environment.
    pub(crate) async fn refusal_with(database: &Path, more: impl FnOnce(&mut Command)) -> String {
        let mut command = Command::new(env!("CARGO_BIN_EXE_palpate-under-test"));
        command.args(["serve", "--listen", "127.0.0.1:0", "--database"]);
        command.arg(database::argument(database).await);
        more(&mut command);
        let refused = soon("the program ends", command.output()).await.unwrap();
        assert!(!refused.status.success());
        String::from_utf8(refused.stderr).unwrap()
    }

    /// What its log has said since it listens.
    pub(crate) fn log(&self) -> String {
        self.log.lock().unwrap().clone()
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    pub(crate) fn caller(&self, transport: Transport) -> Caller {
        Caller::new(transport, channel_to(self.address), Http::new(self.url()))
    }

    pub(crate) fn http(&self) -> Http {
        Http::new(self.url())
    }

    /// Kills it as `kill -9` does: it has no chance to save anything.
    pub(crate) async fn kill(mut self) {
        soon("the process dies", self.child.kill()).await.unwrap();
    }

    /// Asks it to stop, as a service manager does, and gives what it ended with.
    pub(crate) async fn terminate(mut self) -> ExitStatus {
        let id = self.child.id().unwrap().to_string();
        let sent = Command::new("sh").args(["-c", "kill -TERM \"$1\"", "sh", &id]).status().await.unwrap();
        assert!(sent.success());
        soon("the process ends", self.child.wait()).await.unwrap()
    }
}
