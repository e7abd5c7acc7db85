//! Opening the log on PostgreSQL: its tables are brought up to date, and the settings that durability rests on are read
//! back and insisted on, of every connection.

use std::time::Duration;

use sqlx::migrate::{MigrateError, Migrator};
use sqlx::{Connection as _, PgConnection, Row};
use uuid::Uuid;

use super::hosts::{Address, Hosts};
use crate::limits::Limits;
use crate::store::engine::Pool;
use crate::store::open::OpenError;

/// How often the tables are made, and the wait in between: servers that start together make them at once.
const ATTEMPTS: u32 = 20;
const RETRY_AFTER: Duration = Duration::from_millis(100);
/// The oldest release whose settings are known.
const OLDEST: i64 = 130_000;
/// Connections for what is kept beside the log.
const KEEPERS: u32 = 1;

/// The changes of the tables, by which nothing is locked but what they change.
pub(in crate::store) fn migrations() -> Migrator {
    let mut migrations = sqlx::migrate!("../migrations/postgres");
    // The lock would be an advisory one, which engines that shard do not have. Who comes second fails on what the first
    // is doing, and finds it done when he tries again.
    migrations.set_locking(false);
    migrations
}

/// An open log.
#[derive(Debug)]
pub(in crate::store) struct Opened {
    pub(in crate::store) readers: Pool,
    pub(in crate::store) writers: Pool,
    /// For caches, whose loss is none.
    pub(in crate::store) keepers: Pool,
}

/// Opens the log, or makes a new one.
///
/// # Errors
/// It cannot be reached, or does not keep what is promised.
pub(in crate::store) async fn open(address: &Address, limits: &Limits) -> Result<Opened, OpenError> {
    let mut connection = prepared(address).await?;
    tell_standby(&mut connection).await;
    let _ = connection.close().await;
    let limit = limits.database_timeout;
    let milliseconds = limit.as_millis().to_string();
    let reading = [("statement_timeout", &*milliseconds), ("default_transaction_read_only", "on")];
    // A statement that waits for a lock ends; one that commits must not: a commit that is given up while it waits for a
    // standby is done all the same, and would be acknowledged.
    let writing = [("lock_timeout", &*milliseconds), ("idle_in_transaction_session_timeout", &*milliseconds)];
    let keeping = [("statement_timeout", &*milliseconds)];
    let half = limits.database_connections.div_ceil(2);
    let pool = |settings: &[(&str, &str)], most| Pool::Postgres(Hosts::new(address, settings, most, limit));
    Ok(Opened {
        readers: pool(&reading, half),
        writers: pool(&writing, limits.database_connections - half),
        keepers: pool(&keeping, KEEPERS),
    })
}

/// A connection to a log whose tables are up to date.
///
/// # Errors
/// It cannot be reached, or does not keep what is promised.
pub(in crate::store) async fn prepared(address: &Address) -> Result<PgConnection, OpenError> {
    let failed = |source| OpenError::Connect { address: address.clone(), source };
    for attempt in 1.. {
        let mut connection = address.connect().await.map_err(failed)?;
        checked(&mut connection).await?;
        match bring_up_to_date(&mut connection).await {
            Ok(()) => return Ok(connection),
            Err(error @ OpenError::Migrate(MigrateError::VersionMissing(_))) => return Err(error),
            Err(error) if attempt == ATTEMPTS => return Err(error),
            Err(_) => tokio::time::sleep(RETRY_AFTER).await,
        }
    }
    Err(failed(sqlx::Error::PoolTimedOut))
}

async fn bring_up_to_date(connection: &mut PgConnection) -> Result<(), OpenError> {
    migrations().run_direct(None, connection, false).await?;
    sqlx::query("insert into log (id, identity, checked_us) values (1, $1, 0) on conflict (id) do nothing")
        .bind(Uuid::now_v7().to_string())
        .execute(connection)
        .await?;
    Ok(())
}

/// Insists on the settings that durability rests on, and that the host takes writes.
///
/// # Errors
/// It does not keep what is promised.
pub(super) async fn check(connection: &mut PgConnection) -> Result<(), OpenError> {
    checked(connection).await?;
    let row = sqlx::query("select pg_is_in_recovery()").fetch_one(&mut *connection).await?;
    if row.try_get::<bool, _>(0)? {
        let found = "a standby".to_owned();
        return Err(OpenError::Setting { setting: "the host", found, needed: "one that takes writes" });
    }
    Ok(())
}

async fn checked(connection: &mut PgConnection) -> Result<(), OpenError> {
    let version = setting(connection, "server_version_num").await?;
    if version.parse().is_ok_and(|version: i64| version < OLDEST) {
        let found = setting(connection, "server_version").await?;
        return Err(OpenError::Setting { setting: "server_version", found, needed: "13 or newer" });
    }
    // Engines that only speak PostgreSQL's protocol may have no such settings.
    for name in ["fsync", "full_page_writes"] {
        let found = setting(connection, name).await?;
        if found == "off" {
            return Err(OpenError::Setting { setting: name, found, needed: "on" });
        }
    }
    if !is_durable(&setting(connection, "synchronous_commit").await?) {
        sqlx::query("set synchronous_commit = on").execute(&mut *connection).await?;
    }
    let found = setting(connection, "synchronous_commit").await?;
    if is_durable(&found) {
        return Ok(());
    }
    Err(OpenError::Setting { setting: "synchronous_commit", found, needed: "on or remote_apply" })
}

/// Whether what is committed is on disk, and on that of the standbys that commits wait for, where there are some.
fn is_durable(synchronous_commit: &str) -> bool {
    matches!(synchronous_commit, "on" | "remote_apply" | "")
}

/// Says so where standbys follow that no commit waits for: what was acknowledged last is lost with the primary.
async fn tell_standby(connection: &mut PgConnection) {
    let query = "select count(*), count(*) filter (where sync_state <> 'async') from pg_stat_replication";
    let Ok(row) = sqlx::query(query).fetch_one(connection).await else { return };
    let (standbys, waited) = (row.try_get::<i64, _>(0).unwrap_or(0), row.try_get::<i64, _>(1).unwrap_or(0));
    if standbys > 0 && waited == 0 {
        tracing::warn!(
            standbys,
            "no commit waits for a standby: a failover may lose touches that were acknowledged; \
             set synchronous_standby_names"
        );
    }
}

/// A setting as the engine tells it; empty where it has none of this name.
pub(in crate::store) async fn setting(
    connection: &mut PgConnection,
    name: &str,
) -> Result<String, sqlx::Error> {
    let row = sqlx::query("select current_setting($1, true)").bind(name).fetch_one(connection).await?;
    Ok(row.try_get::<Option<String>, _>(0)?.unwrap_or_default())
}
