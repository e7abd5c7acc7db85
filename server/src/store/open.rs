//! Opening the log: the pragmas that durability rests on are set, read back and insisted on.
//!
//! ```text
//! lock --> tables brought up to date --> pages and tables as they should be? --> old events linked --> witness heard
//! ```

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use sqlx::error::DatabaseError;
use sqlx::migrate::{MigrateError, Migrator};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteError, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{ConnectOptions, SqliteConnection, SqlitePool};
use uuid::Uuid;

use super::engine::{Connection, sql};
use super::files::{self, OpenedFiles};
use super::postgres::Address;
use super::witness::{Testimony, Witness};
use super::{checks, linking};

pub(super) static MIGRATIONS: Migrator = sqlx::migrate!("../migrations/sqlite");

const READERS: u32 = 4;
/// Another process may hold the file for the time of one of its commits.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// Primary result codes of SQLite.
const SQLITE_PERM: i64 = 3;
const SQLITE_READONLY: i64 = 8;
pub(super) const SQLITE_CORRUPT: i64 = 11;
pub(super) const SQLITE_FULL: i64 = 13;
const SQLITE_CANTOPEN: i64 = 14;
const SQLITE_NOTADB: i64 = 26;

/// How often the file is tried, and the wait in between, before the failure is reported.
const ATTEMPTS: u32 = 5;
const RETRY_AFTER: Duration = Duration::from_millis(50);
/// How long another server may take to let the file go.
const WAIT_FOR_LOCK: Duration = Duration::from_secs(2);

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
    /// PostgreSQL cannot be reached.
    #[error("cannot reach the database {address}: {}", unreachable(source))]
    Connect {
        /// Where it is.
        address: Address,
        /// What went wrong.
        source: sqlx::Error,
    },
    /// The tables cannot be brought up to date.
    #[error("cannot bring the tables of the database up to date: {0}")]
    Migrate(#[from] MigrateError),
    /// A question to the engine failed.
    #[error("the database does not answer: {0}")]
    Query(#[from] sqlx::Error),
    /// Another server holds the log.
    #[error(
        "another server holds the database {path:?}: stop it first, or choose another file (one server serves a file)"
    )]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// The disk does not read the file.
    #[error(
        "the disk does not read the database {path:?} ({source}): look after the disk, then start again; nothing says that the database is damaged"
    )]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the disk says.
        source: std::io::Error,
    },
    /// Pages of the file are damaged.
    #[error(
        "the database {path:?} is damaged ({found}): restore a copy, or save what can be read with `sqlite3 OLD .recover`"
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What the engine found first.
        found: String,
    },
    /// The tables are not those of this version.
    #[error(
        "the database {path:?} has other tables than this version makes ({what}): restore a copy, or choose another file"
    )]
    Schema {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: String,
    },
    /// The engine is one that may lose data.
    #[error("SQLite {found} may corrupt its log of changes: {}.{}.{} or newer is needed", checks::OLDEST_SQLITE[0], checks::OLDEST_SQLITE[1], checks::OLDEST_SQLITE[2])]
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
        _ => match source {
            sqlx::Error::Io(error) => {
                format!("it or its folder {folder:?} cannot be written ({error}): check who may")
            }
            other => other.to_string(),
        },
    }
}

/// Whether a connection failed at its encryption.
fn is_about_tls(error: &std::io::Error) -> bool {
    let inner = error.get_ref().and_then(|inner| inner.downcast_ref::<rustls::Error>());
    inner.is_some()
}

/// Why PostgreSQL was not reached, in words that say what to do.
fn unreachable(source: &sqlx::Error) -> String {
    match source {
        sqlx::Error::Database(error) => match error.code().as_deref() {
            Some("28P01" | "28000") => format!("{error}: check the user and the password, or sslmode"),
            Some("3D000") => format!("{error}: make it first, with createdb or create database"),
            _ => error.to_string(),
        },
        sqlx::Error::Io(error) if is_about_tls(error) => {
            format!("{error}: check sslmode and sslrootcert in the address")
        }
        sqlx::Error::Io(error) => format!("{error}: does PostgreSQL run there, and listen on that port?"),
        sqlx::Error::Tls(error) => format!("{error}: check sslmode and sslrootcert in the address"),
        other => other.to_string(),
    }
}

/// SQLite's primary result code, which is the low byte of the code that it gives.
pub(super) fn primary_code(error: &sqlx::Error) -> Option<i64> {
    let error = error.as_database_error()?.try_downcast_ref::<SqliteError>()?;
    let code: i64 = error.code()?.parse().ok()?;
    Some(code & 0xff)
}

/// An open log.
#[derive(Debug)]
pub(super) struct Opened {
    pub(super) database: PathBuf,
    pub(super) connection: Connection,
    /// The files as they are now.
    pub(super) files: OpenedFiles,
    pub(super) witness: Arc<Witness>,
    /// Tells this log from another one in its place.
    pub(super) identity: String,
    /// Events that were ever appended.
    pub(super) appended: i64,
    /// Events that were acknowledged and are not there.
    pub(super) missing: i64,
}

/// Opens the log, or makes a new one.
///
/// # Errors
/// It cannot be opened, another server holds it, or it is damaged as a whole.
pub(super) async fn open(database: &Path) -> Result<Opened, OpenError> {
    let failed = |source| OpenError::Open { path: database.into(), source };
    if database.is_dir() {
        return Err(failed(sqlx::Error::Io(std::io::ErrorKind::IsADirectory.into())));
    }
    let witness = held(database).await.map_err(|error| failed(error.into()))?;
    let witness = Arc::new(witness.ok_or_else(|| OpenError::InUse { path: database.into() })?);
    let opened = open_held(database, &witness).await;
    opened.map_err(|error| {
        witness.remove_if_new();
        match files::read_through(database) {
            Err(source) => OpenError::Unreadable { path: database.into(), source },
            Ok(()) => error,
        }
    })
}

/// The same without the lock.
#[cfg(test)]
pub(super) async fn open_beside(database: &Path) -> Result<Opened, OpenError> {
    open_held(database, &Arc::new(Witness::beside(database))).await
}

/// The witness with its lock. A server that is about to end is waited for, but not one that goes on.
pub(super) async fn held(database: &Path) -> std::io::Result<Option<Witness>> {
    let end = tokio::time::Instant::now() + WAIT_FOR_LOCK;
    loop {
        let witness = Witness::open(database)?;
        if witness.is_some() || tokio::time::Instant::now() >= end {
            return Ok(witness);
        }
        tokio::time::sleep(RETRY_AFTER).await;
    }
}

async fn open_held(database: &Path, witness: &Arc<Witness>) -> Result<Opened, OpenError> {
    let failed = |source| OpenError::Open { path: database.into(), source };
    files::create_private(database).map_err(|error| failed(error.into()))?;
    let mut connection = writer(database).await?;
    checks::pages(&mut connection, database).await?;
    checks::tables(&mut connection, &MIGRATIONS, database).await?;
    let mut connection = Connection::Sqlite(connection);
    linking::link_all(&mut connection).await?;
    // Something is written, so that the log of changes is there.
    identify(&mut connection).await?;
    let (identity, appended, missing) = hear(&mut connection, witness).await?;
    let files = OpenedFiles::of(database).map_err(|error| failed(error.into()))?;
    let (database, witness) = (database.to_owned(), Arc::clone(witness));
    Ok(Opened { database, connection, files, witness, identity, appended, missing })
}

/// Gives a new log its identity; something is written in any case.
pub(super) async fn identify(connection: &mut Connection) -> Result<(), sqlx::Error> {
    let query = sql("insert into log (id, identity, appended, missing, checked_us)
         values (1, $1, (select count(*) from events), 0, 0)
         on conflict (id) do update set checked_us = log.checked_us + 1");
    query.bind(Uuid::now_v7().to_string()).execute(connection).await.map(drop)
}

/// The identity of the log, how many events it had ever, and how many of them are missing by what its witness says.
async fn hear(connection: &mut Connection, witness: &Witness) -> Result<(String, i64, i64), OpenError> {
    let query = sql("select identity, appended, missing from log");
    let said: Option<(String, i64, i64)> = query.optional(connection).await?;
    let (identity, mut appended, mut missing) = said.ok_or(sqlx::Error::RowNotFound)?;
    let failed =
        |error: std::io::Error| OpenError::Open { path: witness.path().into(), source: error.into() };
    match witness.read().map_err(failed)? {
        Some(said) if said.identity == identity && said.appended > appended => {
            let lost = said.appended - appended;
            tracing::error!(
                missing = lost,
                "events that were acknowledged are missing: the database or its log of changes was cut or put back"
            );
            (appended, missing) = (said.appended, missing + lost);
            sql("update log set appended = $1, missing = $2")
                .bind(appended)
                .bind(missing)
                .execute(connection)
                .await?;
        }
        Some(said) if said.identity != identity => {
            tracing::warn!(
                path = %witness.path().display(),
                "the witness is of another database, so what is missing here cannot be told"
            );
        }
        Some(_) | None => {}
    }
    let testimony = Testimony { identity, appended };
    witness.rewrite(&testimony).map_err(failed)?;
    Ok((testimony.identity, appended, missing))
}

/// The writer's connection again, after a failure, and how many events there were ever.
///
/// # Errors
/// It cannot be opened.
pub(super) async fn reopened(database: &Path) -> Result<(Connection, i64), sqlx::Error> {
    let options = options(database).synchronous(SqliteSynchronous::Full);
    let mut connection = options.connect().await?;
    let appended = sqlx::query_scalar("select appended from log").fetch_one(&mut connection).await?;
    Ok((Connection::Sqlite(connection), appended))
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
    checks::version(&mut connection).await?;
    checks::settings(&mut connection).await?;
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

/// One connection that cannot write and holds no page yet.
pub(super) async fn reader(database: &Path) -> Result<SqliteConnection, sqlx::Error> {
    options(database).read_only(true).connect().await
}

/// How connections are opened.
pub(super) fn options(database: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new().filename(database).foreign_keys(true).busy_timeout(BUSY_TIMEOUT)
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let error = open(path).await.unwrap_err().to_string();
            assert!(error.contains(path.to_str().unwrap()) && error.contains(reason), "{error}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing was left behind");
    }

    #[tokio::test]
    async fn a_log_that_another_server_holds_or_whose_tables_were_changed_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("palpate.db");
        let mut opened = open(&database).await.unwrap();
        assert!(matches!(open(&database).await, Err(OpenError::InUse { .. })));
        sql("drop trigger events_are_never_removed").execute(&mut opened.connection).await.unwrap();
        sql("create view mine as select 1").execute(&mut opened.connection).await.unwrap();
        drop(opened);
        let error = open(&database).await.unwrap_err().to_string();
        assert!(error.contains("\"events_are_never_removed\" is missing"), "{error}");
    }

    #[tokio::test]
    async fn events_that_were_acknowledged_and_are_gone_are_counted_at_the_next_start() {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("palpate.db");
        let opened = open(&database).await.unwrap();
        let (identity, appended) = (opened.identity.clone(), opened.appended + 7);
        opened.witness.write(&Testimony { identity, appended }).unwrap();
        drop(opened);
        assert_eq!(open(&database).await.unwrap().missing, 7);
        // It is said again at each start, and counted once.
        assert_eq!(open(&database).await.unwrap().missing, 7);
        std::fs::remove_file(files::beside(&database, "-witness")).unwrap();
        assert_eq!(open(&database).await.unwrap().missing, 7);
    }
}
