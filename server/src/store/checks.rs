//! What is insisted on before a log is used: the engine, its settings, the pages of the file, and the tables.

use std::collections::BTreeMap;
use std::path::Path;

use sqlx::SqliteConnection;
use sqlx::migrate::Migrator;
use sqlx::sqlite::{SqliteConnectOptions, SqlitePoolOptions};

use super::open::{OpenError, SQLITE_CORRUPT, primary_code};

/// Before this release a WAL file could be corrupted by a checkpoint.
pub(super) const OLDEST_SQLITE: [u32; 3] = [3, 51, 3];

/// The engine.
///
/// # Errors
/// It may lose data.
pub(super) async fn version(connection: &mut SqliteConnection) -> Result<(), OpenError> {
    let found: String = sqlx::query_scalar("select sqlite_version()").fetch_one(connection).await?;
    if is_new_enough(&found) { Ok(()) } else { Err(OpenError::OldSqlite { found }) }
}

fn is_new_enough(version: &str) -> bool {
    let parts: Vec<u32> = version.split('.').map_while(|part| part.parse().ok()).collect();
    parts.as_slice() >= OLDEST_SQLITE.as_slice()
}

/// The settings that durability rests on, read back.
///
/// # Errors
/// One did not take.
pub(super) async fn settings(connection: &mut SqliteConnection) -> Result<(), OpenError> {
    let found: String = sqlx::query_scalar("pragma journal_mode").fetch_one(&mut *connection).await?;
    if found != "wal" {
        return Err(OpenError::Setting { setting: "journal_mode", found, needed: "wal" });
    }
    for (setting, query, needed) in [
        ("synchronous", "pragma synchronous", "2"), // 2 is full
        ("foreign_keys", "pragma foreign_keys", "1"),
    ] {
        let found: i64 = sqlx::query_scalar(query).fetch_one(&mut *connection).await?;
        if found.to_string() != needed {
            return Err(OpenError::Setting { setting, found: found.to_string(), needed });
        }
    }
    Ok(())
}

/// The pages of the file, and that tables and indices say the same: a retry that an index does not find would be
/// carried out twice, and an event whose session is gone would be shown to nobody.
///
/// # Errors
/// One of them is damaged.
pub(super) async fn pages(connection: &mut SqliteConnection, database: &Path) -> Result<(), OpenError> {
    let found = match damage(connection).await {
        Ok(None) => return Ok(()),
        Ok(Some(found)) => found,
        Err(error) if primary_code(&error) == Some(SQLITE_CORRUPT) => error.to_string(),
        Err(error) => return Err(error.into()),
    };
    Err(OpenError::Damaged { path: database.into(), found })
}

/// What the engine finds first.
async fn damage(connection: &mut SqliteConnection) -> Result<Option<String>, sqlx::Error> {
    let found: String = sqlx::query_scalar("pragma integrity_check(1)").fetch_one(&mut *connection).await?;
    if found != "ok" {
        return Ok(Some(found));
    }
    let query = sqlx::query_scalar("select \"table\" from pragma_foreign_key_check limit 1");
    let orphan: Option<String> = query.fetch_optional(connection).await?;
    Ok(orphan.map(|table| format!("a row of {table} is of a session that is not there")))
}

/// The statements that made the tables, indices and triggers, by their names.
async fn made_by(connection: &mut SqliteConnection) -> Result<BTreeMap<String, String>, sqlx::Error> {
    let query =
        "select name, sql from sqlite_schema where sql is not null and name not like '\\_sqlx%' escape '\\'";
    let rows: Vec<(String, String)> = sqlx::query_as(query).fetch_all(connection).await?;
    Ok(rows.into_iter().collect())
}

/// Compares the tables with those of a new log; others may be there, too.
///
/// # Errors
/// One of them is missing or another.
pub(super) async fn tables(
    connection: &mut SqliteConnection,
    migrations: &Migrator,
    database: &Path,
) -> Result<(), OpenError> {
    let options = SqliteConnectOptions::new().in_memory(true);
    let new = SqlitePoolOptions::new().max_connections(1).connect_with(options).await?;
    migrations.run(&new).await?;
    let wanted = made_by(&mut *new.acquire().await?).await?;
    let found = made_by(connection).await?;
    match wanted.iter().find(|(name, sql)| found.get(*name) != Some(sql)) {
        None => Ok(()),
        Some((name, _)) => {
            let is_there = if found.contains_key(name) { "is another" } else { "is missing" };
            Err(OpenError::Schema { path: database.into(), what: format!("{name:?} {is_there}") })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_compared_as_numbers() {
        assert!(is_new_enough("3.51.3"));
        assert!(is_new_enough("3.100.0"));
        assert!(is_new_enough("4.0"));
        assert!(!is_new_enough("3.51.2"));
        assert!(!is_new_enough("3.9.99"));
        assert!(!is_new_enough("unknown"));
    }
}
