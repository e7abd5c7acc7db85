//! One change of the log as SQL.

use std::collections::BTreeMap;

use super::StoreError;
use super::change::{Change, Damage, Deletion, Import, NewSession, SessionHead};
use super::engine::{Connection, sql};
use super::event::Event;
use super::link::{self, Link, Sealed};
use super::{references, tokens};
use crate::session::now_us;

/// What kept a change from being applied.
#[derive(Debug)]
pub(super) enum Failure {
    /// The change itself: it is refused.
    Refused(StoreError),
    /// The engine, or the way to it.
    Engine(sqlx::Error),
}

impl From<sqlx::Error> for Failure {
    fn from(error: sqlx::Error) -> Self {
        Self::Engine(error)
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        Self::Refused(error)
    }
}

impl From<Failure> for StoreError {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Refused(error) => error,
            Failure::Engine(error) => error.into(),
        }
    }
}

/// Applies one change within a transaction.
pub(super) async fn apply(connection: &mut Connection, change: &Change) -> Result<(), Failure> {
    match change {
        Change::Create(new) => create(connection, &new.0, &new.1).await,
        Change::Append(new) => append(connection, &new.0, &new.1, &new.2).await,
        Change::Delete(deletion) => delete(connection, deletion).await,
        Change::SetAside(Damage { session_id, sound, reason }) => {
            mark(connection, session_id, Some(*sound), Some(reason)).await
        }
        Change::Restore(session_id) => mark(connection, session_id, None, None).await,
        Change::KeepReference(reference) => references::keep(connection, reference).await,
        Change::ForgetReference(session_id) => references::forget(connection, session_id).await,
        Change::NoteErrors(errors) => references::note(connection, errors).await,
        Change::Check => {
            let query = sql("update log set checked_us = $1");
            query.bind(now_us()).execute(connection).await?;
            Ok(())
        }
    }
}

/// What the database holds, in bytes: pages that a deletion left free are used again.
pub(super) async fn bytes_used(connection: &mut Connection) -> Result<u64, sqlx::Error> {
    let query = if connection.is_shared() {
        "select pg_database_size(current_database())"
    } else {
        "select (page_count - freelist_count) * page_size
         from pragma_page_count(), pragma_freelist_count(), pragma_page_size()"
    };
    let bytes: Option<i64> = sql(query).scalar(connection).await?;
    Ok(bytes.and_then(|bytes| u64::try_from(bytes).ok()).unwrap_or(0))
}

fn seal(head: &SessionHead, seq: i64) -> Link {
    let SessionHead { session_id, created_us, state, summary, link, new_labels: _ } = head;
    let (created_us, state) = (*created_us, *state);
    link::seal(&Sealed { session_id, created_us, state, head: seq, link, summary })
}

async fn create(connection: &mut Connection, session: &NewSession, events: &[Event]) -> Result<(), Failure> {
    let NewSession { head, experiment, labels, imported_by, owner, reference_of } = session;
    let SessionHead { session_id, created_us, state, summary, link, new_labels: _ } = head;
    let last = events.last().map_or(0, |event| event.seq);
    sql("insert into sessions (session_id, experiment, state, created_us, head, summary, link, seal)
         values ($1, $2, $3, $4, $5, $6, $7, $8)")
    .bind(session_id)
    .bind(experiment)
    .bind(state)
    .bind(created_us)
    .bind(last)
    .bind(summary)
    .bind(link.as_slice())
    .bind(seal(head, last).as_slice())
    .execute(connection)
    .await?;
    label(connection, session_id, labels).await?;
    note_request(connection, session_id, events.first(), imported_by.as_ref()).await?;
    let mut link = link::first(session_id);
    for event in events {
        link = event.link(&link);
        insert_event(connection, session_id, &link, event).await?;
    }
    // Elsewhere the other session may be on another shard: its reference was read before.
    if let Some(origin) = reference_of.as_ref().filter(|_| !connection.is_shared()) {
        references::keep_that_of(connection, session_id, origin).await?;
    }
    if let Some(token_id) = owner {
        let bytes = events.iter().map(Event::bytes).sum();
        tokens::own(connection, session_id, token_id, bytes).await?;
    }
    Ok(())
}

async fn label(
    connection: &mut Connection,
    session_id: &str,
    labels: &BTreeMap<String, String>,
) -> Result<(), Failure> {
    for (name, value) in labels {
        sql("insert into session_labels (session_id, name, value) values ($1, $2, $3)")
            .bind(session_id)
            .bind(name)
            .bind(value)
            .execute(connection)
            .await?;
    }
    Ok(())
}

/// Keeps the request that made a session, for retries that do not name the session.
async fn note_request(
    connection: &mut Connection,
    session_id: &str,
    first: Option<&Event>,
    imported_by: Option<&Import>,
) -> Result<(), Failure> {
    let Some(Import { request_id, request_digest, reply }) = imported_by else {
        let Some(request_id) = first.and_then(|event| event.request_id.as_ref()) else { return Ok(()) };
        sql("insert into creations (request_id, session_id) values ($1, $2)")
            .bind(request_id)
            .bind(session_id)
            .execute(connection)
            .await?;
        return Ok(());
    };
    if !request_id.is_empty() {
        sql("insert into creations (request_id, session_id, request_digest, reply) values ($1, $2, $3, $4)")
            .bind(request_id)
            .bind(session_id)
            .bind(request_digest)
            .bind(reply)
            .execute(connection)
            .await?;
    }
    Ok(())
}

async fn append(
    connection: &mut Connection,
    head: &SessionHead,
    before: &Link,
    event: &Event,
) -> Result<(), Failure> {
    let SessionHead { session_id, created_us, state, summary, link, new_labels } = head;
    let updated = sql("update sessions set state = $1, head = $2, summary = $3, link = $4, seal = $5
         where session_id = $6 and created_us = $7 and head = $2 - 1 and link = $8 and damage is null")
    .bind(state)
    .bind(event.seq)
    .bind(summary)
    .bind(link.as_slice())
    .bind(seal(head, event.seq).as_slice())
    .bind(session_id)
    .bind(created_us)
    .bind(before.as_slice())
    .execute(connection)
    .await?;
    if updated != 1 {
        return Err(StoreError::Conflict.into());
    }
    if let Some(labels) = new_labels {
        sql("delete from session_labels where session_id = $1").bind(session_id).execute(connection).await?;
        label(connection, session_id, labels).await?;
    }
    insert_event(connection, session_id, link, event).await?;
    tokens::grow(connection, session_id, event.bytes()).await
}

/// Writes one event with its link.
pub(super) async fn insert_event(
    connection: &mut Connection,
    session_id: &str,
    link: &Link,
    event: &Event,
) -> Result<(), sqlx::Error> {
    let Event {
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
    sql("insert into events (session_id, seq, request_id, request_digest, kind, payload, reply, state_hash,
                             stats_after, algorithm_version, append_us, actor, link)
         values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13)")
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
    .bind(link.as_slice())
    .execute(connection)
    .await?;
    Ok(())
}

async fn delete(connection: &mut Connection, deletion: &Deletion) -> Result<(), Failure> {
    let Deletion { session_id, created_us, head, request } = deletion;
    let deleted =
        sql("delete from sessions where session_id = $1 and created_us = $2 and head = coalesce($3, head)")
            .bind(session_id)
            .bind(created_us)
            .bind(head)
            .execute(connection)
            .await?;
    if deleted != 1 {
        return Err(StoreError::Conflict.into());
    }
    if let Some((request_id, digest)) = request {
        sql("insert into deletions (session_id, request_id, request_digest) values ($1, $2, $3)")
            .bind(session_id)
            .bind(request_id)
            .bind(digest)
            .execute(connection)
            .await?;
    }
    Ok(())
}

async fn mark(
    connection: &mut Connection,
    session_id: &str,
    sound: Option<i64>,
    reason: Option<&String>,
) -> Result<(), Failure> {
    sql("update sessions set damage = $1, sound = $2 where session_id = $3")
        .bind(reason)
        .bind(sound)
        .bind(session_id)
        .execute(connection)
        .await?;
    Ok(())
}
