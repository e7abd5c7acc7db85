//! Whether the disk reads what it holds: an error of the disk is no damage of the log.
//!
//! SQLite answers a read that the disk refuses as it answers a damaged page. Before a log is called damaged for what
//! cannot be read, the files are therefore read from end to end, past the engine; and what the disk did not read is
//! read again whenever it is asked whether the server is ready.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use sqlx::{Connection, SqliteConnection};
use tokio::time::Instant;

use super::engine::sql;
use super::{Log, Store, StoreError, files, open};

/// A read this long ago still says how things are.
const FRESH: Duration = Duration::from_secs(1);

/// What could not be read.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Unread {
    session_id: String,
    /// The event before it; nothing for the session's row.
    after: Option<i64>,
}

impl Unread {
    /// The row of a session.
    pub(super) fn session(session_id: &str) -> Self {
        Self { session_id: session_id.to_owned(), after: None }
    }

    /// The event after this one.
    pub(super) fn event_after(session_id: &str, after: i64) -> Self {
        Self { session_id: session_id.to_owned(), after: Some(after) }
    }
}

/// What is known of the disk's reads.
#[derive(Debug)]
pub(super) struct Readable {
    database: PathBuf,
    /// What could not be read last.
    unread: Mutex<Option<Unread>>,
    /// When all was read well.
    last_read: Mutex<Option<Instant>>,
    /// What the disk read, and the engine did not understand: it is damaged, and stays so in this process.
    damaged: tokio::sync::Mutex<HashSet<Unread>>,
}

impl Readable {
    pub(super) fn of(database: &Path) -> Self {
        Self {
            database: database.to_owned(),
            unread: Mutex::default(),
            last_read: Mutex::default(),
            damaged: tokio::sync::Mutex::default(),
        }
    }

    /// Remembers what could not be read, until it can.
    pub(super) fn note(&self, what: Unread) {
        *lock(&self.unread) = Some(what);
        *lock(&self.last_read) = None;
    }

    /// Insists that the disk reads the files, where the engine gave `error` for `what`. It goes on when the caller
    /// leaves, and is done once for each event.
    ///
    /// # Errors
    /// [`StoreError::Down`] when it does not: the event is not known to be damaged then.
    pub(super) async fn insist(
        self: &Arc<Self>,
        error: &sqlx::Error,
        what: Unread,
    ) -> Result<(), StoreError> {
        let this = self.clone();
        let error = error.to_string();
        let reading = tokio::spawn(async move {
            let mut damaged = this.damaged.lock().await;
            if damaged.contains(&what) {
                return Ok(());
            }
            let database = this.database.clone();
            let read = tokio::task::spawn_blocking(move || files::read_through(&database)).await;
            match read {
                Ok(Ok(())) => {
                    damaged.insert(what);
                    Ok(())
                }
                Ok(Err(disk)) => {
                    this.note(what);
                    Err(StoreError::Down(format!("the disk does not read the log: {disk} ({error})")))
                }
                Err(stopped) => Err(StoreError::Down(format!("the files were not read: {stopped}"))),
            }
        });
        reading.await.unwrap_or_else(|stopped| Err(StoreError::Down(stopped.to_string())))
    }
}

impl Store {
    /// Finds out whether the log can be read: by a connection that holds no page yet, unless that was within the last
    /// second, and by what could not be read last.
    ///
    /// # Errors
    /// [`StoreError::Down`] when the disk does not read it.
    pub(crate) async fn check_readable(&self) -> Result<(), StoreError> {
        let Log::Sqlite(log) = &self.log else {
            // The disk is that of PostgreSQL.
            let _: String = self.readers.one(sql("select identity from log")).await?;
            return Ok(());
        };
        let readable = &log.readable;
        if lock(&readable.last_read).is_some_and(|read| read.elapsed() < FRESH) {
            return Ok(());
        }
        let mut connection = open::reader(&readable.database).await?;
        read_log(&mut connection).await?;
        connection.close().await?;
        let unread = lock(&readable.unread).clone();
        if let Some(Unread { session_id, after }) = &unread {
            match after {
                None => drop(self.session(session_id).await?),
                Some(after) => match self.events(session_id, *after, 1).await {
                    // What is damaged is told otherwise.
                    Ok(_) | Err(StoreError::Damaged(_)) => {}
                    Err(failure) => return Err(failure),
                },
            }
        }
        let mut still = lock(&readable.unread);
        if *still == unread {
            *still = None;
            *lock(&readable.last_read) = Some(Instant::now());
        }
        Ok(())
    }
}

async fn read_log(connection: &mut SqliteConnection) -> Result<(), sqlx::Error> {
    sqlx::query("select identity from log").fetch_one(connection).await.map(drop)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Nothing panics while it is held.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
