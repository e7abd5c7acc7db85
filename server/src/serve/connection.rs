//! One connection: HTTP/1 or HTTP/2, until it is idle for too long, the peer leaves, or the server stops.

use std::convert::Infallible;
use std::net::SocketAddr;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use http::Request;
use hyper::body::Incoming;
use hyper::service::service_fn;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::time::sleep;
use tokio_util::sync::CancellationToken;
use tonic::transport::server::TcpConnectInfo;

use super::activity::Activity;
use super::door::Door;
use super::stall::Patient;
use super::tls::{self, Tls};
use crate::access::CertificateName;
use crate::limits::Limits;

/// A silent connection is probed this often, and given up when it does not answer in time.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(20);
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(10);
/// Bounds on streams that a peer opens and resets at once, as hyper has them by default.
const PENDING_RESETS: usize = 20;
const LOCAL_RESETS: usize = 1024;
/// How long a peer may take to take leave.
const FAREWELL: Duration = Duration::from_secs(5);
/// A head over HTTP/1 is read up to this many times its limit, so that one over the limit is refused in words.
const READ_HEAD_TIMES: usize = 8;
/// Less than this hyper does not read at once.
const LEAST_BUFFER_BYTES: usize = 8192;

/// Serves connections, all by the same rules.
#[derive(Debug)]
pub(super) struct Connections {
    router: Router,
    door: Door,
    tls: Option<Tls>,
    protocol: Builder<TokioExecutor>,
    idle: Duration,
    send_timeout: Duration,
    handshake_timeout: Duration,
}

impl Connections {
    pub(super) fn new(router: Router, door: Door, tls: Option<Tls>, limits: &Limits) -> Self {
        Self {
            router,
            door,
            tls,
            protocol: protocol(limits),
            idle: limits.idle,
            send_timeout: limits.send_timeout,
            handshake_timeout: limits.head_timeout,
        }
    }

    /// Serves one connection to its end.
    pub(super) async fn serve(&self, stream: TcpStream, peer: SocketAddr, shutdown: CancellationToken) {
        // Replies are small and somebody waits for them. Where it cannot be set, they are only slower.
        let _ = stream.set_nodelay(true);
        let address = TcpConnectInfo { local_addr: stream.local_addr().ok(), remote_addr: Some(peer) };
        let Some(tls) = &self.tls else {
            return self.answer(Patient::new(stream, self.send_timeout), address, None, peer, shutdown).await;
        };
        let handshake = tokio::time::timeout(self.handshake_timeout, tls.accept(stream, self.send_timeout));
        let handshake = shutdown.run_until_cancelled(handshake);
        match handshake.await {
            Some(Ok(Ok(stream))) => {
                let name = tls::client_name(&stream);
                self.answer(stream, address, name, peer, shutdown).await;
            }
            Some(Ok(Err(error))) => tracing::info!(%peer, %error, "a connection was not encrypted"),
            Some(Err(_elapsed)) => tracing::debug!(%peer, "a connection took too long to be encrypted"),
            None => {}
        }
    }

    /// Answers requests until the connection ends.
    async fn answer(
        &self,
        stream: impl AsyncRead + AsyncWrite + Unpin + 'static,
        address: TcpConnectInfo,
        name: Option<CertificateName>,
        peer: SocketAddr,
        shutdown: CancellationToken,
    ) {
        let activity = Activity::new();
        let service = service_fn(|request: Request<Incoming>| {
            let open = activity.begin();
            let (door, router) = (self.door.clone(), self.router.clone());
            let (address, name) = (address.clone(), name.clone());
            async move {
                let mut request = request.map(Body::new);
                request.extensions_mut().insert(address);
                if let Some(name) = name {
                    request.extensions_mut().insert(name);
                }
                let response = door.pass(request, router).await;
                Ok::<_, Infallible>(response.map(|body| open.until_sent(body)))
            }
        });
        let connection = self.protocol.serve_connection(TokioIo::new(stream), service);
        tokio::pin!(connection);
        tokio::select! {
            outcome = connection.as_mut() => return log_end(peer, outcome),
            () = activity.quiet_for(self.idle) => tracing::debug!(%peer, "an idle connection is closed"),
            () = shutdown.cancelled() => {}
        }
        connection.as_mut().graceful_shutdown();
        // A peer that does not take leave is not waited for; one with an open request is.
        let farewell = async {
            sleep(FAREWELL).await;
            activity.quiet_for(FAREWELL).await;
        };
        tokio::select! {
            outcome = connection => log_end(peer, outcome),
            () = farewell => tracing::debug!(%peer, "a connection is cut"),
        }
    }
}

fn log_end(peer: SocketAddr, outcome: Result<(), Box<dyn std::error::Error + Send + Sync>>) {
    if let Err(error) = outcome {
        tracing::debug!(%peer, error, "a connection failed");
    }
}

fn protocol(limits: &Limits) -> Builder<TokioExecutor> {
    let mut builder = Builder::new(TokioExecutor::new());
    let head_bytes = limits.header_bytes as usize * READ_HEAD_TIMES;
    builder
        .http1()
        .timer(TokioTimer::new())
        .header_read_timeout(limits.head_timeout)
        .max_buf_size(head_bytes.max(LEAST_BUFFER_BYTES));
    builder
        .http2()
        .timer(TokioTimer::new())
        .max_concurrent_streams(limits.connection_streams)
        .max_header_list_size(limits.header_bytes)
        .max_pending_accept_reset_streams(PENDING_RESETS)
        .max_local_error_reset_streams(LOCAL_RESETS)
        .keep_alive_interval(KEEPALIVE_INTERVAL)
        .keep_alive_timeout(KEEPALIVE_TIMEOUT);
    builder
}
