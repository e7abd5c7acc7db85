//! The writer: whatever is queued goes into one transaction, each change in a savepoint of its own.
//!
//! ```text
//! files as they were opened? --> begin, each change, commit --> still? --> witness --> acknowledged
//! ```
//! A change that conflicts is undone alone; the others of its group are committed.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

use super::change::Change;
use super::engine::{Connection, sql};
use super::open::{self, Opened};
use super::witness::Testimony;
use super::{StoreError, apply};
use crate::metrics::Metrics;

/// A commit, and a measure of the database's size, this long ago still says how things are.
const FRESH: Duration = Duration::from_secs(1);
/// What is written to see whether there is room, in bytes.
const ROOM: i64 = 65_536;

#[derive(Debug)]
pub(super) struct Job {
    pub(super) change: Change,
    pub(super) done: oneshot::Sender<Result<(), StoreError>>,
}

/// The connection that writes, and what it knows of the log.
#[derive(Debug)]
pub(super) struct Writer {
    opened: Opened,
    /// Bytes that all sessions may take together.
    most_bytes: u64,
    last_commit: Option<Instant>,
    /// When it was last measured how many bytes the database holds, and how many they were.
    measured: Option<(Instant, u64)>,
    disk_was_full: bool,
    /// After a failure nothing is known of what the engine still holds: it is opened anew.
    is_stale: bool,
    metrics: Metrics,
}

impl Writer {
    pub(super) fn new(opened: Opened, most_bytes: u64, metrics: Metrics) -> Self {
        let (last_commit, measured) = (None, None);
        Self { opened, most_bytes, last_commit, measured, disk_was_full: false, is_stale: false, metrics }
    }

    /// Serves the queue until it is closed or its last sender is gone.
    pub(super) async fn run(
        mut self,
        mut queue: mpsc::Receiver<Job>,
        batch: usize,
        closing: CancellationToken,
    ) {
        let mut jobs = Vec::new();
        while receive(&mut queue, &mut jobs, batch, &closing).await > 0 {
            let outcomes = self.write(&jobs).await;
            if let Err(failure) = &outcomes {
                tracing::error!(%failure, changes = jobs.len(), "a group of changes was not committed");
            }
            for (index, job) in jobs.drain(..).enumerate() {
                let outcome =
                    outcomes.as_ref().map_or_else(|failure| Err(failure.clone()), |each| each[index].clone());
                // The caller may have gone; the change stands all the same.
                let _ = job.done.send(outcome);
            }
        }
        if let Err(failure) = self.opened.connection.close().await {
            tracing::error!(%failure, "the database was not closed well; nothing that was acknowledged is lost");
        }
    }

    /// Commits the changes together, and says what became of each.
    async fn write(&mut self, jobs: &[Job]) -> Result<Vec<Result<(), StoreError>>, StoreError> {
        self.check_files()?;
        let is_check = jobs.iter().all(|job| matches!(job.change, Change::Check));
        if is_check && self.last_commit.is_some_and(|commit| commit.elapsed() < FRESH) {
            return Ok(vec![Ok(()); jobs.len()]);
        }
        self.last_commit = None;
        if self.is_stale {
            (self.opened.connection, self.opened.appended) = open::reopened(&self.opened.database).await?;
            self.is_stale = false;
        }
        let begun = Instant::now();
        let committed = self.commit(jobs).await;
        self.metrics.committed(jobs.len(), committed.is_ok(), begun.elapsed());
        let outcomes = match committed {
            Ok(outcomes) => outcomes,
            Err(failure) => {
                // Fails harmlessly where the engine has rolled back by itself.
                let _ = execute(&mut self.opened.connection, "rollback").await;
                self.disk_was_full = matches!(failure, StoreError::Full);
                self.is_stale = !self.disk_was_full;
                return Err(failure);
            }
        };
        self.disk_was_full = false;
        // What was committed into a deleted file is gone with the process.
        self.check_files()?;
        let added = appended(jobs, &outcomes);
        if added > 0 {
            self.opened.appended += added;
            self.testify().await;
        }
        self.last_commit = Some(Instant::now());
        Ok(outcomes)
    }

    async fn commit(&mut self, jobs: &[Job]) -> Result<Vec<Result<(), StoreError>>, StoreError> {
        let connection = &mut self.opened.connection;
        execute(connection, "begin immediate").await?;
        if self.disk_was_full {
            // A page that is there already takes no room, so more is written to see whether there is some.
            execute(connection, "create table room (bytes blob)").await?;
            sql("insert into room values (zeroblob($1))").bind(ROOM).execute(connection).await?;
            execute(connection, "drop table room").await?;
        }
        if self.measured.is_none_or(|(at, _)| at.elapsed() > FRESH) {
            self.measured = Some((Instant::now(), apply::bytes_used(connection).await?));
        }
        let is_over = self.measured.is_some_and(|(_, bytes)| bytes >= self.most_bytes);
        let mut outcomes = Vec::with_capacity(jobs.len());
        for job in jobs {
            if is_over && job.change.grows() {
                outcomes.push(Err(StoreError::TooLarge { most_bytes: self.most_bytes }));
                continue;
            }
            execute(connection, "savepoint change").await?;
            let outcome = apply::apply(connection, &job.change).await.map_err(StoreError::from);
            if let Err(failure @ (StoreError::Full | StoreError::Down(_))) = outcome {
                // The engine may have rolled back the whole group by itself.
                return Err(failure);
            }
            if outcome.is_err() {
                execute(connection, "rollback to change").await?;
            }
            execute(connection, "release change").await?;
            outcomes.push(outcome);
        }
        let added = appended(jobs, &outcomes);
        if added > 0 {
            sql("update log set appended = appended + $1").bind(added).execute(connection).await?;
        }
        execute(connection, "commit").await?;
        Ok(outcomes)
    }

    fn check_files(&self) -> Result<(), StoreError> {
        self.opened.files.problem().map_or(Ok(()), |problem| Err(StoreError::Down(problem)))
    }

    /// The events are on disk already: a witness that cannot be written only says less after a crash.
    async fn testify(&self) {
        let Opened { witness, identity, appended, .. } = &self.opened;
        let (witness, testimony) =
            (Arc::clone(witness), Testimony { identity: identity.clone(), appended: *appended });
        let written = tokio::task::spawn_blocking(move || witness.write(&testimony)).await;
        if let Ok(Err(error)) = written {
            tracing::warn!(%error, path = %self.opened.witness.path().display(), "the witness was not written");
        }
    }
}

/// How many events were added to the log.
fn appended(jobs: &[Job], outcomes: &[Result<(), StoreError>]) -> i64 {
    let committed = jobs.iter().zip(outcomes).filter(|(_, outcome)| outcome.is_ok());
    committed.map(|(job, _)| job.change.appended()).sum()
}

/// Waits for changes; 0 when there will be no more.
async fn receive(
    queue: &mut mpsc::Receiver<Job>,
    jobs: &mut Vec<Job>,
    batch: usize,
    closing: &CancellationToken,
) -> usize {
    tokio::select! {
        count = queue.recv_many(jobs, batch) => return count,
        () = closing.cancelled() => queue.close(),
    }
    // A closed queue takes nothing new and still hands out what it holds.
    queue.recv_many(jobs, batch).await
}

async fn execute(connection: &mut Connection, statement: &'static str) -> Result<(), StoreError> {
    sql(statement).execute(connection).await?;
    Ok(())
}
