//! Links a log of an earlier version: SQLite could not compute the hashes in its migration.

use sqlx::FromRow;

use super::engine::{Connection, sql};
use super::link::{self, Sealed};
use super::proof::page;
use super::read::EventRow;

/// A session without its link.
#[derive(FromRow)]
struct Session {
    session_id: String,
    created_us: i64,
    state: i32,
    head: i64,
    summary: Vec<u8>,
}

/// Links every session that is not, each in a transaction of its own, and says how many there were.
///
/// # Errors
/// The database cannot be read or written.
pub(super) async fn link_all(connection: &mut Connection) -> Result<usize, sqlx::Error> {
    let query = "select session_id, created_us, state, head, summary from sessions where link is null";
    let sessions: Vec<Session> = sql(query).all(connection).await?;
    if !sessions.is_empty() {
        tracing::info!(sessions = sessions.len(), "linking the events of an earlier version's log");
    }
    for session in &sessions {
        sql("begin").execute(connection).await?;
        link_session(connection, session).await?;
        sql("commit").execute(connection).await?;
    }
    Ok(sessions.len())
}

async fn link_session(connection: &mut Connection, session: &Session) -> Result<(), sqlx::Error> {
    let Session { session_id, created_us, state, head, summary } = session;
    let mut before = link::first(session_id);
    let mut last = 0;
    loop {
        let Some(EventRow { event, .. }) = page(connection, session_id, last, 1).await?.pop() else { break };
        before = event.link(&before);
        last = event.seq;
        sql("update events set link = $1 where session_id = $2 and seq = $3")
            .bind(before.as_slice())
            .bind(session_id)
            .bind(last)
            .execute(connection)
            .await?;
    }
    let link = before.as_slice();
    let sealed = Sealed { session_id, created_us: *created_us, state: *state, head: *head, link, summary };
    sql("update sessions set link = $1, seal = $2 where session_id = $3")
        .bind(link)
        .bind(link::seal(&sealed).as_slice())
        .bind(session_id)
        .execute(connection)
        .await?;
    Ok(())
}
