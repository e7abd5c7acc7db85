//! What can be written to the log: sessions, events, deletions, and what is known of damage.

use std::collections::BTreeMap;

use super::link::{self, Content, Link};

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
    /// The link of the event.
    pub(crate) link: Link,
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

impl NewEvent {
    /// Its link after the event with the link `before`.
    pub(crate) fn link(&self, before: &Link) -> Link {
        let Self {
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
        } = self;
        let content = Content {
            seq: *seq,
            request_id: request_id.as_deref(),
            request_digest,
            kind,
            payload,
            reply,
            state_hash,
            stats_after,
            algorithm_version,
            append_us: *append_us,
            actor,
        };
        link::next(before, &content)
    }

    /// What it takes in the log, roughly, in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        (self.payload.len() + self.reply.len() + self.stats_after.len()) as u64
    }
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

/// Why the log of a session cannot be trusted, and from where on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Damage {
    pub(crate) session_id: String,
    /// The last event before the damage; 0 where not even the first is sound.
    pub(crate) sound: i64,
    pub(crate) reason: String,
}

/// One change of the log.
#[derive(Debug)]
pub(super) enum Change {
    Create(Box<(NewSession, NewEvent)>),
    /// Goes after the event with this link.
    Append(Box<(SessionHead, Link, NewEvent)>),
    Delete(Deletion),
    /// The session is set aside.
    SetAside(Damage),
    /// The session is sound after all.
    Restore(String),
    /// Nothing but a check that something can be written.
    Check,
}

impl Change {
    /// Whether the log grows by an event.
    pub(super) fn appends(&self) -> bool {
        match self {
            Self::Create(_) | Self::Append(_) => true,
            Self::Delete(_) | Self::SetAside(_) | Self::Restore(_) | Self::Check => false,
        }
    }
}
