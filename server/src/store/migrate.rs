//! A log moved from one engine to the other, or to another database of the same.
//!
//! ```text
//! tokens, requests --> each session: there already? --> else all of it in one transaction --> all links of the target
//! ```
//! Each session is read from one snapshot of its own and written by one transaction, so that whoever begins again after
//! an interruption goes on where it ended. A session that went on in the source since is brought up to it; one that the
//! target has otherwise is not touched, and told. No server may write the source meanwhile for the copy to be the whole.

use std::path::Path;

use sqlx::FromRow;

use super::apply::{Failure, insert_event};
use super::backup::{Hear, Progress};
use super::engine::{Connection, Statement, sql};
use super::link;
use super::location::Location;
use super::open::{self, OpenError};
use super::proof::{Proof, page, prove_all};
use super::read::{SESSION_COLUMNS, SessionRow};
use super::witness::{Testimony, Witness};
use super::{files, linking, postgres, references};

/// Events that are copied at once.
const COPIED_AT_ONCE: i64 = 64;

/// Why a log was not moved, or not all of it.
#[derive(Debug, thiserror::Error)]
pub enum MigrateError {
    /// There is nothing to move.
    #[error("there is no database {0:?}")]
    Missing(std::path::PathBuf),
    /// Both are the same.
    #[error("both are {0}: name another one to move to")]
    Same(String),
    /// One of them cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// One of the engines failed; what was moved stays, and the same command goes on from there.
    #[error("a database does not answer: {0}; the same command goes on from there")]
    Query(#[from] sqlx::Error),
    /// The witness beside the target cannot be written.
    #[error("the witness beside the target: {0}")]
    Witness(std::io::Error),
    /// A session of the source does not prove itself.
    #[error("the log of session {session_id:?} does not prove itself in the source: {reason}")]
    Damaged {
        /// The session.
        session_id: String,
        /// What is wrong.
        reason: String,
    },
    /// The target has another session of the same id, or other events.
    #[error(
        "the target has another session {0:?}: it was left as it is; choose an empty target, or delete it there"
    )]
    Another(String),
}

/// What was moved.
#[derive(Clone, Debug, Default)]
pub struct Migrated {
    /// Sessions of the source.
    pub sessions: u64,
    /// Sessions that the target had already, to the last event.
    pub there_already: u64,
    /// Events that were written.
    pub events: u64,
    /// What the target's sessions turned out to be.
    pub proof: Proof,
}

/// Moves all sessions with what belongs to them, and the tokens. Both logs end with the same link for each session.
///
/// # Errors
/// One of them cannot be used, a session does not prove itself, or the target has another one of its id.
pub async fn migrate(from: &Location, to: &Location, hear: Hear<'_>) -> Result<Migrated, MigrateError> {
    if from.to_string() == to.to_string() {
        return Err(MigrateError::Same(from.to_string()));
    }
    let mut source = source(from).await?;
    let (mut target, held) = target(to).await?;
    copy_tables(&mut source, &mut target).await?;
    let ids: Vec<(String,)> =
        sql("select session_id from sessions order by created_us, session_id").all(&mut source).await?;
    let all = sql("select count(*) from events").scalar::<i64>(&mut source).await?.unwrap_or(0);
    let mut moved = Migrated::default();
    let mut read = 0;
    for (session_id,) in ids {
        source.begin_snapshot().await?;
        let session = move_session(&mut source, &mut target, &session_id, &mut moved).await;
        sql("rollback").execute(&mut source).await?;
        if session.is_err() {
            // Where the connection is broken it is rolled back without this.
            let _ = sql("rollback").execute(&mut target).await;
        }
        read += session?;
        hear(Progress::Copied(read, u64::try_from(all).unwrap_or(0)));
    }
    let events = sql("select count(*) from events").scalar::<i64>(&mut target).await?.unwrap_or(0);
    let events = u64::try_from(events).unwrap_or(0);
    moved.proof = prove_all(&mut target, &|proved| hear(Progress::Proved(proved, events))).await?;
    if let Some(witness) = held {
        settle(&mut target, &witness).await?;
    }
    source.close().await?;
    target.close().await?;
    Ok(moved)
}

/// A connection that only reads.
async fn source(from: &Location) -> Result<Connection, MigrateError> {
    match from {
        Location::File(path) if !path.is_file() => Err(MigrateError::Missing(path.clone())),
        Location::File(path) => {
            // Its tables are brought up to date by whoever serves it.
            let failed = |source| OpenError::Open { path: path.clone(), source };
            Ok(Connection::Sqlite(open::reader(path).await.map_err(failed)?))
        }
        Location::Postgres(address) => Ok(postgres::connection(address).await?),
    }
}

/// A connection that writes, to tables that are up to date; a file is held, so that no server begins meanwhile.
async fn target(to: &Location) -> Result<(Connection, Option<Witness>), MigrateError> {
    match to {
        Location::File(path) => {
            let (connection, witness) = held_file(path).await?;
            Ok((connection, Some(witness)))
        }
        Location::Postgres(address) => Ok((postgres::connection(address).await?, None)),
    }
}

async fn held_file(path: &Path) -> Result<(Connection, Witness), OpenError> {
    let failed = |error: std::io::Error| OpenError::Open { path: path.into(), source: error.into() };
    let witness = open::held(path).await.map_err(failed)?;
    let witness = witness.ok_or_else(|| OpenError::InUse { path: path.into() })?;
    files::create_private(path).map_err(failed)?;
    let mut connection = Connection::Sqlite(open::writer(path).await?);
    linking::link_all(&mut connection).await?;
    open::identify(&mut connection).await?;
    Ok((connection, witness))
}

/// What the file says of itself after all of it was written.
async fn settle(target: &mut Connection, witness: &Witness) -> Result<(), MigrateError> {
    sql("update log set appended = (select count(*) from events), missing = 0").execute(target).await?;
    let said: Option<(String, i64)> = sql("select identity, appended from log").optional(target).await?;
    let (identity, appended) = said.ok_or(sqlx::Error::RowNotFound)?;
    witness.rewrite(&Testimony { identity, appended }).map_err(MigrateError::Witness)
}

/// The request that made a session.
#[derive(FromRow)]
struct Creation {
    request_id: String,
    session_id: String,
    request_digest: Option<Vec<u8>>,
    reply: Option<Vec<u8>>,
}

/// Tokens, and what is kept of requests whose sessions may be gone.
async fn copy_tables(source: &mut Connection, target: &mut Connection) -> Result<(), sqlx::Error> {
    let tokens: Vec<super::TokenRow> = sql(super::tokens::ROWS).all(source).await?;
    for token in &tokens {
        // One that was revoked since is revoked in the target, too.
        super::tokens::insert(token, "on conflict (id) do update set revoked_us = excluded.revoked_us")
            .execute(target)
            .await?;
    }
    let deletions: Vec<(String, String, Vec<u8>)> =
        sql("select session_id, request_id, request_digest from deletions").all(source).await?;
    for (session_id, request_id, digest) in deletions {
        let query = sql("insert into deletions (session_id, request_id, request_digest) values ($1, $2, $3)
             on conflict (session_id, request_id) do nothing");
        query.bind(session_id).bind(request_id).bind(digest).execute(target).await?;
    }
    let creations: Vec<Creation> =
        sql("select request_id, session_id, request_digest, reply from creations").all(source).await?;
    for Creation { request_id, session_id, request_digest, reply } in creations {
        let key = if target.is_shared() { "session_id, request_id" } else { "request_id" };
        sql(format!(
            "insert into creations (request_id, session_id, request_digest, reply) values ($1, $2, $3, $4)
             on conflict ({key}) do nothing"
        ))
        .bind(&request_id)
        .bind(&session_id)
        .bind(request_digest)
        .bind(reply)
        .execute(target)
        .await?;
        if target.is_shared() {
            let query = sql("insert into created_requests (request_id, session_id) values ($1, $2)
                 on conflict (request_id) do nothing");
            query.bind(request_id).bind(session_id).execute(target).await?;
        }
    }
    Ok(())
}

async fn row_of(connection: &mut Connection, session_id: &str) -> Result<Option<SessionRow>, sqlx::Error> {
    let mut query = sql("select ");
    query.push(SESSION_COLUMNS).push(" where session_id = ").push_bind(session_id);
    query.optional(connection).await
}

/// Brings one session to the target, and says how many events it has.
async fn move_session(
    source: &mut Connection,
    target: &mut Connection,
    session_id: &str,
    moved: &mut Migrated,
) -> Result<u64, MigrateError> {
    // It was deleted meanwhile.
    let Some(row) = row_of(source, session_id).await? else { return Ok(0) };
    moved.sessions += 1;
    let there = row_of(target, session_id).await?;
    let events = u64::try_from(row.head).unwrap_or(0);
    let another = || MigrateError::Another(session_id.to_owned());
    let from = match &there {
        None => 0,
        Some(there) if there.created_us != row.created_us || there.head > row.head => return Err(another()),
        Some(there) if there.head == row.head && there.link == row.link => {
            moved.there_already += 1;
            return Ok(events);
        }
        Some(there) => there.head,
    };
    sql("begin").execute(target).await?;
    if there.is_none() {
        insert_session(source, target, &row).await?;
    }
    let (mut last, mut before) = (0, link::first(session_id));
    while last < row.head {
        let page = page(source, session_id, last, COPIED_AT_ONCE.min(row.head - last)).await?;
        if page.is_empty() {
            break;
        }
        for read in page {
            if read.event.seq != last + 1 || !read.is_sound(session_id) {
                let reason = format!("event {} is not as it was appended", last + 1);
                return Err(MigrateError::Damaged { session_id: session_id.to_owned(), reason });
            }
            before = read.event.link(&before);
            last = read.event.seq;
            if last > from {
                insert_event(target, session_id, &before, &read.event).await?;
                moved.events += 1;
            } else if last == from
                && there.as_ref().is_some_and(|there| there.link.as_deref() != Some(&before[..]))
            {
                return Err(another());
            }
        }
    }
    if let Some(reason) = row.damage.clone().or_else(|| row.disagreement(last, &before)) {
        return Err(MigrateError::Damaged { session_id: session_id.to_owned(), reason });
    }
    update_session(&row).execute(target).await?;
    copy_labels(source, target, session_id).await?;
    copy_owner(source, target, session_id).await?;
    copy_reference(source, target, &row).await?;
    sql("commit").execute(target).await?;
    Ok(events)
}

async fn insert_session(
    source: &mut Connection,
    target: &mut Connection,
    row: &SessionRow,
) -> Result<(), sqlx::Error> {
    let experiment = sql("select experiment from sessions where session_id = $1").bind(&row.session_id);
    let experiment: String = experiment.scalar(source).await?.ok_or(sqlx::Error::RowNotFound)?;
    sql("insert into sessions (session_id, experiment, state, created_us, head, summary, link, seal)
         values ($1, $2, $3, $4, $5, $6, $7, $8)")
    .bind(&row.session_id)
    .bind(experiment)
    .bind(row.state)
    .bind(row.created_us)
    .bind(row.head)
    .bind(&row.summary)
    .bind(&row.link)
    .bind(&row.seal)
    .execute(target)
    .await
    .map(drop)
}

fn update_session(row: &SessionRow) -> Statement {
    sql("update sessions set state = $1, head = $2, summary = $3, link = $4, seal = $5 where session_id = $6")
        .bind(row.state)
        .bind(row.head)
        .bind(&row.summary)
        .bind(&row.link)
        .bind(&row.seal)
        .bind(&row.session_id)
}

async fn copy_labels(
    source: &mut Connection,
    target: &mut Connection,
    session_id: &str,
) -> Result<(), sqlx::Error> {
    sql("delete from session_labels where session_id = $1").bind(session_id).execute(target).await?;
    let query = sql("select name, value from session_labels where session_id = $1").bind(session_id);
    for (name, value) in query.all::<(String, String)>(source).await? {
        let query = sql("insert into session_labels (session_id, name, value) values ($1, $2, $3)");
        query.bind(session_id).bind(name).bind(value).execute(target).await?;
    }
    Ok(())
}

async fn copy_owner(
    source: &mut Connection,
    target: &mut Connection,
    session_id: &str,
) -> Result<(), sqlx::Error> {
    let query = sql("select token_id, bytes from session_owners where session_id = $1").bind(session_id);
    if let Some((token_id, bytes)) = query.optional::<(String, i64)>(source).await? {
        let query = sql("insert into session_owners (session_id, token_id, bytes) values ($1, $2, $3)
             on conflict (session_id) do update set bytes = excluded.bytes");
        query.bind(session_id).bind(token_id).bind(bytes).execute(target).await?;
    }
    Ok(())
}

async fn copy_reference(
    source: &mut Connection,
    target: &mut Connection,
    row: &SessionRow,
) -> Result<(), MigrateError> {
    let (session_id, created_us) = (row.session_id.clone(), row.created_us);
    if let Some(reference) = references::whole(source, session_id, created_us).await? {
        references::keep(target, &reference).await.map_err(|failure| match failure {
            Failure::Engine(error) => MigrateError::Query(error),
            Failure::Refused(_) => MigrateError::Another(reference.session_id.clone()),
        })?;
    }
    Ok(())
}
