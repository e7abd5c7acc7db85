//! Queries on the log.

use std::collections::BTreeMap;

use sqlx::{FromRow, QueryBuilder, Sqlite};

use super::{Store, StoreError};

/// A session as `sessions` has it.
#[derive(Clone, Debug, FromRow)]
pub(crate) struct SessionRow {
    pub(crate) session_id: String,
    pub(crate) created_us: i64,
    pub(crate) head: i64,
    pub(crate) summary: Vec<u8>,
}

/// An event as it was appended.
#[derive(Clone, Debug, FromRow)]
pub(crate) struct EventRow {
    pub(crate) seq: i64,
    pub(crate) request_id: Option<String>,
    pub(crate) payload: Vec<u8>,
    pub(crate) reply: Vec<u8>,
    pub(crate) state_hash: String,
    pub(crate) stats_after: Vec<u8>,
    pub(crate) algorithm_version: String,
    pub(crate) append_us: i64,
    pub(crate) actor: String,
}

/// The reply to the first request under a request id.
#[derive(Clone, Debug, FromRow)]
pub(crate) struct FirstReply {
    pub(crate) request_digest: Vec<u8>,
    pub(crate) reply: Vec<u8>,
}

/// Which sessions to list; all that is given must match.
#[derive(Clone, Debug, Default)]
pub(crate) struct Filter {
    pub(crate) experiment: Option<String>,
    pub(crate) state: Option<i32>,
    pub(crate) labels: BTreeMap<String, String>,
}

/// The last session of a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PageEnd {
    pub(crate) created_us: i64,
    pub(crate) session_id: String,
}

const EVENT_COLUMNS: &str =
    "seq, request_id, payload, reply, state_hash, stats_after, algorithm_version, append_us, actor";

impl Store {
    /// One session.
    pub(crate) async fn session(&self, session_id: &str) -> Result<Option<SessionRow>, StoreError> {
        let query = sqlx::query_as(
            "select session_id, created_us, head, summary from sessions where session_id = $1",
        );
        Ok(query.bind(session_id).fetch_optional(&self.readers).await?)
    }

    /// How many sessions there are.
    pub(crate) async fn session_count(&self) -> Result<i64, StoreError> {
        Ok(sqlx::query_scalar("select count(*) from sessions").fetch_one(&self.readers).await?)
    }

    /// Up to `count` sessions after `after`, newest first.
    pub(crate) async fn list(
        &self,
        filter: &Filter,
        after: Option<&PageEnd>,
        count: i64,
    ) -> Result<Vec<SessionRow>, StoreError> {
        let Filter { experiment, state, labels } = filter;
        let mut query = QueryBuilder::<Sqlite>::new(
            "select session_id, created_us, head, summary from sessions where 1 = 1",
        );
        if let Some(experiment) = experiment {
            query.push(" and experiment = ").push_bind(experiment);
        }
        if let Some(state) = state {
            query.push(" and state = ").push_bind(state);
        }
        for (name, value) in labels {
            query.push(" and session_id in (select session_id from session_labels where name = ");
            query.push_bind(name).push(" and value = ").push_bind(value).push(")");
        }
        if let Some(PageEnd { created_us, session_id }) = after {
            query.push(" and (created_us, session_id) < (").push_bind(created_us);
            query.push(", ").push_bind(session_id).push(")");
        }
        query.push(" order by created_us desc, session_id desc limit ").push_bind(count);
        Ok(query.build_query_as().fetch_all(&self.readers).await?)
    }

    /// Up to `count` events with a seq above `after`, oldest first.
    pub(crate) async fn events(
        &self,
        session_id: &str,
        after: i64,
        count: i64,
    ) -> Result<Vec<EventRow>, StoreError> {
        let mut query = QueryBuilder::<Sqlite>::new("select ");
        query.push(EVENT_COLUMNS).push(" from events where session_id = ").push_bind(session_id);
        query.push(" and seq > ").push_bind(after).push(" order by seq limit ").push_bind(count);
        Ok(query.build_query_as().fetch_all(&self.readers).await?)
    }

    /// Up to `count` events with a seq above `after`, oldest first, and of them only the first few that have up
    /// to `bytes` together. The first one comes whatever its size.
    pub(crate) async fn events_within(
        &self,
        session_id: &str,
        after: i64,
        count: i64,
        bytes: usize,
    ) -> Result<Vec<EventRow>, StoreError> {
        // The sizes are in the rows' heads, so what is too large is not read to find that out.
        let mut query = QueryBuilder::<Sqlite>::new(
            "with sized as (select seq, length(payload) + length(reply) as size from events where session_id = ",
        );
        query.push_bind(session_id).push(" and seq > ").push_bind(after);
        query.push(" order by seq limit ").push_bind(count);
        query.push("), summed as (select sum(size) over (order by seq) as total from sized) ");
        query.push("select count(*) from summed where total <= ");
        query.push_bind(i64::try_from(bytes).unwrap_or(i64::MAX));
        let fitting: i64 = query.build_query_scalar().fetch_one(&self.readers).await?;
        self.events(session_id, after, fitting.max(1)).await
    }

    /// The reply to the first request under this id, if there was one.
    pub(crate) async fn first_reply(
        &self,
        session_id: &str,
        request_id: &str,
    ) -> Result<Option<FirstReply>, StoreError> {
        let query = sqlx::query_as(
            "select request_digest, reply from events where session_id = $1 and request_id = $2",
        );
        Ok(query.bind(session_id).bind(request_id).fetch_optional(&self.readers).await?)
    }

    /// The session that a creation made under this request id, if there was one; it may be deleted by now.
    pub(crate) async fn created_by(&self, request_id: &str) -> Result<Option<String>, StoreError> {
        let query = sqlx::query_scalar("select session_id from creations where request_id = $1");
        Ok(query.bind(request_id).fetch_optional(&self.readers).await?)
    }

    /// The digest of the request that deleted the session under this request id, if there was one.
    pub(crate) async fn deleted_by(
        &self,
        session_id: &str,
        request_id: &str,
    ) -> Result<Option<Vec<u8>>, StoreError> {
        let query = sqlx::query_scalar(
            "select request_digest from deletions where session_id = $1 and request_id = $2",
        );
        Ok(query.bind(session_id).bind(request_id).fetch_optional(&self.readers).await?)
    }
}
