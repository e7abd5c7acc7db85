//! A connection whose every byte a test chooses.

use std::net::SocketAddr;
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use super::{Outcome, Refused, soon};

/// Between two bytes that dribble.
const PAUSE: Duration = Duration::from_millis(20);

/// An open connection that speaks HTTP/1, or nothing yet.
#[derive(Debug)]
pub(crate) struct Raw(TcpStream);

impl Raw {
    pub(crate) async fn open(address: SocketAddr) -> Self {
        Self(soon("a connection", TcpStream::connect(address)).await.unwrap())
    }

    pub(crate) async fn say(&mut self, text: impl AsRef<[u8]>) {
        soon("what is said leaves", self.0.write_all(text.as_ref())).await.unwrap();
    }

    /// Says as much as the server takes.
    pub(crate) async fn try_say(&mut self, text: impl AsRef<[u8]>) {
        let _ = soon("what is said leaves", self.0.write_all(text.as_ref())).await;
    }

    /// All that comes until the server hangs up, by whatever means.
    pub(crate) async fn hear_to_the_end(&mut self) -> String {
        let mut heard = Vec::new();
        let _ = soon("the connection ends", self.0.read_to_end(&mut heard)).await;
        String::from_utf8_lossy(&heard).into_owned()
    }

    /// The same, while a byte is said now and then.
    pub(crate) async fn dribble_to_the_end(&mut self) -> String {
        let (mut from, mut to) = self.0.split();
        let dribble = async {
            while to.write_all(b"x").await.is_ok() {
                tokio::time::sleep(PAUSE).await;
            }
            std::future::pending::<()>().await;
        };
        let mut heard = Vec::new();
        tokio::select! {
            _ = soon("the connection ends", from.read_to_end(&mut heard)) => {}
            () = dribble => {}
        }
        String::from_utf8_lossy(&heard).into_owned()
    }

    /// What comes until this is part of it.
    pub(crate) async fn hear(&mut self, awaited: &str) -> String {
        let mut heard = String::new();
        while !heard.contains(awaited) {
            let mut piece = [0; 4096];
            let count = soon(awaited, self.0.read(&mut piece)).await.unwrap();
            assert!(count > 0, "the connection ended after {heard:?}");
            heard.push_str(&String::from_utf8_lossy(&piece[..count]));
        }
        heard
    }
}

/// Says something on a connection of its own, and gives the answer: its whole text, or the refusal.
pub(crate) async fn say_raw(address: SocketAddr, text: impl AsRef<[u8]>) -> Outcome<String> {
    let mut raw = Raw::open(address).await;
    raw.say(text).await;
    outcome(raw.hear_to_the_end().await)
}

/// A whole answer, or the refusal that it is.
#[track_caller]
pub(crate) fn outcome(answer: String) -> Outcome<String> {
    let (head, body) = answer.split_once("\r\n\r\n").unwrap_or_else(|| panic!("no answer: {answer:?}"));
    let status: u16 = head.split(' ').nth(1).unwrap().parse().unwrap();
    if status < 400 {
        return Ok(answer);
    }
    let head = head.to_ascii_lowercase();
    let (_, rest) = head.split_once("content-type: ").unwrap_or_else(|| panic!("{answer}"));
    Err(Refused::from_problem(status, rest.lines().next().unwrap(), body))
}
