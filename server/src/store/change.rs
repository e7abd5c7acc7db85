//! What can be written: sessions, events, deletions, what is known of damage, and reference meshes beside the log.

use std::collections::BTreeMap;

use super::event::Event;
use super::link::Link;
use super::references::{NewErrors, NewReference};

/// A session as it is created.
#[derive(Debug)]
pub(crate) struct NewSession {
    pub(crate) head: SessionHead,
    pub(crate) experiment: String,
    pub(crate) labels: BTreeMap<String, String>,
    /// The request that made it, where that is not the one of its first event.
    pub(crate) imported_by: Option<Import>,
    /// The token that it is counted for.
    pub(crate) owner: Option<String>,
    /// The session whose reference mesh it keeps, too.
    pub(crate) reference_of: Option<String>,
}

/// The request that brought a session from elsewhere, with what it was answered.
#[derive(Debug)]
pub(crate) struct Import {
    pub(crate) request_id: String,
    pub(crate) request_digest: Vec<u8>,
    pub(crate) reply: Vec<u8>,
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
    /// All labels, where the event changed them.
    pub(crate) new_labels: Option<BTreeMap<String, String>>,
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
    /// With its first events, which are one where it is not copied from another session.
    Create(Box<(NewSession, Vec<Event>)>),
    /// Goes after the event with this link.
    Append(Box<(SessionHead, Link, Event)>),
    Delete(Deletion),
    /// The session is set aside.
    SetAside(Damage),
    /// The session is sound after all.
    Restore(String),
    KeepReference(Box<NewReference>),
    /// That of this session.
    ForgetReference(String),
    NoteErrors(NewErrors),
    /// Nothing but a check that something can be written.
    Check,
}

impl Change {
    /// By how many events the log grows.
    pub(super) fn appended(&self) -> i64 {
        match self {
            Self::Create(new) => new.1.len() as i64,
            Self::Append(_) => 1,
            Self::Delete(_)
            | Self::SetAside(_)
            | Self::Restore(_)
            | Self::KeepReference(_)
            | Self::ForgetReference(_)
            | Self::NoteErrors(_)
            | Self::Check => 0,
        }
    }

    /// Whether the database holds more after it.
    pub(super) fn grows(&self) -> bool {
        self.appended() > 0 || matches!(self, Self::KeepReference(_) | Self::NoteErrors(_))
    }
}
