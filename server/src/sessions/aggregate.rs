//! What [`Sessions`](super::Sessions) needs to know of a state, and the bytes that come with one.
//!
//! The service keeps snapshots of reconstructions; the tests of this layer keep a toy. Neither the
//! bytes nor the state behind the trait are looked into.

use crate::error::Error;
use crate::store::Event;

/// The state of one session after one of its events: never changed, shared by readers.
pub(crate) trait Aggregate: Send + Sync + Sized + 'static {
    /// Under which a state hash is computed; hashes of two versions are not compared.
    fn algorithm_version() -> &'static str;

    /// The session's id, and when it was created: together they tell it from an earlier one of the same id.
    fn identity(&self) -> (&str, i64);

    /// The seq of the last event.
    fn revision(&self) -> i64;

    /// What it takes in memory, roughly.
    fn bytes(&self) -> usize;

    /// The digest of the state, as the log has it.
    fn state_hash(&self) -> String;

    /// Whether the session takes events.
    ///
    /// # Errors
    /// Why it does not.
    fn check_open(&self) -> Result<(), Error>;

    /// The same state after an event that is left out, since it was retracted.
    fn without_event(&self, row: &Event) -> Self;

    /// The same state without what a checkpoint gives back: from here on an event costs little, and the state's hash
    /// says nothing.
    fn deferring(&self) -> Self;

    /// What gives this state back to one that [defers](Self::deferring) and has seen the same events.
    fn checkpoint(&self) -> Option<Vec<u8>>;

    /// Whether the state before had the same checkpoint.
    fn shares_checkpoint_with(&self, before: &Self) -> bool;

    /// The state that a checkpoint gives back to this one, which defers; nothing where it cannot be read.
    fn restored(&self, checkpoint: &[u8]) -> Option<Self>;

    /// What readers are shown of this state, where there is anything to show.
    fn shown(&self) -> Option<Vec<u8>>;

    /// The same state, the last sound one of a log that is damaged after it and should go on to `head`.
    fn quarantined(&self, reason: &str, head: i64) -> Self;
}

/// Makes the state after a stored event, which is the creation where there is no state before.
pub(crate) type Fold<S> = fn(Option<&S>, &Event) -> Result<S, FoldError>;

/// How a log becomes a state.
#[derive(Debug)]
pub(crate) struct Folding<S> {
    /// Makes the state after an event.
    pub(crate) fold: Fold<S>,
    /// The event that an event retracts, if it is a retraction.
    pub(crate) retracts: fn(&Event) -> Option<i64>,
    /// The name of retractions in the table.
    pub(crate) retraction: &'static str,
}

impl<S> Clone for Folding<S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<S> Copy for Folding<S> {}

/// Why a stored event cannot be applied; for the log.
#[derive(Debug, thiserror::Error)]
#[error("event {seq}: {reason}")]
pub(crate) struct FoldError {
    pub(crate) seq: i64,
    pub(crate) reason: String,
}

/// An event's name and bytes.
pub(crate) type StoredEvent = (&'static str, Vec<u8>);

/// What a change computed: the state after it, and all that the log keeps beside the event.
pub(crate) struct Computed<S> {
    pub(crate) after: S,
    /// The reply to the caller, also to each retry.
    pub(crate) reply: Vec<u8>,
    /// The number by which lists are filtered.
    pub(crate) state: i32,
    /// The session as lists show it.
    pub(crate) summary: Vec<u8>,
    pub(crate) stats_after: Vec<u8>,
    pub(crate) state_hash: String,
    /// When the event was accepted, in microseconds since 1970, UTC.
    pub(crate) append_us: i64,
    /// All labels, where the event changed them.
    pub(crate) new_labels: Option<std::collections::BTreeMap<String, String>>,
}

/// What a change comes to.
pub(crate) enum Decision<S> {
    /// An event to append, with what it computed.
    Append(StoredEvent, Computed<S>),
    /// A reply to a request that changes nothing after all; it is not kept for retries.
    Answer(Vec<u8>),
    /// An event of the log is retracted: what follows is computed from the state that the log gives without it.
    Retract(i64, Recompute<S>),
}

/// Computes the event that retracts another one, from the state without it.
pub(crate) type Recompute<S> = Box<dyn FnOnce(&S) -> (StoredEvent, Computed<S>) + Send>;

/// A session that is about to be created.
pub(crate) struct Created<S> {
    pub(crate) event: StoredEvent,
    pub(crate) computed: Computed<S>,
    pub(crate) experiment: String,
    pub(crate) labels: std::collections::BTreeMap<String, String>,
}
