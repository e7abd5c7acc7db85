//! Links a log of an earlier version: SQLite could not compute the hashes in its migration.

use sqlx::{Connection, FromRow, QueryBuilder, Sqlite, SqliteConnection};

use super::link::{self, Sealed};
use super::read::{EVENT_COLUMNS, EventRow};

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
pub(super) async fn link_all(connection: &mut SqliteConnection) -> Result<usize, sqlx::Error> {
    let query = "select session_id, created_us, state, head, summary from sessions where link is null";
    let sessions: Vec<Session> = sqlx::query_as(query).fetch_all(&mut *connection).await?;
    if !sessions.is_empty() {
        tracing::info!(sessions = sessions.len(), "linking the events of an earlier version's log");
    }
    for session in &sessions {
        let mut transaction = connection.begin().await?;
        link_session(&mut transaction, session).await?;
        transaction.commit().await?;
    }
    Ok(sessions.len())
}

async fn link_session(connection: &mut SqliteConnection, session: &Session) -> Result<(), sqlx::Error> {
    let Session { session_id, created_us, state, head, summary } = session;
    let mut before = link::first(session_id);
    let mut last = 0;
    loop {
        let mut query = QueryBuilder::<Sqlite>::new("select ");
        query.push(EVENT_COLUMNS).push(" where e.session_id = ").push_bind(session_id);
        query.push(" and e.seq > ").push_bind(last).push(" order by e.seq limit 1");
        let event: Option<EventRow> = query.build_query_as().fetch_optional(&mut *connection).await?;
        let Some(EventRow { event, .. }) = event else { break };
        before = event.link(&before);
        last = event.seq;
        sqlx::query("update events set link = $1 where session_id = $2 and seq = $3")
            .bind(before.as_slice())
            .bind(session_id)
            .bind(last)
            .execute(&mut *connection)
            .await?;
    }
    let link = before.as_slice();
    let sealed = Sealed { session_id, created_us: *created_us, state: *state, head: *head, link, summary };
    sqlx::query("update sessions set link = $1, seal = $2 where session_id = $3")
        .bind(link)
        .bind(link::seal(&sealed).as_slice())
        .bind(session_id)
        .execute(connection)
        .await?;
    Ok(())
}
