//! What can be said of a database without changing it, whether a server holds it or not.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Connection, SqliteConnection};

use super::backup::{Hear, Progress};
use super::engine::{Connection as Engine, sql};
use super::open::{self, MIGRATIONS};
use super::proof::{Proof, prove_all};
use super::witness::{self, Testimony};
use super::{checks, files};

/// The endings of the files that belong to a database, its own among them.
pub(super) const DATABASE_FILES: [&str; 5] = ["", "-wal", "-shm", witness::ENDING, "-checkpoints"];

/// What was found out about a database.
#[derive(Clone, Debug, Default)]
pub struct Inspection {
    /// SQLite's version in this program, and why it is not fit, if it is not.
    pub sqlite: String,
    /// Whether a server holds the database.
    pub is_held: bool,
    /// The files that are there, with their sizes in bytes.
    pub files: Vec<(PathBuf, u64)>,
    /// Room that is left on the disk, as far as the system tells.
    pub free_bytes: Option<u64>,
    /// Why the database cannot be opened or read; nothing after it is known then.
    pub unreadable: Option<String>,
    /// Changes of the tables that this version makes and the database has not seen.
    pub pending_migrations: Vec<String>,
    /// Changes of the tables that this version does not know.
    pub unknown_migrations: Vec<i64>,
    /// What is wrong with its pages, indices or tables.
    pub damage: Option<String>,
    /// What its sessions turned out to be.
    pub proof: Option<Proof>,
    /// Events that a start found missing, by the database.
    pub missing: i64,
    /// What the witness says.
    pub witness: Witnessed,
    /// Why the file of checkpoints cannot be read, where it is there.
    pub checkpoints: Option<Result<(), String>>,
}

/// What the witness says of a database.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Witnessed {
    /// There is no witness, or it says nothing.
    #[default]
    Nothing,
    /// It is of another database.
    Another,
    /// It knows of this many events more than the database has; 0 where they agree.
    Missing(i64),
}

/// Looks at a database that is there. The longest part is heard of by `hear`.
pub async fn inspect(database: &Path, hear: Hear<'_>) -> Inspection {
    let mut found = Inspection { free_bytes: files::free_bytes(database), ..Inspection::default() };
    for ending in DATABASE_FILES {
        let path = files::beside(database, ending);
        found.files.extend(std::fs::metadata(&path).ok().map(|metadata| (path, metadata.len())));
    }
    let witness_path = files::beside(database, witness::ENDING);
    found.is_held = is_locked(&witness_path);
    // Before the database, which then has at least as many events unless some are missing.
    let witness = std::fs::read(&witness_path).ok().and_then(|bytes| witness::testimony(&bytes));
    if let Err(error) = look_into(database, &mut found, witness, hear).await {
        found.unreadable = Some(error.to_string());
    }
    let checkpoints = files::beside(database, "-checkpoints");
    if checkpoints.exists() {
        found.checkpoints =
            Some(look_at_checkpoints(&checkpoints, found.is_held).await.map_err(|error| error.to_string()));
    }
    found
}

/// Whether a process holds the lock of this file, which is left as it is.
fn is_locked(path: &Path) -> bool {
    // A lock that is got is given back with the file.
    File::open(path).is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
}

async fn look_into(
    database: &Path,
    found: &mut Inspection,
    witness: Option<Testimony>,
    hear: Hear<'_>,
) -> Result<(), sqlx::Error> {
    let mut connection = read_only(database, found.is_held).await?;
    found.sqlite = sqlx::query_scalar("select sqlite_version()").fetch_one(&mut connection).await?;
    let applied: Vec<i64> = sqlx::query_scalar("select version from _sqlx_migrations order by version")
        .fetch_all(&mut connection)
        .await?;
    for migration in MIGRATIONS.iter().filter(|migration| !applied.contains(&migration.version)) {
        found.pending_migrations.push(migration.description.to_string());
    }
    found.unknown_migrations =
        applied.into_iter().filter(|version| !MIGRATIONS.version_exists(*version)).collect();
    if !found.pending_migrations.is_empty() || !found.unknown_migrations.is_empty() {
        return connection.close().await;
    }
    let checked = match checks::pages(&mut connection, database).await {
        Ok(()) => checks::tables(&mut connection, &MIGRATIONS, database).await,
        damaged => damaged,
    };
    found.damage = checked.err().map(|error| error.to_string());
    let mut connection = Engine::Sqlite(connection);
    let log: Option<(String, i64, i64)> =
        sql("select identity, appended, missing from log").optional(&mut connection).await?;
    if let Some((identity, appended, missing)) = log {
        found.missing = missing;
        found.witness = match witness {
            None => Witnessed::Nothing,
            Some(said) if said.identity != identity => Witnessed::Another,
            Some(said) => Witnessed::Missing((said.appended - appended).max(0)),
        };
    }
    let events = sql("select count(*) from events").scalar::<i64>(&mut connection).await?;
    let events = u64::try_from(events.unwrap_or(0)).unwrap_or(0);
    found.proof = Some(prove_all(&mut connection, &|read| hear(Progress::Proved(read, events))).await?);
    connection.close().await
}

/// A connection that writes nothing. Where nobody holds the database and nothing waits beside it, not even the files
/// are made that readers share.
async fn read_only(database: &Path, is_held: bool) -> Result<SqliteConnection, sqlx::Error> {
    let has_changes = std::fs::metadata(files::beside(database, "-wal")).is_ok_and(|wal| wal.len() > 0);
    if is_held || has_changes {
        return open::reader(database).await;
    }
    SqliteConnectOptions::new().filename(database).read_only(true).immutable(true).connect().await
}

async fn look_at_checkpoints(path: &Path, is_held: bool) -> Result<(), sqlx::Error> {
    let mut connection = read_only(path, is_held).await?;
    let _: i64 = sqlx::query_scalar("select count(*) from sqlite_schema").fetch_one(&mut connection).await?;
    connection.close().await
}
