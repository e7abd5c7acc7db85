//! The event log on disk, in SQLite: one writer that commits in groups, and a pool of readers.
//!
//! ```text
//! append, create, delete --> bounded queue --> writer: begin, each in a savepoint, commit --> acknowledged
//! session, events, list  --> read-only pool
//! ```
//!
//! Nothing is acknowledged before its commit has returned, and a commit returns when it is on disk
//! (WAL, synchronous = full). What payloads and replies mean is not known here: they are bytes.

mod open;
mod read;
mod write;

use std::path::Path;

use sqlx::{SqliteConnection, SqlitePool};
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

use crate::limits::Limits;

pub use open::OpenError;
pub(crate) use read::{EventRow, Filter, PageEnd, SessionRow};
use write::{Change, Job};
pub(crate) use write::{Deletion, NewEvent, NewSession, SessionHead};

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
}

impl Store {
    /// Opens or creates the log, brings its tables up to date and starts the writer.
    ///
    /// # Errors
    /// The file cannot be opened, or the engine does not give the guarantees that are promised.
    pub(crate) async fn open(database: &Path, limits: &Limits) -> Result<Self, OpenError> {
        let connection = open::writer(database).await?;
        let readers = open::readers(database).await?;
        Ok(Self::over(connection, readers, limits))
    }

    fn over(connection: SqliteConnection, readers: SqlitePool, limits: &Limits) -> Self {
        let (jobs, queue) = mpsc::channel(limits.write_queue);
        let (closing, closed) = (CancellationToken::new(), CancellationToken::new());
        let writer = write::run(connection, queue, limits.write_batch, closing.clone());
        let announce = closed.clone().drop_guard();
        tokio::spawn(async move {
            writer.await;
            drop(announce);
        });
        Self { readers, jobs, closing, closed }
    }

    /// Writes a session with its first event.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] when the id is taken, or the request id made another session.
    pub(crate) async fn create(&self, session: NewSession, event: NewEvent) -> Result<(), StoreError> {
        self.write(Change::Create(Box::new((session, event)))).await
    }

    /// Appends an event to the session and brings its head up to date.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] when the session is gone or not at the revision before this event.
    pub(crate) async fn append(&self, head: SessionHead, event: NewEvent) -> Result<(), StoreError> {
        self.write(Change::Append(Box::new((head, event)))).await
    }

    /// Removes a session with all its events.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] when the session is gone or not at the given revision.
    pub(crate) async fn delete(&self, deletion: Deletion) -> Result<(), StoreError> {
        self.write(Change::Delete(deletion)).await
    }

    /// Finds out whether the log can be written: by a small write after one that found no room, otherwise by an
    /// empty commit, which costs nothing.
    pub(crate) async fn check_writable(&self) -> Result<(), StoreError> {
        self.write(Change::Nothing).await
    }

    /// Ends once every write that was accepted before is on disk and the file is closed.
    ///
    /// All is then in the one file of the database, without a log of changes beside it.
    pub(crate) async fn close(&self) {
        self.readers.close().await;
        self.closing.cancel();
        self.closed.cancelled().await;
    }

    async fn write(&self, change: Change) -> Result<(), StoreError> {
        let (done, outcome) = oneshot::channel();
        self.jobs.try_send(Job { change, done }).map_err(|refused| match refused {
            mpsc::error::TrySendError::Full(_) => StoreError::QueueFull,
            mpsc::error::TrySendError::Closed(_) => StoreError::Down("the writer has stopped".into()),
        })?;
        outcome.await.map_err(|_| StoreError::Down("the writer has stopped".into()))?
    }
}

#[cfg(test)]
mod tests;
