//! The proof of a whole log from its file alone, without a server: for copies of it, and for who looks after it.
//!
//! Each session is read in a transaction of its own, so a server that appends meanwhile is neither disturbed nor taken
//! for damaged.

use super::engine::{Connection, sql};
use super::link;
use super::read::{EVENT_COLUMNS, EventRow, SESSION_COLUMNS, SessionRow, is_unreadable};

/// Events that are read at once.
pub(super) const READ_AT_ONCE: i64 = 16;

/// What the sessions of a log turned out to be.
#[derive(Clone, Debug, Default)]
pub struct Proof {
    /// Sessions in the log.
    pub sessions: u64,
    /// Their events.
    pub events: u64,
    /// When the newest event was appended, in microseconds since 1970, UTC; 0 where there is none.
    pub newest_us: i64,
    /// Sessions that the server has set aside already, with the reason.
    pub quarantined: Vec<(String, String)>,
    /// Other sessions whose log does not prove itself, with what is wrong.
    pub broken: Vec<(String, String)>,
}

/// Reads all sessions to their ends and follows their links; `progress` hears of each session how many events were
/// read until then.
///
/// # Errors
/// The database cannot be read.
pub(super) async fn prove_all(
    connection: &mut Connection,
    progress: &(dyn Fn(u64) + Send + Sync),
) -> Result<Proof, sqlx::Error> {
    let ids: Vec<(String,)> =
        sql("select session_id from sessions order by created_us, session_id").all(connection).await?;
    let mut proof = Proof::default();
    for (session_id,) in ids {
        connection.begin_snapshot().await?;
        prove(connection, &session_id, &mut proof).await?;
        sql("rollback").execute(connection).await?;
        progress(proof.events);
    }
    Ok(proof)
}

async fn prove(connection: &mut Connection, session_id: &str, proof: &mut Proof) -> Result<(), sqlx::Error> {
    let mut query = sql("select ");
    query.push(SESSION_COLUMNS).push(" where session_id = ").push_bind(session_id);
    let row: Option<SessionRow> = query.optional(connection).await?;
    // It was deleted meanwhile.
    let Some(row) = row else { return Ok(()) };
    proof.sessions += 1;
    let (mut last, mut before) = (0, link::first(session_id));
    let mut found = None;
    loop {
        let page = match page(connection, session_id, last, READ_AT_ONCE).await {
            Err(error) if is_unreadable(&error) => page(connection, session_id, last, 1).await,
            other => other,
        };
        let page = match page {
            Ok(page) => page,
            Err(error) if is_unreadable(&error) => {
                found = found.or_else(|| Some(format!("event {} cannot be read: {error}", last + 1)));
                break;
            }
            Err(error) => return Err(error),
        };
        if page.is_empty() {
            break;
        }
        for row in page {
            proof.events += 1;
            proof.newest_us = proof.newest_us.max(row.event.append_us);
            if row.event.seq != last + 1 {
                found = found.or_else(|| Some(format!("event {} is missing", last + 1)));
            } else if !row.is_sound(session_id) {
                found = found.or_else(|| Some(format!("event {} is not as it was appended", row.event.seq)));
            }
            before = row.event.link(&before);
            last = row.event.seq;
        }
    }
    if let Some(damage) = row.damage() {
        proof.quarantined.push((session_id.to_owned(), damage.reason));
        return Ok(());
    }
    let found = found.or_else(|| row.disagreement(last, &before)).or_else(|| {
        row.summary().is_none().then(|| "what lists show of it is not as it was written".to_owned())
    });
    proof.broken.extend(found.map(|reason| (session_id.to_owned(), reason)));
    Ok(())
}

/// Up to `count` events after the event `after`, as they are.
pub(super) async fn page(
    connection: &mut Connection,
    session_id: &str,
    after: i64,
    count: i64,
) -> Result<Vec<EventRow>, sqlx::Error> {
    let mut query = sql("select ");
    query.push(EVENT_COLUMNS).push(" where e.session_id = ").push_bind(session_id);
    query.push(" and e.seq > ").push_bind(after).push(" order by e.seq limit ").push_bind(count);
    query.all(connection).await
}
