//! Where PostgreSQL is: one host, or several of which one takes writes.
//!
//! When a connection breaks, or none can be had, all hosts are asked which of them takes writes by now; new connections
//! then go there. Connections to the others fail at their next use, and are closed.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use sqlx::pool::PoolConnection;
use sqlx::postgres::{PgConnectOptions, PgPool, PgPoolOptions};
use sqlx::{ConnectOptions, Connection, PgConnection, Postgres, Row};
use tokio::sync::Mutex;
use tokio::time::Instant;

use super::open;

/// How long one host may take to say whether it takes writes.
const ASK: Duration = Duration::from_secs(2);
/// How long a connection is waited for before all hosts are asked, where there are several: it may have to be made, far
/// away and encrypted.
const PATIENCE: Duration = Duration::from_secs(2);
/// The wait between two questions, where no host takes writes.
const ASK_AGAIN: Duration = Duration::from_millis(20);

/// The address of a database: `postgres://USER:PASSWORD@HOST:PORT/DATABASE?...`, with several hosts separated by commas.
#[derive(Clone)]
pub struct Address {
    hosts: Vec<PgConnectOptions>,
    /// As it may be shown: without what is secret.
    shown: String,
}

/// Why an address is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}: write postgres://USER@HOST:PORT/DATABASE, with several hosts separated by commas")]
pub struct AddressError(String);

impl Address {
    /// Whether a text is meant to be one.
    pub fn is_meant(text: &str) -> bool {
        text.starts_with("postgres:") || text.starts_with("postgresql:")
    }

    fn with(&self, settings: &[(&str, &str)]) -> Vec<PgConnectOptions> {
        let add = |host: &PgConnectOptions| host.clone().options(settings.iter().copied());
        self.hosts.iter().map(add).collect()
    }

    /// A connection to the host that takes writes.
    ///
    /// # Errors
    /// None of them does, or can be reached: what the last one said.
    pub(in crate::store) async fn connect(&self) -> Result<PgConnection, sqlx::Error> {
        let mut failure = None;
        for host in &self.hosts {
            match ask(host).await {
                Ok(connection) => return Ok(connection),
                Err(error) => failure = Some(error),
            }
        }
        Err(failure.unwrap_or(sqlx::Error::PoolClosed))
    }
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let invalid = |what: &str| AddressError(what.to_owned());
        let (scheme, rest) = text.split_once("://").ok_or_else(|| invalid("there is no ://"))?;
        let end = rest.find(['/', '?']).unwrap_or(rest.len());
        let (authority, tail) = rest.split_at(end);
        let (user, hosts) = match authority.rsplit_once('@') {
            Some((user, hosts)) => (format!("{user}@"), hosts),
            None => (String::new(), authority),
        };
        let parse = |host: &str| {
            let url = format!("{scheme}://{user}{host}{tail}");
            // What is said of it may quote the address, and with it a password.
            let options = PgConnectOptions::from_str(&url).map_err(|_| invalid("this is no address"))?;
            Ok(options.application_name("palpate").disable_statement_logging())
        };
        let hosts: Vec<PgConnectOptions> =
            hosts.split(',').map(parse).collect::<Result<_, AddressError>>()?;
        let places: Vec<String> = hosts.iter().map(place).collect();
        let database = hosts.first().and_then(|host| host.get_database()).unwrap_or_default();
        let shown = format!("postgres://{}/{database}", places.join(","));
        Ok(Self { hosts, shown })
    }
}

/// A host as it is shown.
fn place(host: &PgConnectOptions) -> String {
    match host.get_socket() {
        Some(socket) => socket.display().to_string(),
        None => format!("{}:{}", host.get_host(), host.get_port()),
    }
}

impl fmt::Display for Address {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.shown)
    }
}

impl fmt::Debug for Address {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.shown)
    }
}

/// Connections to the host that takes writes.
#[derive(Clone, Debug)]
pub(in crate::store) struct Hosts(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    pool: PgPool,
    hosts: Vec<PgConnectOptions>,
    /// How long a statement or a new connection may take.
    limit: Duration,
    /// When the hosts were asked last.
    asked: Mutex<Option<Instant>>,
}

impl Hosts {
    /// Up to `most` connections, which are opened when they are needed, each with these settings.
    pub(super) fn new(address: &Address, settings: &[(&str, &str)], most: u32, limit: Duration) -> Self {
        let hosts = address.with(settings);
        let options = PgPoolOptions::new()
            .max_connections(most.max(1))
            .acquire_timeout(limit)
            .test_before_acquire(false)
            .after_connect(|connection, _| {
                Box::pin(async move { open::check(connection).await.map_err(sqlx::Error::config) })
            });
        let first = hosts.first().cloned().unwrap_or_default();
        let pool = options.connect_lazy_with(first);
        Self(Arc::new(Inner { pool, hosts, limit, asked: Mutex::default() }))
    }

    /// A connection.
    ///
    /// # Errors
    /// None could be had in time.
    pub(in crate::store) async fn acquire(&self) -> Result<PoolConnection<Postgres>, sqlx::Error> {
        let end = Instant::now() + self.0.limit;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let patience = if self.0.hosts.len() > 1 { PATIENCE.min(left) } else { left };
            let failure = match tokio::time::timeout(patience, self.0.pool.acquire()).await {
                Ok(Ok(connection)) => return Ok(connection),
                Ok(Err(error @ sqlx::Error::PoolClosed)) => return Err(error),
                Ok(Err(error)) => error,
                Err(_elapsed) => sqlx::Error::PoolTimedOut,
            };
            if Instant::now() >= end {
                return Err(failure);
            }
            self.ask_all().await;
            tokio::time::sleep(ASK_AGAIN).await;
        }
    }

    /// What a statement gives, unless it takes too long.
    pub(in crate::store) async fn in_time<T>(
        &self,
        statement: impl Future<Output = Result<T, sqlx::Error>>,
    ) -> Result<T, sqlx::Error> {
        tokio::time::timeout(self.0.limit, statement).await.unwrap_or_else(|_elapsed| Err(late(self.0.limit)))
    }

    /// Has the hosts asked which of them takes writes, since a connection broke.
    pub(in crate::store) fn suspect(&self) {
        let this = self.clone();
        tokio::spawn(async move { this.ask_all().await });
    }

    /// Asks the hosts which of them takes writes, unless somebody did meanwhile; new connections go there.
    async fn ask_all(&self) {
        let Inner { pool, hosts, asked, .. } = &*self.0;
        if hosts.len() < 2 {
            return;
        }
        let wanted_at = Instant::now();
        let mut asked = asked.lock().await;
        if asked.is_some_and(|asked| asked > wanted_at) {
            return;
        }
        for host in hosts {
            let Ok(connection) = ask(host).await else { continue };
            // Only a question was asked.
            let _ = connection.close().await;
            if place(host) != place(&pool.connect_options()) {
                tracing::warn!(host = place(host), "PostgreSQL takes writes at another host now");
                pool.set_connect_options(host.clone());
            }
            break;
        }
        *asked = Some(Instant::now());
    }

    pub(in crate::store) async fn close(&self) {
        self.0.pool.close().await;
    }
}

/// A connection to this host, which takes writes.
async fn ask(host: &PgConnectOptions) -> Result<PgConnection, sqlx::Error> {
    let asking = async {
        let mut connection = host.connect().await?;
        let row = sqlx::query("select pg_is_in_recovery()").fetch_one(&mut connection).await?;
        if row.try_get::<bool, _>(0)? {
            let reason = format!("{} follows another host and takes no writes", place(host));
            return Err(sqlx::Error::Configuration(reason.into()));
        }
        Ok(connection)
    };
    tokio::time::timeout(ASK, asking).await.unwrap_or_else(|_elapsed| Err(late(ASK)))
}

/// What is said of a host that took longer than it may.
pub(super) fn late(limit: Duration) -> sqlx::Error {
    let waited = format!("PostgreSQL did not answer within {limit:?}");
    sqlx::Error::Io(std::io::Error::new(std::io::ErrorKind::TimedOut, waited))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_may_have_several_hosts_and_shows_no_password() {
        let text = "postgres://lab:se%40cret@one,two:5433/palpate?sslmode=disable";
        let address: Address = text.parse().unwrap();
        assert_eq!(address.to_string(), "postgres://one:5432,two:5433/palpate");
        assert!(!format!("{address:?}").contains("cret"));
        assert!(address.hosts.iter().all(|host| host.get_username() == "lab"));
        for wrong in ["postgres:/lab", "postgres://lab:secret@one:port/palpate"] {
            let error = wrong.parse::<Address>().unwrap_err().to_string();
            assert!(
                error.contains("postgres://USER@HOST:PORT/DATABASE") && !error.contains("secret"),
                "{error}"
            );
        }
    }
}
