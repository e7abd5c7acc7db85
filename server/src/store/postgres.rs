//! The log on PostgreSQL, which any number of servers write at the same time.
//!
//! Each change is a transaction of its own, about one session: PostgreSQL commits in groups by itself, and an engine that
//! shards by session keeps each on one shard. Races between servers are decided by the keys of the tables, as they are
//! between processes on one file; nothing is locked in between.
//!
//! ```text
//! room? shares? --> begin --> change --> commit --> acknowledged
//!                     ^                    `-- broken: nobody knows; the retry of the caller finds out
//!                     `-- broken, or a shard asks for it: once more
//! ```

mod hosts;
mod inspect;
mod open;

use std::sync::{Arc, Mutex, PoisonError};

use sqlx::error::DatabaseError;
use sqlx::postgres::PgDatabaseError;
use tokio::sync::{Semaphore, oneshot};
use tokio::time::Instant;

pub(super) use self::hosts::Hosts;
pub use self::hosts::{Address, AddressError};
pub use self::inspect::{SharedInspection, inspect_shared};
pub(super) use self::open::{Opened, open};
use super::apply::{self, Failure};
use super::change::{Change, Deletion, NewSession};
use super::engine::{Connection, Pool, is_broken, sql};
use super::event::Event;
use super::references::NewReference;
use super::sqlite::Outcome;
use super::{OpenError, StoreError, references, tokens};
use crate::limits::Limits;
use crate::metrics::Metrics;

/// How often a change is begun again of which nothing was committed.
const ATTEMPTS: usize = 5;
/// A commit, and a measure of the database's size, this long ago still says how things are.
const FRESH: std::time::Duration = std::time::Duration::from_secs(5);

/// The way to PostgreSQL.
#[derive(Clone, Debug)]
pub(super) struct PostgresLog(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    writers: Pool,
    readers: Pool,
    limits: Limits,
    /// As many changes as may wait.
    places: Arc<Semaphore>,
    last_commit: Mutex<Option<Instant>>,
    /// When it was last asked how many bytes the database holds, and how many they were.
    measured: Mutex<Option<(Instant, u64)>>,
    metrics: Metrics,
}

/// A connection of its own to a log whose tables are brought up to date.
///
/// # Errors
/// It cannot be reached, or does not keep what is promised.
pub(super) async fn connection(address: &Address) -> Result<Connection, OpenError> {
    // What was asked is told in words; the pool only says that it waited.
    let _ = sqlx::Connection::close(self::open::prepared(address).await?).await;
    let failed = |source| OpenError::Connect { address: address.clone(), source };
    let hosts = Hosts::new(address, &[], 1, Limits::default().database_timeout);
    Ok(Connection::Postgres(hosts.acquire().await.map_err(failed)?))
}

impl PostgresLog {
    pub(super) fn start(writers: Pool, readers: Pool, limits: &Limits, metrics: Metrics) -> Self {
        let places = Arc::new(Semaphore::new(limits.write_queue));
        let limits = limits.clone();
        let (last_commit, measured) = (Mutex::default(), Mutex::default());
        Self(Arc::new(Inner { writers, readers, limits, places, last_commit, measured, metrics }))
    }

    /// Begins a change, which goes on whether or not it is waited for.
    ///
    /// # Errors
    /// Too many wait.
    pub(super) fn enqueue(&self, change: Change) -> Result<Outcome, StoreError> {
        let place = self.0.places.clone().try_acquire_owned().map_err(|_full| StoreError::QueueFull)?;
        let (done, outcome) = oneshot::channel();
        let inner = self.0.clone();
        tokio::spawn(async move {
            let written = inner.write(&change).await;
            drop(place);
            // The caller may have gone; the change stands all the same.
            let _ = done.send(written);
        });
        Ok(outcome)
    }

    /// How many changes wait or are being written.
    pub(super) fn waiting(&self) -> usize {
        self.0.limits.write_queue - self.0.places.available_permits()
    }

    /// Ends once all that was begun is written.
    pub(super) async fn close(&self) {
        // All places are free when nobody writes any more.
        let all = u32::try_from(self.0.limits.write_queue).unwrap_or(u32::MAX);
        let _all = self.0.places.acquire_many(all).await;
        self.0.places.close();
        self.0.writers.close().await;
    }

    /// Connections that write.
    pub(super) fn writers(&self) -> &Pool {
        &self.0.writers
    }

    /// What the database holds, as it was last measured.
    pub(super) fn bytes(&self) -> Option<u64> {
        lock(&self.0.measured).map(|(_, bytes)| bytes)
    }
}

impl Inner {
    async fn write(&self, change: &Change) -> Result<(), StoreError> {
        if matches!(change, Change::Check)
            && lock(&self.last_commit).is_some_and(|commit| commit.elapsed() < FRESH / 5)
        {
            return Ok(());
        }
        let reference = self.check(change).await?;
        let begun = Instant::now();
        let written = self.commit(change, reference.as_ref()).await;
        if !matches!(written, Err(StoreError::Conflict | StoreError::Share { .. })) {
            self.metrics.committed(1, written.is_ok(), begun.elapsed());
        }
        match &written {
            Ok(()) => *lock(&self.last_commit) = Some(Instant::now()),
            Err(StoreError::Conflict) => {}
            Err(failure) => tracing::error!(%failure, "a change was not committed"),
        }
        match change {
            Change::Create(new) if written.is_ok() => self.note_request(&new.0, new.1.first()).await,
            _ => written,
        }
    }

    /// Whether there is room for a change, and the reference mesh that goes with a copy of another session: what is to be
    /// read on other shards than the one that it is written to.
    async fn check(&self, change: &Change) -> Result<Option<NewReference>, StoreError> {
        if change.grows() {
            self.check_room().await?;
        }
        match change {
            Change::Create(new) => {
                let (session, events) = &**new;
                if let Some(token_id) = &session.owner {
                    tokens::check_new(&self.readers, token_id, events.iter().map(Event::bytes).sum()).await?;
                }
                match &session.reference_of {
                    Some(origin) => self.reference_of(origin, session).await,
                    None => Ok(None),
                }
            }
            Change::Append(new) => {
                tokens::check_growth(&self.readers, &new.0.session_id, new.2.bytes()).await?;
                Ok(None)
            }
            _ => Ok(None),
        }
    }

    async fn check_room(&self) -> Result<(), StoreError> {
        let measured = *lock(&self.measured);
        let bytes = match measured {
            Some((at, bytes)) if at.elapsed() < FRESH => bytes,
            _ => {
                // Not every engine tells.
                let asked = self.readers.one::<i64>(sql("select pg_database_size(current_database())")).await;
                let bytes = asked.ok().and_then(|bytes| u64::try_from(bytes).ok()).unwrap_or(0);
                *lock(&self.measured) = Some((Instant::now(), bytes));
                bytes
            }
        };
        let most_bytes = self.limits.database_bytes;
        if bytes >= most_bytes { Err(StoreError::TooLarge { most_bytes }) } else { Ok(()) }
    }

    async fn reference_of(
        &self,
        origin: &str,
        session: &NewSession,
    ) -> Result<Option<NewReference>, StoreError> {
        let mut connection = self.readers.acquire().await?;
        let reference =
            references::whole(&mut connection, origin.to_owned(), session.head.created_us).await?;
        Ok(reference
            .map(|reference| NewReference { session_id: session.head.session_id.clone(), ..reference }))
    }

    /// Commits one change. Where it was not begun yet, or another transaction was in its way, it is begun again.
    async fn commit(&self, change: &Change, reference: Option<&NewReference>) -> Result<(), StoreError> {
        let mut attempts = 0;
        loop {
            attempts += 1;
            let (failure, was_begun) = match self.try_commit(change, reference).await {
                Ok(()) => return Ok(()),
                Err(failed) => failed,
            };
            let again = match &failure {
                Failure::Refused(_) => false,
                Failure::Engine(error) => !was_begun && is_broken(error) || is_serialization(error),
            };
            if !again || attempts == ATTEMPTS {
                return Err(failure.into());
            }
        }
    }

    /// What failed, and whether something of the change may have been done.
    async fn try_commit(
        &self,
        change: &Change,
        reference: Option<&NewReference>,
    ) -> Result<(), (Failure, bool)> {
        let mut connection = self.writers.acquire().await.map_err(|error| (error.into(), false))?;
        let limit = self.limits.database_timeout;
        let mut was_begun = false;
        let written = tokio::time::timeout(limit, async {
            sql("begin").execute(&mut connection).await?;
            was_begun = true;
            apply::apply(&mut connection, change).await?;
            if let Some(reference) = reference {
                references::keep(&mut connection, reference).await?;
            }
            sql("commit").execute(&mut connection).await?;
            Ok(())
        })
        .await
        .unwrap_or_else(|_elapsed| Err(Failure::Engine(hosts::late(limit))));
        match written {
            Ok(()) => Ok(()),
            Err(failure) => {
                // What was begun is taken back: where the connection is broken, by the server when it is closed.
                let is_good = !matches!(&failure, Failure::Engine(error) if is_broken(error))
                    && sql("rollback").execute(&mut connection).await.is_ok();
                if !is_good {
                    self.writers.discard(connection);
                }
                Err((failure, was_begun))
            }
        }
    }

    /// Notes which session a request made, so that the same request for another session is found out. Of two at the same
    /// time, the second takes its session back.
    async fn note_request(&self, session: &NewSession, first: Option<&Event>) -> Result<(), StoreError> {
        let request_id = match &session.imported_by {
            Some(import) => Some(&import.request_id).filter(|id| !id.is_empty()),
            None => first.and_then(|event| event.request_id.as_ref()),
        };
        let Some(request_id) = request_id else { return Ok(()) };
        let session_id = &session.head.session_id;
        let mut connection = self.writers.acquire().await?;
        sql("insert into created_requests (request_id, session_id) values ($1, $2)
             on conflict (request_id) do nothing")
        .bind(request_id)
        .bind(session_id)
        .execute(&mut connection)
        .await?;
        let noted: Option<String> = sql("select session_id from created_requests where request_id = $1")
            .bind(request_id)
            .scalar(&mut connection)
            .await?;
        if noted.is_none_or(|noted| noted == *session_id) {
            return Ok(());
        }
        drop(connection);
        let created_us = session.head.created_us;
        let back = Deletion { session_id: session_id.clone(), created_us, head: None, request: None };
        self.commit(&Change::Delete(back), None).await?;
        let mut connection = self.writers.acquire().await?;
        sql("delete from creations where session_id = $1 and request_id = $2")
            .bind(session_id)
            .bind(request_id)
            .execute(&mut connection)
            .await?;
        Err(StoreError::Conflict)
    }
}

/// Whether PostgreSQL has no room left.
pub(super) fn is_full(error: &sqlx::Error) -> bool {
    let error = error.as_database_error().and_then(|error| error.try_downcast_ref::<PgDatabaseError>());
    error.is_some_and(|error| error.code() == "53100")
}

/// Whether another transaction was in the way, and nothing was committed.
fn is_serialization(error: &sqlx::Error) -> bool {
    let code = error.as_database_error().and_then(DatabaseError::code);
    code.is_some_and(|code| code == "40001" || code == "40P01")
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    // Nothing panics while it is held.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
