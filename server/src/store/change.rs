//! What can be written to the log: sessions, events, deletions, and what is known of damage.

use std::collections::BTreeMap;

use super::event::Event;
use super::link::Link;

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
    Create(Box<(NewSession, Event)>),
    /// Goes after the event with this link.
    Append(Box<(SessionHead, Link, Event)>),
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
