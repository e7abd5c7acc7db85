//! Opening the log: the pragmas that durability rests on are set, read back and insisted on.

use std::path::{Path, PathBuf};
use std::time::Duration;

use sqlx::migrate::{MigrateError, Migrator};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{SqliteConnection, SqlitePool};

static MIGRATIONS: Migrator = sqlx::migrate!("../migrations");

/// Before this release a WAL file could be corrupted by a checkpoint.
const OLDEST_SQLITE: [u32; 3] = [3, 51, 3];
const READERS: u32 = 4;
/// Another process may hold the file for the time of one of its commits.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// Primary result codes of SQLite.
const SQLITE_PERM: i64 = 3;
const SQLITE_READONLY: i64 = 8;
pub(super) const SQLITE_FULL: i64 = 13;
const SQLITE_CANTOPEN: i64 = 14;
const SQLITE_NOTADB: i64 = 26;

/// How often the file is tried, and the wait in between, before the failure is reported.
const ATTEMPTS: u32 = 5;
const RETRY_AFTER: Duration = Duration::from_millis(50);

/// Why the log cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The file cannot be opened or created.
    #[error("cannot open the database {path:?}: {}", reason(path, source))]
    Open {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        source: sqlx::Error,
    },
    /// The tables cannot be brought up to date.
    #[error("cannot bring the tables of the database up to date: {0}")]
    Migrate(#[from] MigrateError),
    /// A question to the engine failed.
    #[error("the database does not answer: {0}")]
    Query(#[from] sqlx::Error),
    /// The engine is one that may lose data.
    #[error("SQLite {found} may corrupt its log of changes: {}.{}.{} or newer is needed", OLDEST_SQLITE[0], OLDEST_SQLITE[1], OLDEST_SQLITE[2])]
    OldSqlite {
        /// The engine's version.
        found: String,
    },
    /// A setting did not take.
    #[error("{setting} is {found:?} but must be {needed:?}: is the file on a disk that SQLite supports?")]
    Setting {
        /// Which pragma.
        setting: &'static str,
        /// What the engine says.
        found: String,
        /// What is needed.
        needed: &'static str,
    },
}

/// What is the matter with a file that SQLite did not open, in words: its own are the same for most causes.
fn reason(path: &Path, source: &sqlx::Error) -> String {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if path.is_dir() {
        return "it is a folder: name a file in it".to_owned();
    }
    if !folder.is_dir() {
        return format!("there is no folder {folder:?}: make it, or choose another place");
    }
    match primary_code(source) {
        Some(SQLITE_READONLY | SQLITE_CANTOPEN | SQLITE_PERM) => {
            format!(
                "it or its folder {folder:?} cannot be written: check who may, and that the disk takes writes"
            )
        }
        Some(SQLITE_NOTADB) => "it is not an SQLite database: choose another file".to_owned(),
        Some(SQLITE_FULL) => "the disk is full: make room, and start again".to_owned(),
        _ => source.to_string(),
    }
}

/// SQLite's primary result code, which is the low byte of the code that it gives.
pub(super) fn primary_code(error: &sqlx::Error) -> Option<i64> {
    let code: i64 = error.as_database_error()?.code()?.parse().ok()?;
    Some(code & 0xff)
}

/// The one connection that writes, with migrations run and guarantees checked.
///
/// Nothing keeps two programs from making the tables of a new file at once: the one that comes second fails on what
/// the first is doing, and finds it done when it tries again.
pub(super) async fn writer(database: &Path) -> Result<SqliteConnection, OpenError> {
    for _ in 1..ATTEMPTS {
        if let Ok(connection) = try_writer(database).await {
            return Ok(connection);
        }
        tokio::time::sleep(RETRY_AFTER).await;
    }
    try_writer(database).await
}

async fn try_writer(database: &Path) -> Result<SqliteConnection, OpenError> {
    let options = options(database)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full);
    // Migrations run on a pool; its one connection is then the writer's.
    let opened = SqlitePoolOptions::new().max_connections(1).connect_with(options).await;
    let pool = opened.map_err(|source| OpenError::Open { path: database.into(), source })?;
    let mut connection = pool.acquire().await?;
    check_version(&mut connection).await?;
    check_settings(&mut connection).await?;
    drop(connection);
    MIGRATIONS.run(&pool).await.map_err(|error| match error {
        // Whether a file may be written shows at the first write.
        MigrateError::Execute(source) => OpenError::Open { path: database.into(), source },
        other => OpenError::Migrate(other),
    })?;
    Ok(pool.acquire().await?.detach())
}

/// Connections that cannot write.
pub(super) async fn readers(database: &Path) -> Result<SqlitePool, OpenError> {
    let options = options(database).read_only(true);
    let opened = SqlitePoolOptions::new().max_connections(READERS).connect_with(options).await;
    opened.map_err(|source| OpenError::Open { path: database.into(), source })
}

fn options(database: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new().filename(database).foreign_keys(true).busy_timeout(BUSY_TIMEOUT)
}

async fn check_version(connection: &mut SqliteConnection) -> Result<(), OpenError> {
    let found: String = sqlx::query_scalar("select sqlite_version()").fetch_one(connection).await?;
    if is_new_enough(&found) { Ok(()) } else { Err(OpenError::OldSqlite { found }) }
}

fn is_new_enough(version: &str) -> bool {
    let parts: Vec<u32> = version.split('.').map_while(|part| part.parse().ok()).collect();
    parts.as_slice() >= OLDEST_SQLITE.as_slice()
}

async fn check_settings(connection: &mut SqliteConnection) -> Result<(), OpenError> {
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

    #[tokio::test]
    async fn several_programs_may_make_the_tables_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("palpate.db");
        let (a, b, c) = tokio::join!(writer(&database), writer(&database), writer(&database));
        for opened in [a, b, c] {
            opened.unwrap();
        }
    }

    #[tokio::test]
    async fn a_file_that_cannot_be_used_is_named_and_the_reason_is_in_words() {
        let folder = tempfile::tempdir().unwrap();
        let text = folder.path().join("notes.txt");
        std::fs::write(&text, "not a database, but long enough to have a header of its own: ".repeat(20))
            .unwrap();
        for (path, reason) in [
            (Path::new("/nowhere/at/all/palpate.db"), "there is no folder \"/nowhere/at/all\""),
            (folder.path(), "it is a folder"),
            (&text, "it is not an SQLite database"),
            // Not even root may write there.
            (Path::new("/proc/palpate.db"), "cannot be written"),
        ] {
            let error = writer(path).await.unwrap_err().to_string();
            assert!(error.contains(path.to_str().unwrap()) && error.contains(reason), "{error}");
        }
    }
}
