//! A copy of the log, taken while a server appends to it.
//!
//! `vacuum into` reads one snapshot, as any reader does, and writes it as a new database without free pages. SQLite's
//! backup interface would need an engine of its own beside sqlx, begins anew whenever another process commits, and so
//! might never end beside busy robots unless it copies all in one step, which is no better than this.
//!
//! ```text
//! snapshot --> FILE.partial --> synced --> pages, tables and every link checked --> FILE
//! ```

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, SqliteConnection};

use super::engine::{Connection as Engine, sql};
use super::open::{self, MIGRATIONS, OpenError};
use super::proof::{Proof, prove_all};
use super::{apply, checks, files};

/// How often the size of a growing copy is looked at.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// Why there is no copy.
#[derive(Debug, thiserror::Error)]
pub enum BackupError {
    /// There is nothing to copy.
    #[error("there is no database {path:?}")]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// What is there is kept.
    #[error("{path:?} exists already: name another file, or move it away first")]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A file cannot be read or written.
    #[error("{path:?}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The database, or its copy, cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The engine failed.
    #[error("the database does not answer: {0}")]
    Query(#[from] sqlx::Error),
    /// The file is of a program that this one does not know.
    #[error("{path:?} was written by a newer version of palpate: use that one")]
    Newer {
        /// The file.
        path: PathBuf,
    },
    /// A part of what it holds is in a file beside it.
    #[error(
        "{path:?} has changes in a file beside it: copy it with `palpate backup --database` first, and restore that"
    )]
    Unfinished {
        /// The file.
        path: PathBuf,
    },
    /// A copy that does not prove itself is not put in place.
    #[error("{path:?} is damaged: the log of session {session_id:?} does not prove itself ({reason})")]
    Broken {
        /// The file.
        path: PathBuf,
        /// The first of the sessions.
        session_id: String,
        /// What is wrong with it.
        reason: String,
    },
}

impl BackupError {
    pub(super) fn file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        |source| Self::File { path: path.into(), source }
    }
}

/// How far a copy is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Bytes that are written, of about so many.
    Copied(u64, u64),
    /// Events whose links were followed, of so many.
    Proved(u64, u64),
}

/// Hears how far a copy is.
pub(super) type Hear<'a> = &'a (dyn Fn(Progress) + Send + Sync);

/// A copy and what is in it.
#[derive(Clone, Debug)]
pub struct Copied {
    /// What its sessions turned out to be.
    pub proof: Proof,
    /// Its size.
    pub bytes: u64,
}

/// Copies the log into a new file and checks all of the copy. Whether a server runs makes no difference.
///
/// Sessions whose log does not prove itself are in the copy as they are in the log, and named in the proof.
///
/// # Errors
/// `to` exists, one of the files cannot be used, or pages of the log are damaged.
pub async fn back_up(database: &Path, to: &Path, hear: Hear<'_>) -> Result<Copied, BackupError> {
    if !database.is_file() {
        return Err(BackupError::Missing { path: database.into() });
    }
    if to.exists() {
        return Err(BackupError::Exists { path: to.into() });
    }
    let partial = Partial::beside(to)?;
    let failed = |source| OpenError::Open { path: database.into(), source };
    let mut connection = open::reader(database).await.map_err(failed)?;
    checks::version(&mut connection).await?;
    let mut connection = Engine::Sqlite(connection);
    let expected = apply::bytes_used(&mut connection).await?;
    {
        let copying = copy(&mut connection, &partial.path);
        tokio::pin!(copying);
        loop {
            tokio::select! {
                copied = &mut copying => break copied?,
                () = tokio::time::sleep(LOOK_AGAIN) => hear(Progress::Copied(partial.bytes(), expected)),
            }
        }
    }
    connection.close().await?;
    // SQLite leaves it to the system when the copy reaches the disk.
    File::open(&partial.path).and_then(|file| file.sync_all()).map_err(BackupError::file(&partial.path))?;
    let proof = check(&partial.path, hear).await?;
    let bytes = partial.bytes();
    if to.exists() {
        return Err(BackupError::Exists { path: to.into() });
    }
    partial.put_at(to)?;
    Ok(Copied { proof, bytes })
}

async fn copy(connection: &mut Engine, to: &Path) -> Result<(), BackupError> {
    // The path is bound as text, as the engine's interface wants it.
    let Some(name) = to.to_str() else {
        let source = io::Error::new(io::ErrorKind::InvalidFilename, "the name is no UTF-8");
        return Err(BackupError::File { path: to.into(), source });
    };
    sql("vacuum into $1").bind(name).execute(connection).await?;
    Ok(())
}

/// Checks the pages, tables and links of a copy that nobody writes.
///
/// # Errors
/// It is damaged as a whole, or of another version.
async fn check(path: &Path, hear: Hear<'_>) -> Result<Proof, BackupError> {
    // Immutable: no lock is taken, and no files are made beside it.
    let options = SqliteConnectOptions::new().filename(path).read_only(true).immutable(true);
    let failed = |source| OpenError::Open { path: path.into(), source };
    let connection = options.connect().await.map_err(failed)?;
    let (proof, connection) = check_open(connection, path, hear).await?;
    connection.close().await?;
    Ok(proof)
}

/// The same of a copy that is open, which stays so.
pub(super) async fn check_open(
    mut connection: SqliteConnection,
    path: &Path,
    hear: Hear<'_>,
) -> Result<(Proof, Engine), BackupError> {
    checks::pages(&mut connection, path).await?;
    checks::tables(&mut connection, &MIGRATIONS, path).await?;
    let mut connection = Engine::Sqlite(connection);
    let events = sql("select count(*) from events").scalar::<i64>(&mut connection).await?;
    let events = u64::try_from(events.unwrap_or(0)).unwrap_or(0);
    let proof = prove_all(&mut connection, &|read| hear(Progress::Proved(read, events))).await?;
    Ok((proof, connection))
}

/// A file that is not finished; removed when it is dropped, with what SQLite may have put beside it.
#[derive(Debug)]
pub(super) struct Partial {
    pub(super) path: PathBuf,
}

impl Partial {
    /// An empty file for its owner only, beside the one that it is to become.
    ///
    /// # Errors
    /// It cannot be made.
    pub(super) fn beside(path: &Path) -> Result<Self, BackupError> {
        let partial = Self { path: files::beside(path, ".partial") };
        // One of an attempt that was killed says nothing.
        partial.remove();
        files::create_private(&partial.path).map_err(BackupError::file(&partial.path))?;
        Ok(partial)
    }

    pub(super) fn bytes(&self) -> u64 {
        fs::metadata(&self.path).map_or(0, |metadata| metadata.len())
    }

    /// Gives it its name, which is on disk then.
    ///
    /// # Errors
    /// The system does not.
    pub(super) fn put_at(self, path: &Path) -> Result<(), BackupError> {
        fs::rename(&self.path, path).map_err(BackupError::file(path))?;
        sync_folder(path).map_err(BackupError::file(path))
    }

    fn remove(&self) {
        for ending in ["", "-wal", "-shm", "-journal"] {
            // What is not there need not be removed.
            let _ = fs::remove_file(files::beside(&self.path, ending));
        }
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        self.remove();
    }
}

/// Makes the names in a file's folder last.
pub(super) fn sync_folder(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}
