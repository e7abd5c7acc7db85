//! What can be said of a log on PostgreSQL without changing it.

use sqlx::{PgConnection, Row};

use super::hosts::{Address, Hosts};
use super::open::{migrations, setting};
use crate::store::backup::{Hear, Progress};
use crate::store::engine::{Connection, sql};
use crate::store::proof::{Proof, prove_all};

/// How long a statement may take that only looks.
const LIMIT: std::time::Duration = std::time::Duration::from_secs(60);

/// What was found out about a log on PostgreSQL.
#[derive(Clone, Debug, Default)]
pub struct SharedInspection {
    /// Why nothing after it is known, if it is so.
    pub unreadable: Option<String>,
    /// PostgreSQL's version.
    pub version: String,
    /// The settings that durability rests on, as a new connection has them.
    pub settings: Vec<(&'static str, String)>,
    /// Whether the connection is encrypted.
    pub is_encrypted: bool,
    /// Servers that follow this one, as far as the role may see them.
    pub standbys: i64,
    /// Those of them that commits wait for.
    pub waited_for: i64,
    /// Bytes of the database.
    pub bytes: Option<i64>,
    /// Changes of the tables that this version makes and the database has not seen.
    pub pending_migrations: Vec<String>,
    /// Changes of the tables that this version does not know.
    pub unknown_migrations: Vec<i64>,
    /// What its sessions turned out to be.
    pub proof: Option<Proof>,
}

/// Looks at a log. The longest part is heard of by `hear`.
pub async fn inspect_shared(address: &Address, hear: Hear<'_>) -> SharedInspection {
    let mut found = SharedInspection::default();
    if let Err(error) = look(address, &mut found, hear).await {
        found.unreadable = Some(error.to_string());
    }
    found
}

async fn look(address: &Address, found: &mut SharedInspection, hear: Hear<'_>) -> Result<(), sqlx::Error> {
    let mut connection = address.connect().await?;
    found.version = setting(&mut connection, "server_version").await?;
    for name in ["fsync", "full_page_writes", "synchronous_commit", "synchronous_standby_names"] {
        found.settings.push((name, setting(&mut connection, name).await?));
    }
    let encrypted = "select coalesce((select ssl from pg_stat_ssl where pid = pg_backend_pid()), false)";
    found.is_encrypted = one(&mut connection, encrypted).await.unwrap_or(false);
    let standbys = "select count(*) from pg_stat_replication";
    found.standbys = one(&mut connection, standbys).await.unwrap_or(0);
    let waited_for = "select count(*) from pg_stat_replication where sync_state <> 'async'";
    found.waited_for = one(&mut connection, waited_for).await.unwrap_or(0);
    found.bytes = one(&mut connection, "select pg_database_size(current_database())").await.ok();
    let is_new: bool = one(&mut connection, "select to_regclass('_sqlx_migrations') is null").await?;
    let applied: Vec<i64> = if is_new {
        Vec::new()
    } else {
        sqlx::query_scalar("select version from _sqlx_migrations").fetch_all(&mut connection).await?
    };
    let migrations = migrations();
    for migration in migrations.iter().filter(|migration| !applied.contains(&migration.version)) {
        found.pending_migrations.push(migration.description.to_string());
    }
    found.unknown_migrations =
        applied.into_iter().filter(|version| !migrations.version_exists(*version)).collect();
    if !found.pending_migrations.is_empty() || !found.unknown_migrations.is_empty() {
        return Ok(());
    }
    let mut connection = Connection::Postgres(Hosts::new(address, &[], 1, LIMIT).acquire().await?);
    let events = sql("select count(*) from events").scalar::<i64>(&mut connection).await?;
    let events = u64::try_from(events.unwrap_or(0)).unwrap_or(0);
    found.proof = Some(prove_all(&mut connection, &|read| hear(Progress::Proved(read, events))).await?);
    connection.close().await
}

async fn one<T>(connection: &mut PgConnection, query: &'static str) -> Result<T, sqlx::Error>
where
    T: for<'r> sqlx::Decode<'r, sqlx::Postgres> + sqlx::Type<sqlx::Postgres>,
{
    sqlx::query(query).fetch_one(connection).await?.try_get(0)
}
