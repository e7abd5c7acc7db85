//! The whole server on one port, from opening the log to the last open stream.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use http::HeaderValue;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tonic::service::Routes;
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;
use tower::util::option_layer;

use crate::api::Api;
use crate::limits::Limits;
use crate::store::{OpenError, Store};
use crate::{cors, grpc, http as web};

/// A silent connection is probed this often, and given up when it does not answer in time.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(20);
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(10);
/// Bounds on streams that a peer opens and resets at once, as hyper has them where tonic sets none.
const PENDING_RESETS: usize = 20;
const LOCAL_RESETS: usize = 1024;

/// What a server is started with.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// The SQLite file that holds all sessions; made where it does not exist.
    pub database: PathBuf,
    /// The bounds on what comes from the network.
    pub limits: Limits,
    /// Web origins whose pages may call, such as `https://lab.example`; no other page may, and there is no wildcard.
    pub allowed_origins: Vec<HeaderValue>,
}

impl Default for ServeOptions {
    fn default() -> Self {
        Self { database: "palpate.db".into(), limits: Limits::default(), allowed_origins: Vec::new() }
    }
}

/// Why the server could not start, or ended early.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The event log cannot be used.
    #[error(transparent)]
    Store(#[from] OpenError),
    /// A wildcard would let every page that a browser opens command the robot.
    #[error(
        "the allowed origin \"*\" would let any web page call: name each origin, as in https://lab.example"
    )]
    AnyOrigin,
    /// The socket or a connection failed.
    #[error("the server failed: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// The embedded descriptors cannot be read, which is a fault of the build.
    #[error("the contract's descriptors cannot be read: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
    /// The socket has no address.
    #[error("the listening socket cannot be used: {0}")]
    Listener(#[from] std::io::Error),
}

/// Serves gRPC, gRPC-Web, HTTP and server-sent events on `listener` until `shutdown` is cancelled.
///
/// Then open streams end, calls that have begun are answered, and every accepted write is on disk.
///
/// # Errors
/// The event log cannot be opened, or the socket fails.
pub async fn serve(
    listener: TcpListener,
    options: ServeOptions,
    shutdown: CancellationToken,
) -> Result<(), ServeError> {
    let ServeOptions { database, limits, allowed_origins } = options;
    let address: SocketAddr = listener.local_addr()?;
    if allowed_origins.iter().any(|origin| origin == "*") {
        return Err(ServeError::AnyOrigin);
    }
    let store = Store::open(&database, &limits).await?;
    let api = Api::new(store, limits, shutdown.clone());
    let (grpc_routes, health) = grpc::router(&api)?;
    grpc::report_health(health.clone(), true).await;
    // Around all routes: a browser asks for leave before it calls over gRPC-Web, too.
    let pages = option_layer(cors::layer(allowed_origins));
    let routes = Routes::from(grpc_routes.merge(web::router(api.clone())).layer(pages));

    let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
    let serving = builder(api.limits())
        .add_routes(routes)
        .serve_with_incoming_shutdown(incoming, shutdown.clone().cancelled_owned());
    tracing::info!(
        api = %format!("http://{address}"),
        docs = %format!("http://{address}/docs"),
        database = %database.display(),
        "palpate listens for gRPC and HTTP"
    );

    tokio::pin!(serving);
    let mut outcome = tokio::select! {
        outcome = &mut serving => Some(outcome),
        () = shutdown.cancelled() => None,
    };
    if outcome.is_none() {
        grpc::report_health(health, false).await;
        outcome = tokio::time::timeout(api.limits().drain, &mut serving).await.ok();
    }
    if outcome.is_none() {
        tracing::warn!("connections were still open when the time to finish was over: they are cut");
    }
    api.finish().await;
    outcome.unwrap_or(Ok(())).map_err(ServeError::from)
}

fn builder(limits: &Limits) -> Server {
    Server::builder()
        .accept_http1(true)
        .max_concurrent_streams(limits.connection_streams)
        .http2_max_header_list_size(limits.header_bytes)
        .http2_max_pending_accept_reset_streams(Some(PENDING_RESETS))
        .http2_max_local_error_reset_streams(Some(LOCAL_RESETS))
        .http2_keepalive_interval(Some(KEEPALIVE_INTERVAL))
        .http2_keepalive_timeout(Some(KEEPALIVE_TIMEOUT))
}

#[cfg(test)]
mod tests;
