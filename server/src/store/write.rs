//! The writer: whatever is queued goes into one transaction, each change in a savepoint of its own.
//!
//! A change that conflicts is undone alone; the others of its group are committed.

use std::collections::BTreeMap;

use sqlx::{Connection, SqliteConnection};
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

use super::StoreError;

/// A session as it is created.
#[derive(Debug)]
pub(crate) struct NewSession {
    pub(crate) head: SessionHead,
    pub(crate) experiment: String,
    pub(crate) labels: BTreeMap<String, String>,
}

/// What `sessions` says of a session after an event.
#[derive(Debug)]
pub(crate) struct SessionHead {
    pub(crate) session_id: String,
    /// Tells the session from an earlier one of the same id.
    pub(crate) created_us: i64,
    pub(crate) state: i32,
    pub(crate) summary: Vec<u8>,
}

/// An event to append.
#[derive(Debug)]
pub(crate) struct NewEvent {
    pub(crate) seq: i64,
    pub(crate) request_id: Option<String>,
    pub(crate) request_digest: Vec<u8>,
    pub(crate) kind: &'static str,
    pub(crate) payload: Vec<u8>,
    pub(crate) reply: Vec<u8>,
    pub(crate) state_hash: String,
    pub(crate) stats_after: Vec<u8>,
    pub(crate) algorithm_version: &'static str,
    pub(crate) append_us: i64,
    pub(crate) actor: String,
}

/// A session to remove.
#[derive(Debug)]
pub(crate) struct Deletion {
    pub(crate) session_id: String,
    pub(crate) created_us: i64,
    /// The revision that the caller saw; `None` removes it whatever it is.
    pub(crate) head: Option<i64>,
    /// Request id and digest, for retries.
    pub(crate) request: Option<(String, Vec<u8>)>,
}

#[derive(Debug)]
pub(super) enum Change {
    Create(Box<(NewSession, NewEvent)>),
    Append(Box<(SessionHead, NewEvent)>),
    Delete(Deletion),
    Nothing,
}

#[derive(Debug)]
pub(super) struct Job {
    pub(super) change: Change,
    pub(super) done: oneshot::Sender<Result<(), StoreError>>,
}

/// Serves the queue until it is closed or its last sender is gone.
pub(super) async fn run(
    mut connection: SqliteConnection,
    mut queue: mpsc::Receiver<Job>,
    batch: usize,
    closing: CancellationToken,
) {
    let mut jobs = Vec::with_capacity(batch);
    let mut disk_was_full = false;
    while receive(&mut queue, &mut jobs, batch, &closing).await > 0 {
        let outcomes = commit_group(&mut connection, &jobs, disk_was_full).await;
        disk_was_full = matches!(outcomes, Err(StoreError::Full));
        if let Err(failure) = &outcomes {
            tracing::error!(%failure, changes = jobs.len(), "a group of changes was not committed");
            // Fails harmlessly where the engine has rolled back by itself.
            let _ = execute(&mut connection, "rollback").await;
        }
        for (index, job) in jobs.drain(..).enumerate() {
            let outcome =
                outcomes.as_ref().map_or_else(|failure| Err(failure.clone()), |each| each[index].clone());
            // The caller may have gone; the change stands all the same.
            let _ = job.done.send(outcome);
        }
    }
    if let Err(failure) = connection.close().await {
        tracing::error!(%failure, "the database was not closed well; nothing that was acknowledged is lost");
    }
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

async fn commit_group(
    connection: &mut SqliteConnection,
    jobs: &[Job],
    disk_was_full: bool,
) -> Result<Vec<Result<(), StoreError>>, StoreError> {
    execute(connection, "begin immediate").await?;
    if disk_was_full {
        // An empty commit takes no room, so something is written to see whether there is some.
        execute(connection, "create table room (bytes blob)").await?;
        execute(connection, "insert into room values (zeroblob(65536))").await?;
        execute(connection, "drop table room").await?;
    }
    let mut outcomes = Vec::with_capacity(jobs.len());
    for job in jobs {
        execute(connection, "savepoint change").await?;
        let outcome = apply(connection, &job.change).await;
        if let Err(StoreError::Full) = outcome {
            // The engine may have rolled back the whole group by itself.
            return Err(StoreError::Full);
        }
        if outcome.is_err() {
            execute(connection, "rollback to change").await?;
        }
        execute(connection, "release change").await?;
        outcomes.push(outcome);
    }
    execute(connection, "commit").await?;
    Ok(outcomes)
}

async fn execute(connection: &mut SqliteConnection, statement: &'static str) -> Result<(), StoreError> {
    sqlx::query(statement).execute(connection).await?;
    Ok(())
}

async fn apply(connection: &mut SqliteConnection, change: &Change) -> Result<(), StoreError> {
    match change {
        Change::Create(new) => create(connection, &new.0, &new.1).await,
        Change::Append(new) => append(connection, &new.0, &new.1).await,
        Change::Delete(deletion) => delete(connection, deletion).await,
        Change::Nothing => Ok(()),
    }
}

async fn create(
    connection: &mut SqliteConnection,
    session: &NewSession,
    event: &NewEvent,
) -> Result<(), StoreError> {
    let NewSession { head, experiment, labels } = session;
    let SessionHead { session_id, created_us, state, summary } = head;
    sqlx::query(
        "insert into sessions (session_id, experiment, state, created_us, head, summary)
         values ($1, $2, $3, $4, $5, $6)",
    )
    .bind(session_id)
    .bind(experiment)
    .bind(state)
    .bind(created_us)
    .bind(event.seq)
    .bind(summary)
    .execute(&mut *connection)
    .await?;
    for (name, value) in labels {
        sqlx::query("insert into session_labels (session_id, name, value) values ($1, $2, $3)")
            .bind(session_id)
            .bind(name)
            .bind(value)
            .execute(&mut *connection)
            .await?;
    }
    if let Some(request_id) = &event.request_id {
        sqlx::query("insert into creations (request_id, session_id) values ($1, $2)")
            .bind(request_id)
            .bind(session_id)
            .execute(&mut *connection)
            .await?;
    }
    insert_event(connection, session_id, event).await
}

async fn append(
    connection: &mut SqliteConnection,
    head: &SessionHead,
    event: &NewEvent,
) -> Result<(), StoreError> {
    let SessionHead { session_id, created_us, state, summary } = head;
    let updated = sqlx::query(
        "update sessions set state = $1, head = $2, summary = $3
         where session_id = $4 and created_us = $5 and head = $2 - 1",
    )
    .bind(state)
    .bind(event.seq)
    .bind(summary)
    .bind(session_id)
    .bind(created_us)
    .execute(&mut *connection)
    .await?;
    if updated.rows_affected() != 1 {
        return Err(StoreError::Conflict);
    }
    insert_event(connection, session_id, event).await
}

async fn insert_event(
    connection: &mut SqliteConnection,
    session_id: &str,
    event: &NewEvent,
) -> Result<(), StoreError> {
    let NewEvent {
        seq,
        request_id,
        request_digest,
        kind,
        payload,
        reply,
        state_hash,
        stats_after,
        algorithm_version,
        append_us,
        actor,
    } = event;
    sqlx::query(
        "insert into events (session_id, seq, request_id, request_digest, kind, payload, reply, state_hash,
                             stats_after, algorithm_version, append_us, actor)
         values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12)",
    )
    .bind(session_id)
    .bind(seq)
    .bind(request_id)
    .bind(request_digest)
    .bind(kind)
    .bind(payload)
    .bind(reply)
    .bind(state_hash)
    .bind(stats_after)
    .bind(algorithm_version)
    .bind(append_us)
    .bind(actor)
    .execute(connection)
    .await?;
    Ok(())
}

async fn delete(connection: &mut SqliteConnection, deletion: &Deletion) -> Result<(), StoreError> {
    let Deletion { session_id, created_us, head, request } = deletion;
    let deleted = sqlx::query(
        "delete from sessions where session_id = $1 and created_us = $2 and head = coalesce($3, head)",
    )
    .bind(session_id)
    .bind(created_us)
    .bind(head)
    .execute(&mut *connection)
    .await?;
    if deleted.rows_affected() != 1 {
        return Err(StoreError::Conflict);
    }
    if let Some((request_id, digest)) = request {
        sqlx::query("insert into deletions (session_id, request_id, request_digest) values ($1, $2, $3)")
            .bind(session_id)
            .bind(request_id)
            .bind(digest)
            .execute(connection)
            .await?;
    }
    Ok(())
}
