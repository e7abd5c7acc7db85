//! The event log on disk, in SQLite: one writer that commits in groups, and a pool of readers.
//!
//! ```text
//! append, create, delete --> bounded queue --> writer: begin, each in a savepoint, commit --> acknowledged
//! session, events, list  --> read-only pool --> each event checked by its link
//! ```
//!
//! Nothing is acknowledged before its commit has returned, and a commit returns when it is on disk
//! (WAL, synchronous = full). What payloads and replies mean is not known here: they are bytes.

mod apply;
mod backup;
mod change;
mod checkpoints;
mod checks;
mod event;
mod files;
mod inspection;
mod link;
mod linking;
mod open;
mod proof;
mod read;
mod readable;
mod references;
mod restore;
mod tokens;
mod witness;
mod write;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sqlx::SqlitePool;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;
use tracing::Instrument;

use crate::limits::Limits;
use crate::metrics::Metrics;

pub use backup::{BackupError, Copied, Progress, back_up};
use change::Change;
pub(crate) use change::{Damage, Deletion, Import, NewSession, SessionHead};
pub(crate) use checkpoints::{Checkpoint, Checkpoints, Kept};
pub(crate) use event::Event;
pub use inspection::{Inspection, Witnessed, inspect};
pub(crate) use link::{Link, first as first_link};
pub use open::OpenError;
use open::Opened;
pub use proof::Proof;
pub(crate) use read::{ExperimentPart, Filter, FirstRequest, PageEnd, SessionRow, StateFilter};
use readable::Readable;
pub(crate) use references::{KeptReference, NewErrors, NewReference, ReferenceKey, SurfaceError};
pub use restore::{Older, Restored, restore};
pub(crate) use tokens::{TokenFile, TokenReader, TokenRow};
use write::{Job, Writer};

/// Why an operation on the log failed.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum StoreError {
    /// The session, its revision or a request id is not what the caller believes: read again.
    #[error("the log has moved on")]
    Conflict,
    /// More writes wait than may.
    #[error("too many writes are waiting")]
    QueueFull,
    /// There is no room on the disk.
    #[error("the disk is full")]
    Full,
    /// All sessions together hold as much as they may.
    #[error("the database holds its {most_bytes} bytes")]
    TooLarge {
        /// How much they may hold.
        most_bytes: u64,
    },
    /// A token has as much as it may.
    #[error("the token has its {most} {what}")]
    Share {
        /// What it has so many of, in the plural.
        what: &'static str,
        /// How many it may have.
        most: u64,
    },
    /// The log of a session is not the one that was written.
    #[error("the log is damaged after event {}: {}", .0.sound, .0.reason)]
    Damaged(Damage),
    /// The database failed.
    #[error("{0}")]
    Down(String),
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        let is_conflict = error
            .as_database_error()
            .is_some_and(|error| error.is_unique_violation() || error.is_foreign_key_violation());
        match open::primary_code(&error) {
            _ if is_conflict => Self::Conflict,
            Some(open::SQLITE_FULL) => Self::Full,
            _ => Self::Down(error.to_string()),
        }
    }
}

/// The event log.
#[derive(Debug)]
pub(crate) struct Store {
    readers: SqlitePool,
    jobs: mpsc::Sender<Job>,
    /// Asks the writer to finish what is queued and to close the file.
    closing: CancellationToken,
    /// Cancelled when the writer has done so.
    closed: CancellationToken,
    /// Events that were acknowledged and are not there.
    missing: i64,
    /// What the disk does not read.
    readable: Arc<Readable>,
    database: PathBuf,
    /// What the whole server counts; it begins with the log.
    pub(crate) metrics: Metrics,
    /// What folds go on from.
    pub(crate) checkpoints: Checkpoints,
}

impl Store {
    /// Opens or creates the log, brings its tables up to date and starts the writer.
    ///
    /// # Errors
    /// The file cannot be opened, or the engine does not give the guarantees that are promised.
    pub(crate) async fn open(
        database: &Path,
        version: &'static str,
        limits: &Limits,
    ) -> Result<Self, OpenError> {
        let opened = open::open(database).await?;
        let readers = open::readers(database).await?;
        Ok(Self::over(opened, readers, version, limits))
    }

    /// Opens a log that another process may hold, as two servers of one file would.
    #[cfg(test)]
    pub(crate) async fn open_beside(database: &Path, limits: &Limits) -> Result<Self, OpenError> {
        let opened = open::open_beside(database).await?;
        let readers = open::readers(database).await?;
        Ok(Self::over(opened, readers, "", limits))
    }

    fn over(opened: Opened, readers: SqlitePool, version: &'static str, limits: &Limits) -> Self {
        let (jobs, queue) = mpsc::channel(limits.write_queue);
        let (closing, closed) = (CancellationToken::new(), CancellationToken::new());
        let missing = opened.missing;
        let readable = Arc::new(Readable::of(&opened.database));
        let checkpoints = Checkpoints::beside(&opened.database, version, limits.checkpoint_bytes);
        let (database, metrics) = (opened.database.clone(), Metrics::default());
        let writer = Writer::new(opened, limits.database_bytes, metrics.clone());
        let writer = writer.run(queue, limits.write_batch, closing.clone());
        let announce = closed.clone().drop_guard();
        tokio::spawn(async move {
            writer.await;
            drop(announce);
        });
        Self { readers, jobs, closing, closed, missing, readable, database, metrics, checkpoints }
    }

    /// Writes a session with its first events, all or none.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] when the id is taken, or the request id made another session.
    pub(crate) async fn create(&self, session: NewSession, events: Vec<Event>) -> Result<(), StoreError> {
        self.write(Change::Create(Box::new((session, events)))).await
    }

    /// Appends an event after the one with the link `before`, and brings the session's head up to date.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] when the session is gone, set aside, or not at the revision before this event.
    pub(crate) async fn append(
        &self,
        head: SessionHead,
        before: Link,
        event: Event,
    ) -> Result<(), StoreError> {
        self.write(Change::Append(Box::new((head, before, event)))).await
    }

    /// Sets a session aside: lists say so, and nothing is appended any more. It need not be waited for, since damage
    /// that is not noted is found again.
    pub(crate) fn set_aside(&self, damage: Damage) {
        let Damage { session_id, sound, reason } = &damage;
        tracing::error!(session_id, sound, reason, "the log of a session is damaged: it is quarantined");
        let _ = self.enqueue(Change::SetAside(damage));
    }

    /// Takes a session back that was set aside, since its log is sound after all.
    pub(crate) fn restore(&self, session_id: &str) {
        tracing::info!(session_id, "the log of a session is sound again");
        let _ = self.enqueue(Change::Restore(session_id.to_owned()));
    }

    /// How many events were acknowledged and found missing at a start.
    pub(crate) fn missing(&self) -> i64 {
        self.missing
    }

    /// Removes a session with all its events.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] when the session is gone or not at the given revision.
    pub(crate) async fn delete(&self, deletion: Deletion) -> Result<(), StoreError> {
        self.write(Change::Delete(deletion)).await
    }

    /// Finds out whether the log can be written: by a write that is synced, unless one was within the last second.
    pub(crate) async fn check_writable(&self) -> Result<(), StoreError> {
        self.write(Change::Check).await
    }

    /// Ends once every write that was accepted before is on disk and the file is closed.
    ///
    /// All is then in the one file of the database, without a log of changes beside it.
    pub(crate) async fn close(&self) {
        self.readers.close().await;
        self.checkpoints.close().await;
        self.closing.cancel();
        self.closed.cancelled().await;
    }

    /// How many writes wait.
    pub(crate) fn waiting_writes(&self) -> usize {
        self.jobs.max_capacity() - self.jobs.capacity()
    }

    /// The sizes of the database, of its log of changes and of the checkpoints, and the room that their disk has left,
    /// each as far as the system tells.
    pub(crate) fn sizes(&self) -> [Option<u64>; 4] {
        let size = |ending: &str| Some(std::fs::metadata(files::beside(&self.database, ending)).ok()?.len());
        [size(""), size("-wal"), size("-checkpoints"), files::free_bytes(&self.database)]
    }

    /// The engine.
    ///
    /// # Errors
    /// The database cannot be read.
    pub(crate) async fn engine_version(&self) -> Result<String, StoreError> {
        Ok(sqlx::query_scalar("select sqlite_version()").fetch_one(&self.readers).await?)
    }

    async fn write(&self, change: Change) -> Result<(), StoreError> {
        let committed = self.enqueue(change)?.instrument(tracing::debug_span!("commit"));
        committed.await.map_err(|_| StoreError::Down("the writer has stopped".into()))?
    }

    fn enqueue(&self, change: Change) -> Result<oneshot::Receiver<Result<(), StoreError>>, StoreError> {
        let (done, outcome) = oneshot::channel();
        self.jobs.try_send(Job { change, done }).map_err(|refused| match refused {
            mpsc::error::TrySendError::Full(_) => StoreError::QueueFull,
            mpsc::error::TrySendError::Closed(_) => StoreError::Down("the writer has stopped".into()),
        })?;
        Ok(outcome)
    }
}

#[cfg(test)]
mod tests;
