//! Takes connections in: no more than the process can have open, and without haste when it cannot take any.

use std::io::{ErrorKind, Write};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;

use super::connection::Connections;
use crate::limits::Limits;

/// Files that are kept for the database, its log and the runtime.
const RESERVED_FILES: u64 = 64;
/// After a failure nothing is accepted for this long, and twice as long after each further one.
const FIRST_PAUSE: Duration = Duration::from_millis(10);
const LONGEST_PAUSE: Duration = Duration::from_secs(1);
/// Connections that are turned away are logged no more often than this.
const LOG_INTERVAL: Duration = Duration::from_secs(10);
/// What a caller over HTTP/1 reads that is turned away; over HTTP/2 the connection just ends.
const TURNED_AWAY: &str = r#"{"type":"about:blank","title":"Service Unavailable","status":503,"detail":"the server has as many connections as it may: close some, or try again in a moment","reason":"OVERLOADED","fields":[],"retry_after_ms":1000}"#;

/// How many connections are taken at once: the limit, or what the limit on open files leaves.
pub(super) fn capacity(limits: &Limits) -> usize {
    let Some(files) = open_files() else { return limits.connections };
    let left = files.saturating_sub(RESERVED_FILES).max(files / 2);
    let capacity = limits.connections.min(usize::try_from(left).unwrap_or(usize::MAX));
    if capacity < limits.connections {
        tracing::info!(
            capacity,
            files,
            "the process may not open more files (ulimit -n): it takes fewer connections"
        );
    }
    capacity
}

#[cfg(unix)]
fn open_files() -> Option<u64> {
    rustix::process::getrlimit(rustix::process::Resource::Nofile).current
}

#[cfg(not(unix))]
fn open_files() -> Option<u64> {
    None
}

/// Serves what connects until `shutdown`, and then what has connected until it has ended.
pub(super) async fn run(
    listener: TcpListener,
    capacity: usize,
    connections: Arc<Connections>,
    shutdown: CancellationToken,
) {
    let mut open = JoinSet::new();
    let mut pause = Pause::default();
    let mut turned_away = TurnedAway::default();
    loop {
        let (stream, peer) = tokio::select! {
            accepted = pause.accept(|| listener.accept()) => accepted,
            Some(_) = open.join_next() => continue,
            () = shutdown.cancelled() => break,
        };
        if open.len() >= capacity {
            turned_away.count(capacity);
            turn_away(stream);
            continue;
        }
        let (connections, shutdown) = (connections.clone(), shutdown.clone());
        open.spawn(async move { connections.serve(stream, peer, shutdown).await });
    }
    drop(listener);
    while open.join_next().await.is_some() {}
}

/// Says why, if it can be said without waiting, and hangs up.
fn turn_away(stream: TcpStream) {
    if let Ok(mut stream) = stream.into_std() {
        // Nobody is owed more than an attempt.
        let _ = write!(
            stream,
            "HTTP/1.1 503 Service Unavailable\r\ncontent-type: application/problem+json\r\nretry-after: 1\r\n\
             connection: close\r\ncontent-length: {}\r\n\r\n{TURNED_AWAY}",
            TURNED_AWAY.len()
        );
    }
}

/// Counts what is turned away, and says so now and then.
#[derive(Debug, Default)]
struct TurnedAway {
    count: u64,
    logged: Option<Instant>,
}

impl TurnedAway {
    fn count(&mut self, capacity: usize) {
        self.count += 1;
        if self.logged.is_none_or(|logged| logged.elapsed() >= LOG_INTERVAL) {
            let turned_away = std::mem::take(&mut self.count);
            self.logged = Some(Instant::now());
            tracing::warn!(capacity, turned_away, "all connections are taken: new ones are turned away");
        }
    }
}

/// Waits ever longer while nothing can be accepted, instead of trying without end.
#[derive(Debug, Default)]
struct Pause {
    length: Duration,
    until: Option<Instant>,
}

impl Pause {
    /// The next connection. May be dropped and called again: what is left of a pause is waited for then.
    async fn accept<T, F>(&mut self, accept: impl Fn() -> F) -> (T, SocketAddr)
    where
        F: Future<Output = std::io::Result<(T, SocketAddr)>>,
    {
        loop {
            if let Some(until) = self.until {
                sleep_until(until).await;
                self.until = None;
            }
            match accept().await {
                Ok(accepted) => {
                    if !self.length.is_zero() {
                        tracing::info!("connections are accepted again");
                    }
                    self.length = Duration::ZERO;
                    return accepted;
                }
                // The peer left before it was let in.
                Err(error)
                    if matches!(
                        error.kind(),
                        ErrorKind::ConnectionAborted | ErrorKind::ConnectionReset | ErrorKind::Interrupted
                    ) => {}
                Err(error) => self.lengthen(&error),
            }
        }
    }

    fn lengthen(&mut self, error: &std::io::Error) {
        if self.length.is_zero() {
            tracing::error!(%error, "no connection can be accepted: the server waits until one can");
        }
        self.length = (self.length * 2).clamp(FIRST_PAUSE, LONGEST_PAUSE);
        self.until = Some(Instant::now() + self.length);
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::future::ready;

    use super::*;

    #[tokio::test]
    async fn a_listener_that_fails_is_asked_less_and_less_often() {
        let (began, calls) = (Instant::now(), Cell::new(0));
        let accept = || {
            calls.set(calls.get() + 1);
            // Too many open files, for a while.
            if began.elapsed() < Duration::from_millis(500) {
                return ready(Err(std::io::Error::from_raw_os_error(24)));
            }
            ready(Ok(((), SocketAddr::from(([127, 0, 0, 1], 1)))))
        };
        let mut pause = Pause::default();
        pause.accept(accept).await;
        // After pauses of 10, 20, 40 ms and so on.
        assert!((3..=8).contains(&calls.get()), "{calls:?}");
        pause.accept(accept).await;
        assert_eq!(pause.length, Duration::ZERO);
    }

    #[test]
    fn a_limit_on_connections_is_never_exceeded() {
        let limits = Limits { connections: 3, ..Limits::default() };
        assert_eq!(capacity(&limits), 3);
    }
}
