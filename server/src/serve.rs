//! The whole server on one port, from opening the log to the last open stream.

mod accept;
mod activity;
pub(crate) mod bodies;
mod connection;
mod door;
mod headers;
mod origin;
mod stall;
mod tls;

use std::net::SocketAddr;
use std::sync::Arc;

use axum::Router;
use http::HeaderValue;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tower::util::option_layer;

use crate::access::Registry;
use crate::access::guard::Guard;
use crate::api::Api;
use crate::limits::Limits;
use crate::store::{Location, OpenError, Store};
use crate::{cors, grpc, http as web};
use bodies::Bodies;
use connection::Connections;
use door::Door;
pub use origin::{parse_host, parse_origin};
use tls::Tls;
pub use tls::{TlsError, TlsFiles};

/// What a server is started with.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// Where all sessions are; a file is made where it does not exist.
    pub database: Location,
    /// The bounds on what comes from the network.
    pub limits: Limits,
    /// Web origins whose pages may call, such as `https://lab.example`; no other page may, and there is no wildcard.
    pub allowed_origins: Vec<HeaderValue>,
    /// Names that the server is called by, such as `palpate.lan`, beside those of the loopback, which always count.
    ///
    /// On a loopback address no others are taken; on other addresses any is taken where none is given.
    pub allowed_hosts: Vec<String>,
    /// Whether callers have to say who they are, with a token or a certificate; otherwise whoever reaches the server
    /// may do everything.
    pub require_tokens: bool,
    /// The certificate of the server, where it speaks TLS.
    pub tls: Option<TlsFiles>,
    /// Routes of the program around the server, let in by the same rules; empty unless it has any.
    pub additional_routes: Router,
}

impl Default for ServeOptions {
    fn default() -> Self {
        Self {
            database: Location::File("palpate.db".into()),
            limits: Limits::default(),
            allowed_origins: Vec::new(),
            allowed_hosts: Vec::new(),
            require_tokens: false,
            tls: None,
            additional_routes: Router::new(),
        }
    }
}

/// Why the server could not start, or ended early.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The event log cannot be used.
    #[error(transparent)]
    Store(#[from] OpenError),
    /// Callers have to say who they are, and none of them can.
    #[error(
        "this server would ask callers for tokens, and the database {database} has none in force.\n\
         Make one first:  palpate token create --database {database} --name arm-1\n\
         On 127.0.0.1 none are asked unless required; --insecure-open asks nobody, on any address."
    )]
    NobodyMayCall {
        /// Whose tokens count.
        database: Location,
    },
    /// The tokens cannot be read.
    #[error("the tokens cannot be read: {0}")]
    Tokens(String),
    /// The server cannot speak TLS as it is told to.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// An origin that no page has, or that every page can have.
    #[error("the allowed origin {origin:?} {advice}")]
    Origin {
        /// What was given.
        origin: String,
        /// What is wrong with it and what to write instead.
        advice: String,
    },
    /// A name that no request can be for.
    #[error("the allowed host {host:?} {advice}")]
    Host {
        /// What was given.
        host: String,
        /// What is wrong with it and what to write instead.
        advice: String,
    },
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
    let ServeOptions {
        database,
        limits,
        allowed_origins,
        allowed_hosts,
        require_tokens,
        tls,
        additional_routes,
    } = options;
    let address: SocketAddr = listener.local_addr()?;
    let allowed_origins = checked_origins(&allowed_origins)?;
    let door = Door::new(address, checked_hosts(&allowed_hosts)?, allowed_origins.clone(), &limits);
    // The page is made ready while the log is opened.
    tokio::task::spawn_blocking(palpate_dashboard::router);
    let store = Store::open(&database, palpate_core::reconstruction::version(), &limits).await?;
    let has_client_ca = tls.as_ref().is_some_and(|files| files.client_ca.is_some());
    let tls = tls.map(|files| Tls::start(files, shutdown.clone())).transpose()?;
    let registry = if require_tokens || has_client_ca {
        let registry = Registry::start(store.token_reader(), shutdown.clone()).await;
        let registry = registry.map_err(|error| ServeError::Tokens(error.to_string()))?;
        if !has_client_ca && !registry.has_usable() {
            return Err(ServeError::NobodyMayCall { database });
        }
        Some(registry)
    } else {
        None
    };
    let guard = Guard::new(registry, &store, &limits);
    let api = Api::new(store, limits, shutdown.clone());
    let bodies = Bodies::new(api.limits());
    let (grpc_routes, health) = grpc::router(&api, guard.clone(), bodies.clone())?;
    grpc::report_health(health.clone(), true).await;
    // Around all routes: a browser asks for leave before it calls over gRPC-Web, too.
    let pages = option_layer(cors::layer(allowed_origins));
    let router = grpc_routes.merge(web::router(api.clone(), &guard, bodies, additional_routes)).layer(pages);

    let scheme = if tls.is_some() { "https" } else { "http" };
    let connections = Arc::new(Connections::new(router, door, tls, api.limits()));
    // Each open connection holds them, and so does the loop that accepts.
    let held = Arc::downgrade(&connections);
    api.metrics().connections_are(move || held.strong_count().saturating_sub(1));
    tracing::info!(
        api = %format!("{scheme}://{address}"),
        dashboard = %format!("{scheme}://{address}/"),
        docs = %format!("{scheme}://{address}/docs"),
        %database,
        "palpate listens for gRPC and HTTP"
    );

    let capacity = accept::capacity(api.limits());
    let accepting = accept::run(listener, capacity, connections, shutdown.clone());
    tokio::pin!(accepting);
    tokio::select! {
        () = &mut accepting => {}
        () = shutdown.cancelled() => {
            grpc::report_health(health, false).await;
            if tokio::time::timeout(api.limits().drain, &mut accepting).await.is_err() {
                tracing::warn!("connections were still open when the time to finish was over: they are cut");
            }
        }
    }
    api.finish().await;
    Ok(())
}

fn checked_origins(origins: &[HeaderValue]) -> Result<Vec<HeaderValue>, ServeError> {
    let check = |origin: &HeaderValue| {
        let origin = String::from_utf8_lossy(origin.as_bytes()).into_owned();
        parse_origin(&origin).map_err(|advice| ServeError::Origin { origin, advice })
    };
    origins.iter().map(check).collect()
}

fn checked_hosts(hosts: &[String]) -> Result<Vec<String>, ServeError> {
    let check =
        |host: &String| parse_host(host).map_err(|advice| ServeError::Host { host: host.clone(), advice });
    hosts.iter().map(check).collect()
}

#[cfg(test)]
mod tests;
