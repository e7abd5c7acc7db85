//! The event log on disk, in SQLite or on PostgreSQL, and a pool of readers.
//!
//! ```text
//! append, create, delete --> SQLite:     bounded queue --> writer: begin, each in a savepoint, commit --> acknowledged
//!                        `-> PostgreSQL: bounded number --> each: begin, change, commit               --> acknowledged
//! session, events, list  --> read-only pool --> each event checked by its link
//! ```
//!
//! Nothing is acknowledged before its commit has returned, and a commit returns when it is on disk
//! (WAL, synchronous = full; synchronous_commit = on). What payloads and replies mean is not known here: they are bytes.

mod apply;
mod backup;
mod change;
mod checkpoints;
mod checks;
mod engine;
mod event;
mod files;
mod inspection;
mod link;
mod linking;
mod location;
mod migrate;
mod open;
mod postgres;
mod proof;
mod read;
mod readable;
mod references;
mod restore;
mod sqlite;
mod tickets;
mod tokens;
mod witness;
mod write;

#[cfg(test)]
use std::path::Path;

use sqlx::SqlitePool;
use tracing::Instrument;

use crate::limits::Limits;
use crate::metrics::Metrics;

pub use backup::{BackupError, Copied, Progress, back_up};
use change::Change;
pub(crate) use change::{Damage, Deletion, Import, NewSession, SessionHead};
pub(crate) use checkpoints::{Checkpoint, Checkpoints, Kept};
use engine::{Pool, sql};
pub(crate) use event::Event;
pub use inspection::{Inspection, Witnessed, inspect};
pub(crate) use link::{Link, first as first_link};
pub use location::Location;
pub use migrate::{MigrateError, Migrated, migrate};
pub use open::OpenError;
use open::Opened;
use postgres::PostgresLog;
pub use postgres::{Address, AddressError, SharedInspection, inspect_shared};
pub use proof::Proof;
pub(crate) use read::{ExperimentPart, Filter, FirstRequest, PageEnd, SessionEnd, SessionRow, StateFilter};
use readable::Unread;
pub(crate) use references::{KeptReference, NewErrors, NewReference, ReferenceKey, SurfaceError};
pub use restore::{Older, Restored, restore};
use sqlite::{Outcome, SqliteLog};
pub(crate) use tickets::{TicketRow, TicketTable};
pub(crate) use tokens::{TokenFile, TokenReader, TokenRow};

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
            _ if postgres::is_full(&error) => Self::Full,
            _ => Self::Down(error.to_string()),
        }
    }
}

/// The event log.
#[derive(Debug)]
pub(crate) struct Store {
    log: Log,
    readers: Pool,
    /// What the whole server counts; it begins with the log.
    pub(crate) metrics: Metrics,
    /// What folds go on from.
    pub(crate) checkpoints: Checkpoints,
}

/// Where changes go.
#[derive(Debug)]
enum Log {
    Sqlite(SqliteLog),
    Postgres(PostgresLog),
}

impl Store {
    /// Opens or creates the log, brings its tables up to date and begins to take changes.
    ///
    /// # Errors
    /// It cannot be opened, or the engine does not give the guarantees that are promised.
    pub(crate) async fn open(
        database: &Location,
        version: &'static str,
        limits: &Limits,
    ) -> Result<Self, OpenError> {
        match database {
            Location::File(path) => {
                let opened = open::open(path).await?;
                let readers = open::readers(path).await?;
                Ok(Self::over(opened, readers, version, limits))
            }
            Location::Postgres(address) => {
                let postgres::Opened { readers, writers, keepers } = postgres::open(address, limits).await?;
                let metrics = Metrics::default();
                let log = PostgresLog::start(writers, readers.clone(), limits, metrics.clone());
                let checkpoints = Checkpoints::on(keepers, version, limits.checkpoint_bytes);
                Ok(Self { log: Log::Postgres(log), readers, metrics, checkpoints })
            }
        }
    }

    /// Opens a log that another process may hold, as two servers of one file would.
    #[cfg(test)]
    pub(crate) async fn open_beside(database: &Path, limits: &Limits) -> Result<Self, OpenError> {
        let opened = open::open_beside(database).await?;
        let readers = open::readers(database).await?;
        Ok(Self::over(opened, readers, "", limits))
    }

    fn over(opened: Opened, readers: SqlitePool, version: &'static str, limits: &Limits) -> Self {
        let metrics = Metrics::default();
        let checkpoints = Checkpoints::beside(&opened.database, version, limits.checkpoint_bytes);
        let log = Log::Sqlite(SqliteLog::start(opened, limits, metrics.clone()));
        Self { log, readers: Pool::Sqlite(readers), metrics, checkpoints }
    }

    /// Whether other servers may write the same log.
    pub(crate) fn is_shared(&self) -> bool {
        self.readers.is_shared()
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
        match &self.log {
            Log::Sqlite(log) => log.missing,
            // That nothing is missing is promised by PostgreSQL and its standbys.
            Log::Postgres(_) => 0,
        }
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
        self.checkpoints.close().await;
        match &self.log {
            Log::Sqlite(log) => {
                self.readers.close().await;
                log.close().await;
            }
            // What is being written may have to read.
            Log::Postgres(log) => {
                log.close().await;
                self.readers.close().await;
            }
        }
    }

    /// How many writes wait.
    pub(crate) fn waiting_writes(&self) -> usize {
        match &self.log {
            Log::Sqlite(log) => log.waiting(),
            Log::Postgres(log) => log.waiting(),
        }
    }

    /// The sizes of the database, of its log of changes and of the checkpoints, and the room that their disk has left,
    /// each as far as it is known.
    pub(crate) fn sizes(&self) -> [Option<u64>; 4] {
        match &self.log {
            Log::Sqlite(log) => log.sizes(),
            Log::Postgres(log) => [log.bytes(), None, None, None],
        }
    }

    /// The engine, and its version.
    ///
    /// # Errors
    /// The database cannot be read.
    pub(crate) async fn engine(&self) -> Result<(&'static str, String), StoreError> {
        let (name, version) = match &self.log {
            Log::Sqlite(_) => ("sqlite", "select sqlite_version()"),
            Log::Postgres(_) => ("postgres", "select current_setting('server_version')"),
        };
        Ok((name, self.readers.one(sql(version)).await?))
    }

    /// Remembers what the disk could not read, where it is this machine's.
    fn note_unread(&self, what: Unread) {
        if let Log::Sqlite(log) = &self.log {
            log.readable.note(what);
        }
    }

    /// Insists that the disk reads the log, where the engine gave `error` for `what`.
    ///
    /// # Errors
    /// [`StoreError::Down`] when it does not: the event is not known to be damaged then.
    async fn insist(&self, error: &sqlx::Error, what: Unread) -> Result<(), StoreError> {
        match &self.log {
            Log::Sqlite(log) => log.readable.insist(error, what).await,
            Log::Postgres(_) => Ok(()),
        }
    }

    /// The table of tickets, where several servers have to know them.
    pub(crate) fn ticket_table(&self) -> Option<TicketTable> {
        match &self.log {
            Log::Sqlite(_) => None,
            Log::Postgres(log) => Some(TicketTable::new(log.writers().clone())),
        }
    }

    async fn write(&self, change: Change) -> Result<(), StoreError> {
        let committed = self.enqueue(change)?.instrument(tracing::debug_span!("commit"));
        committed.await.map_err(|_| StoreError::Down("the writer has stopped".into()))?
    }

    fn enqueue(&self, change: Change) -> Result<Outcome, StoreError> {
        match &self.log {
            Log::Sqlite(log) => log.enqueue(change),
            Log::Postgres(log) => log.enqueue(change),
        }
    }
}

#[cfg(test)]
mod tests;
