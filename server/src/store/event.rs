//! An event of the log, as it is appended and as it is read.

use sqlx::FromRow;

use super::link::{self, Link};

/// What the log keeps of an event; its link covers all of it.
#[derive(Clone, Debug, FromRow)]
pub(crate) struct Event {
    pub(crate) seq: i64,
    pub(crate) request_id: Option<String>,
    pub(crate) request_digest: Vec<u8>,
    pub(crate) kind: String,
    pub(crate) payload: Vec<u8>,
    pub(crate) reply: Vec<u8>,
    pub(crate) state_hash: String,
    pub(crate) stats_after: Vec<u8>,
    pub(crate) algorithm_version: String,
    pub(crate) append_us: i64,
    pub(crate) actor: String,
}

impl Event {
    /// Its link after the event with the link `before`.
    pub(crate) fn link(&self, before: &Link) -> Link {
        link::next(before, self)
    }

    /// What it takes in the log, roughly, in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        (self.payload.len() + self.reply.len() + self.stats_after.len()) as u64
    }
}
