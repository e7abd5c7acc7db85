//! Tickets that several servers have to know, beside the log: whoever redeems one takes it out.

use sqlx::FromRow;

use super::StoreError;
use super::engine::{Pool, sql};

/// What a ticket opens, and for whom.
#[derive(Clone, Debug, PartialEq, FromRow)]
pub(crate) struct TicketRow {
    pub(crate) actor: String,
    pub(crate) scope: String,
    pub(crate) experiments: Option<String>,
    /// Empty where there is none.
    pub(crate) token_id: String,
    pub(crate) compute_share: f64,
    /// In microseconds since 1970, UTC.
    pub(crate) until_us: i64,
}

/// The table of tickets.
#[derive(Clone, Debug)]
pub(crate) struct TicketTable {
    writers: Pool,
}

impl TicketTable {
    pub(super) fn new(writers: Pool) -> Self {
        Self { writers }
    }

    /// Keeps a ticket under its digest; false where `most` are out already.
    pub(crate) async fn put(
        &self,
        digest: &[u8],
        row: &TicketRow,
        now_us: i64,
        most: i64,
    ) -> Result<bool, StoreError> {
        let mut connection = self.writers.acquire().await?;
        sql("delete from tickets where until_us <= $1").bind(now_us).execute(&mut connection).await?;
        let out = sql("select count(*) from tickets").scalar::<i64>(&mut connection).await?;
        if out.unwrap_or(0) >= most {
            return Ok(false);
        }
        let TicketRow { actor, scope, experiments, token_id, compute_share, until_us } = row;
        sql("insert into tickets (ticket_sha256, actor, scope, experiments, token_id, compute_share, until_us)
             values ($1, $2, $3, $4, $5, $6, $7)")
        .bind(digest)
        .bind(actor)
        .bind(scope)
        .bind(experiments)
        .bind(token_id)
        .bind(compute_share)
        .bind(until_us)
        .execute(&mut connection)
        .await?;
        Ok(true)
    }

    /// Takes the ticket of this digest out, if it is there.
    pub(crate) async fn take(&self, digest: &[u8]) -> Result<Option<TicketRow>, StoreError> {
        let mut connection = self.writers.acquire().await?;
        let query = sql("delete from tickets where ticket_sha256 = $1
             returning actor, scope, experiments, token_id, compute_share, until_us");
        Ok(query.bind(digest).optional(&mut connection).await?)
    }
}
