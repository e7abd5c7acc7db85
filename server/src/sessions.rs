//! Sessions at work: order, retries, races, replay, and the newest state for readers.
//!
//! A change goes through one gate, in a task of its own so that a caller who leaves breaks nothing:
//!
//! ```text
//! permit -> retry? answer as before -> revision guard -> compute -> append (durable) -> publish -> reply
//!             ^                                                       |
//!             `------- catch up with the log --------------------------' it is not where it was left
//! ```
//!
//! A state is the fold of its log, so nothing here needs saving: what is evicted or lost with the
//! process is computed again, bit for bit, and checkpoints make that quick. What states and bytes mean is not known
//! here.

mod aggregate;
mod checkpoint;
mod copying;
mod creation;
mod deletion;
mod freshness;
mod gate;
mod live;
mod past;
mod proof;
mod replay;
mod retraction;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tracing::Instrument;

use crate::compute::{self, Pool, Queue, Work, on_account};
use crate::error::Error;
use crate::limits::Limits;
use crate::store::{Damage, Event, Link, SessionHead, Store, StoreError};
pub(crate) use aggregate::{
    Aggregate, Computed, Created, Decision, FoldError, Folding, Recompute, StoredEvent,
};
pub(crate) use copying::{Carried, Copy, Original, Takeover};
use live::{Head, Live, LiveSessions, Replayed, Room};
use past::PastStates;
use proof::Proven;
pub(crate) use replay::{Entered, FreshFold};
pub(crate) use retraction::Retractions;

/// How often a change starts again when other processes append to the same session.
const ATTEMPTS: usize = 5;
const RETRY_WRITE_AFTER: Duration = Duration::from_millis(50);

/// All sessions of one database, with states of the type `S`.
#[derive(Debug)]
pub(crate) struct Sessions<S> {
    pub(crate) store: Store,
    pub(crate) pool: Pool,
    folding: Folding<S>,
    limits: Arc<Limits>,
    live: LiveSessions<S>,
    past: PastStates<S>,
    proven: Proven,
    stopping: CancellationToken,
}

/// A request to create a session.
pub(crate) struct Creation<S> {
    /// The wanted id; empty lets the server choose.
    pub(crate) session_id: String,
    pub(crate) request: RequestKey,
    pub(crate) actor: String,
    /// The token that it is counted for.
    pub(crate) owner: Option<String>,
    /// Makes the new session under the id and at the time given.
    pub(crate) create: Create<S>,
}

/// A request to add an event to a session.
pub(crate) struct Change<S> {
    pub(crate) session_id: String,
    pub(crate) request: RequestKey,
    pub(crate) expected_revision: Option<i64>,
    pub(crate) actor: String,
    pub(crate) work: Work,
    /// Computes the event, the state after it and the reply, on the compute pool.
    pub(crate) compute: Compute<S>,
}

type Create<S> = Arc<dyn Fn(&str, i64) -> Result<Created<S>, Error> + Send + Sync>;
type Compute<S> = Arc<dyn Fn(&S) -> Result<Decision<S>, Error> + Send + Sync>;
/// The newest state of a session, and each one after it.
pub(crate) type States<S> = watch::Receiver<Arc<S>>;

/// Distinguishes a retry from a new request.
#[derive(Clone, Debug)]
pub(crate) struct RequestKey {
    /// Empty means that the caller does without protection.
    pub(crate) id: String,
    /// Digest of the request's body.
    pub(crate) digest: Vec<u8>,
}

/// The bytes of a reply.
#[derive(Debug)]
pub(crate) struct Reply {
    pub(crate) bytes: Vec<u8>,
    /// Whether the request had been carried out before.
    pub(crate) duplicate: bool,
}

impl<S: Aggregate> Sessions<S> {
    /// Sessions whose states `folding` makes of their logs.
    pub(crate) fn new(
        store: Store,
        pool: Pool,
        folding: Folding<S>,
        limits: Arc<Limits>,
        stopping: CancellationToken,
    ) -> Self {
        let room = Room { sessions: limits.live_sessions, bytes: limits.live_bytes, size: S::bytes };
        let live = LiveSessions::new(room, limits.session_queue);
        let past = PastStates::new(limits.past_states);
        Self { store, pool, folding, limits, live, past, proven: Proven::default(), stopping }
    }

    /// Drops sessions from memory that nobody has asked for in a while, until the server stops. The next one who asks
    /// has them opened from their logs.
    pub(crate) async fn forget_idle(self: Arc<Self>) {
        let mut rounds = tokio::time::interval(self.limits.session_idle / 4);
        while self.stopping.run_until_cancelled(rounds.tick()).await.is_some() {
            self.live.forget_idle(self.limits.session_idle);
        }
    }

    /// How many sessions are in memory.
    pub(crate) fn live_count(&self) -> usize {
        self.live.len()
    }

    /// Creates a session.
    ///
    /// # Errors
    /// The id is taken, the database is full, or the definition is refused.
    pub(crate) async fn create(self: &Arc<Self>, creation: Creation<S>) -> Result<Reply, Error> {
        let this = self.clone();
        detached(async move { this.create_now(&creation).await }).await
    }

    /// Adds an event to a session.
    ///
    /// # Errors
    /// No such session, a stale revision, a reused request id, or the method refuses the evidence.
    pub(crate) async fn change(
        self: &Arc<Self>,
        change: Change<S>,
        deadline: Instant,
    ) -> Result<Reply, Error> {
        let this = self.clone();
        detached(async move { this.change_in_order(&change, deadline).await }).await
    }

    /// Removes a session with all its events. `wanted_etag` may be empty.
    ///
    /// # Errors
    /// No such session, or its etag is another one.
    pub(crate) async fn delete(
        self: &Arc<Self>,
        session_id: String,
        wanted_etag: String,
        request: RequestKey,
        deadline: Instant,
    ) -> Result<(), Error> {
        let this = self.clone();
        detached(async move { this.delete_in_order(&session_id, &wanted_etag, &request, deadline).await })
            .await
    }

    /// The newest state.
    ///
    /// # Errors
    /// No such session, or its log could not be read in time.
    pub(crate) async fn newest(
        self: &Arc<Self>,
        session_id: &str,
        deadline: Instant,
    ) -> Result<Arc<S>, Error> {
        Ok(self.open(session_id, Queue::ROBOTS, deadline).await?.1.borrow().clone())
    }

    /// The newest state, if it is in memory.
    pub(crate) fn loaded(&self, session_id: &str) -> Option<Arc<S>> {
        self.live.loaded(session_id)
    }

    /// The newest state and each one after it. Ends when the session is removed.
    ///
    /// # Errors
    /// No such session, or its log could not be read in time.
    pub(crate) async fn subscribe(
        self: &Arc<Self>,
        session_id: &str,
        deadline: Instant,
    ) -> Result<States<S>, Error> {
        Ok(self.open(session_id, Queue::WATCHERS, deadline).await?.1)
    }

    /// The state at any revision; 0 is the newest. What has to be computed waits in `queue`.
    ///
    /// # Errors
    /// No such session or revision, or its log could not be read in time.
    pub(crate) async fn at_revision(
        self: &Arc<Self>,
        session_id: &str,
        revision: i64,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Arc<S>, Error> {
        let (live, states) = self.open(session_id, queue, deadline).await?;
        let mut newest = states.borrow().clone();
        if revision > newest.revision() {
            // Another server may have appended it a moment ago.
            self.refresh(session_id, &live, Instant::now(), deadline).await?;
            newest = states.borrow().clone();
        }
        let head = newest.revision();
        if revision == 0 || revision == head {
            return Ok(newest);
        }
        if revision > head {
            newest.check_open()?;
        }
        if !(1..=head).contains(&revision) {
            let description = format!("{revision} is not between 1 and the session's revision {head}");
            return Err(Error::field("revision", description));
        }
        self.past_state(live, newest, revision, queue, deadline).await
    }

    async fn change_in_order(
        self: &Arc<Self>,
        change: &Change<S>,
        deadline: Instant,
    ) -> Result<Reply, Error> {
        let Change { session_id, request, actor, work, .. } = change;
        self.refuse_while_stopping()?;
        for _ in 0..ATTEMPTS {
            let (live, states) = self.open(session_id, Queue::ROBOTS, deadline).await?;
            let _permit = live.permit(deadline).await?;
            if live.is_gone() {
                continue;
            }
            if let Some(first) = self.first_reply(session_id, request).await? {
                return Ok(first);
            }
            let before = states.borrow().clone();
            let (event, computed) = match self.compute(&before, change, deadline).await {
                Ok(Decision::Append(event, computed)) => (event, computed),
                Ok(Decision::Retract(seq, compute)) => self.retract(&before, seq, compute).await?,
                Ok(Decision::Answer(bytes)) => return Ok(Reply { bytes, duplicate: false }),
                // A refusal must rest on the newest state, and another process may have written since.
                Err(refusal)
                    if !refusal.is_about_time()
                        && before.check_open().is_ok()
                        && self.is_behind(&*before).await? =>
                {
                    self.catch_up(session_id, &live, deadline).await?;
                    continue;
                }
                Err(refusal) => return Err(refusal),
            };
            let end = live.head().unwrap_or_else(|| Head::empty(session_id));
            let (after, head, new) = recorded(computed, request, event, actor, &end.link);
            let grown = Head { link: head.link, bytes: end.bytes + new.bytes() };
            if grown.bytes > self.limits.session_bytes {
                return Err(self.session_is_full());
            }
            let reply = new.reply.clone();
            let computed_at = Instant::now();
            match self.store.append(head, end.link, new).await {
                Ok(()) => {
                    self.pool.answered(*work, computed_at.elapsed());
                    self.keep_checkpoint(&before, &after);
                    live.publish(Replayed { state: Arc::new(after), head: grown });
                    return Ok(Reply { bytes: reply, duplicate: false });
                }
                Err(StoreError::Conflict) => self.catch_up(session_id, &live, deadline).await?,
                Err(failure) => return Err(failure.into()),
            }
        }
        Err(contended())
    }

    async fn compute(
        &self,
        before: &Arc<S>,
        change: &Change<S>,
        deadline: Instant,
    ) -> Result<Decision<S>, Error> {
        let actual = before.revision();
        if let Some(expected) = change.expected_revision.filter(|&expected| expected != actual) {
            return Err(Error::RevisionMismatch { expected, actual });
        }
        before.check_open()?;
        let (before, compute) = (before.clone(), change.compute.clone());
        self.pool
            .run(Queue::ROBOTS, change.work, &change.session_id, deadline, move || compute(&before))
            .await?
    }

    /// The reply to an earlier request with the same id, which must have had the same body.
    async fn first_reply(&self, session_id: &str, request: &RequestKey) -> Result<Option<Reply>, Error> {
        if request.id.is_empty() {
            return Ok(None);
        }
        let first = self.store.first_under(session_id, &request.id).await?;
        first.map(|first| answered_before(request, &first.request_digest, first.reply)).transpose()
    }

    /// The session in memory, replayed from its log if it was not there. The replay goes on when its caller stops
    /// waiting, so that a session opens in the end however short the deadlines are.
    async fn open(
        self: &Arc<Self>,
        session_id: &str,
        queue: Queue,
        deadline: Instant,
    ) -> Result<(Arc<Live<S>>, States<S>), Error> {
        let live = self.live.get(session_id);
        if let Some(states) = live.states() {
            let now = Instant::now();
            let since = now.checked_sub(self.limits.staleness).unwrap_or(now);
            self.refresh(session_id, &live, since, deadline).await?;
            return Ok((live, states));
        }
        let (this, loading, id) = (self.clone(), live.clone(), session_id.to_owned());
        let load = detached(async move {
            let until = Instant::now() + this.limits.recompute_timeout;
            let loaded = loading.load(|| this.replay(&id, None, i64::MAX, queue, until)).await;
            if loaded.is_err() {
                this.live.forget(&id, &loading);
            }
            loaded
        });
        let states = tokio::time::timeout_at(deadline, load).await.unwrap_or(Err(Error::DeadlineExceeded))?;
        Ok((live, states))
    }

    fn session_is_full(&self) -> Error {
        let hint = "go on in a new session, with smaller or fewer clouds";
        Error::Quota { what: "bytes of the session's log", limit: self.limits.session_bytes, hint }
    }

    fn refuse_while_stopping(&self) -> Result<(), Error> {
        if self.stopping.is_cancelled() { Err(Error::Draining) } else { Ok(()) }
    }
}

/// The reply to the first request under an id, which must have had the same body.
fn answered_before(request: &RequestKey, digest: &[u8], reply: Vec<u8>) -> Result<Reply, Error> {
    if digest == request.digest {
        Ok(Reply { bytes: reply, duplicate: true })
    } else {
        Err(Error::RequestIdReused { request_id: request.id.clone() })
    }
}

/// Runs to its end even when the caller stops waiting.
async fn detached<T: Send + 'static>(
    work: impl Future<Output = Result<T, Error>> + Send + 'static,
) -> Result<T, Error> {
    let task = tokio::spawn(on_account(compute::account(), work).in_current_span());
    task.await.unwrap_or_else(|failure| Err(Error::internal(format!("a change failed: {failure}"))))
}

/// What was computed, taken apart: the new state, what lists say of it, and the event to append.
fn recorded<S: Aggregate>(
    computed: Computed<S>,
    request: &RequestKey,
    (kind, payload): StoredEvent,
    actor: &str,
    before: &Link,
) -> (S, SessionHead, Event) {
    let Computed { after, state, summary, reply, stats_after, state_hash, append_us, new_labels } = computed;
    let (session_id, created_us) = after.identity();
    let (session_id, created_us) = (session_id.to_owned(), created_us);
    let event = Event {
        seq: after.revision(),
        request_id: (!request.id.is_empty()).then(|| request.id.clone()),
        request_digest: request.digest.clone(),
        kind: kind.to_owned(),
        payload,
        reply,
        state_hash,
        stats_after,
        algorithm_version: S::algorithm_version().to_owned(),
        append_us,
        actor: actor.to_owned(),
    };
    let link = event.link(before);
    let head = SessionHead { session_id, created_us, state, summary, link, new_labels };
    (after, head, event)
}

impl From<StoreError> for Error {
    /// How a failure of the log reaches the caller; conflicts are dealt with before.
    fn from(failure: StoreError) -> Self {
        match failure {
            StoreError::QueueFull => Self::QueueFull { queue: "write", retry_after: RETRY_WRITE_AFTER },
            StoreError::Conflict => contended(),
            StoreError::Full => Self::StoreFull,
            StoreError::TooLarge { most_bytes } => Self::Quota {
                what: "bytes of the database",
                limit: most_bytes,
                hint: "delete sessions that are no longer needed, or raise the limit",
            },
            StoreError::Share { what, most } => Self::Quota {
                what,
                limit: most,
                hint: "delete those that are no longer needed, or ask who runs the server for a larger share",
            },
            StoreError::Damaged(Damage { session_id, sound, reason }) => {
                Self::SessionQuarantined { session_id, sound, reason }
            }
            StoreError::Down(detail) => Self::StoreDown { detail },
        }
    }
}

fn contended() -> Error {
    Error::QueueFull { queue: "session", retry_after: RETRY_WRITE_AFTER }
}
