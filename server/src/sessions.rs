//! Sessions at work: order, retries, races, replay, and snapshots for readers.
//!
//! A change goes through one gate, in a task of its own so that a caller who leaves breaks nothing:
//!
//! ```text
//! turn -> retry? answer as before -> revision guard -> compute -> append (durable) -> publish -> reply
//!           ^                                                       |
//!           `------- catch up with the log: another process --------' seq is taken
//! ```
//!
//! State is the fold of the log, so nothing here needs saving: what is evicted or lost with the
//! process is computed again, bit for bit.

mod creation;
mod deletion;
mod live;
mod past;
mod replay;

use std::sync::Arc;
use std::time::Duration;

use palpate_core::reconstruction::ALGORITHM_VERSION;
use prost::Message;
use tokio::sync::watch;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tracing::Instrument;

use crate::compute::Pool;
use crate::error::Error;
use crate::limits::Limits;
use crate::session::{Life, Snapshot};
use crate::store::{NewEvent, SessionHead, Store, StoreError};
use crate::wire::to_proto;
use live::{Live, LiveSessions};
use past::PastStates;

/// How often a change starts again when other processes append to the same session.
const ATTEMPTS: usize = 5;
const RETRY_WRITE_AFTER: Duration = Duration::from_millis(50);

/// All sessions of one database.
#[derive(Debug)]
pub(crate) struct Sessions {
    pub(crate) store: Store,
    pub(crate) pool: Pool,
    limits: Arc<Limits>,
    live: LiveSessions,
    past: PastStates,
    stopping: CancellationToken,
}

/// A request to create a session.
pub(crate) struct Creation {
    /// The wanted id; empty lets the server choose.
    pub(crate) session_id: String,
    pub(crate) request: RequestKey,
    pub(crate) actor: String,
    /// The new session under the id and at the time given, with its event.
    pub(crate) define: Define,
}

/// A request to add an event to a session.
pub(crate) struct Change {
    pub(crate) session_id: String,
    pub(crate) request: RequestKey,
    pub(crate) expected_revision: Option<i64>,
    pub(crate) actor: String,
    pub(crate) event: StoredEvent,
    /// What the event does to the session, and what the caller is told. Runs on the compute pool.
    pub(crate) step: TakeStep,
}

type Define = Arc<dyn Fn(&str, i64) -> Result<(Snapshot, StoredEvent), Error> + Send + Sync>;
type TakeStep = Arc<dyn Fn(&Snapshot) -> Result<Step, Error> + Send + Sync>;

/// An event's name and bytes.
pub(crate) type StoredEvent = (&'static str, Vec<u8>);

/// The session after a change, and the reply to whoever asked for it.
pub(crate) struct Step {
    pub(crate) after: Snapshot,
    pub(crate) reply: Vec<u8>,
}

/// What tells a retry from a new request.
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

impl Sessions {
    pub(crate) fn new(store: Store, pool: Pool, limits: Arc<Limits>, stopping: CancellationToken) -> Self {
        let live = LiveSessions::new(limits.live_sessions, limits.session_queue);
        let past = PastStates::new(limits.past_states);
        Self { store, pool, limits, live, past, stopping }
    }

    /// Creates a session, and answers with the bytes of its message.
    ///
    /// # Errors
    /// The id is taken, the database is full, or the definition is refused.
    pub(crate) async fn create(self: &Arc<Self>, creation: Creation) -> Result<Reply, Error> {
        let this = self.clone();
        detached(async move { this.create_now(&creation).await }).await
    }

    /// Adds an event to a session.
    ///
    /// # Errors
    /// No such session, a stale revision, a reused request id, or the method refuses the evidence.
    pub(crate) async fn change(self: &Arc<Self>, change: Change, deadline: Instant) -> Result<Reply, Error> {
        let this = self.clone();
        detached(async move { this.change_in_turn(&change, deadline).await }).await
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
        detached(async move { this.delete_in_turn(&session_id, &wanted_etag, &request, deadline).await })
            .await
    }

    /// The newest snapshot.
    ///
    /// # Errors
    /// No such session, or its log could not be read in time.
    pub(crate) async fn snapshot(&self, session_id: &str, deadline: Instant) -> Result<Arc<Snapshot>, Error> {
        Ok(self.open(session_id, deadline).await?.1.borrow().clone())
    }

    /// The newest snapshot, if it is in memory.
    pub(crate) fn loaded(&self, session_id: &str) -> Option<Arc<Snapshot>> {
        self.live.loaded(session_id)
    }

    /// The newest snapshot and each one after it. Ends when the session is removed.
    ///
    /// # Errors
    /// No such session, or its log could not be read in time.
    pub(crate) async fn subscribe(
        &self,
        session_id: &str,
        deadline: Instant,
    ) -> Result<watch::Receiver<Arc<Snapshot>>, Error> {
        Ok(self.open(session_id, deadline).await?.1)
    }

    /// The snapshot of any revision; 0 is the newest.
    ///
    /// # Errors
    /// No such session or revision, or its log could not be read in time.
    pub(crate) async fn at_revision(
        &self,
        session_id: &str,
        revision: i64,
        deadline: Instant,
    ) -> Result<Arc<Snapshot>, Error> {
        let newest = self.snapshot(session_id, deadline).await?;
        if revision == 0 || revision == newest.revision {
            return Ok(newest);
        }
        if !(1..=newest.revision).contains(&revision) {
            let description =
                format!("{revision} is not between 1 and the session's revision {}", newest.revision);
            return Err(Error::field("revision", description));
        }
        let nearest = self.past.nearest(&newest.definition, revision);
        let snapshot = self.replay(session_id, nearest, revision, deadline).await?;
        self.past.keep(snapshot.clone());
        Ok(snapshot)
    }

    async fn change_in_turn(&self, change: &Change, deadline: Instant) -> Result<Reply, Error> {
        let Change { session_id, request, expected_revision, actor, event, step } = change;
        self.refuse_while_stopping()?;
        for _ in 0..ATTEMPTS {
            let (live, snapshots) = self.open(session_id, deadline).await?;
            let _turn = live.turn(deadline).await?;
            if live.is_gone() {
                continue;
            }
            if let Some(first) = self.first_reply(session_id, request).await? {
                return Ok(first);
            }
            let before = snapshots.borrow().clone();
            let computed = self.compute(&before, *expected_revision, step, deadline).await;
            let Step { after, reply } = match computed {
                Ok(step) => step,
                // A refusal must rest on the newest state, and another process may have written since.
                Err(_) if self.is_behind(&before).await? => {
                    self.catch_up(session_id, &live, deadline).await?;
                    continue;
                }
                Err(refusal) => return Err(refusal),
            };
            let new = new_event(&after, request, event.clone(), reply.clone(), actor);
            match self.store.append(head(&after), new).await {
                Ok(()) => {
                    live.publish(after);
                    return Ok(Reply { bytes: reply, duplicate: false });
                }
                Err(StoreError::Conflict) => self.catch_up(session_id, &live, deadline).await?,
                Err(failure) => return Err(down(failure)),
            }
        }
        Err(contended())
    }

    async fn compute(
        &self,
        before: &Arc<Snapshot>,
        expected_revision: Option<i64>,
        step: &TakeStep,
        deadline: Instant,
    ) -> Result<Step, Error> {
        check_open(before, expected_revision)?;
        let (before, step) = (before.clone(), step.clone());
        self.pool.run(deadline, move || step(&before)).await?
    }

    /// The reply to an earlier request with the same id, which must have had the same body.
    async fn first_reply(&self, session_id: &str, request: &RequestKey) -> Result<Option<Reply>, Error> {
        if request.id.is_empty() {
            return Ok(None);
        }
        match self.store.first_reply(session_id, &request.id).await.map_err(down)? {
            None => Ok(None),
            Some(first) if first.request_digest == request.digest => {
                Ok(Some(Reply { bytes: first.reply, duplicate: true }))
            }
            Some(_) => Err(Error::RequestIdReused { request_id: request.id.clone() }),
        }
    }

    /// The session in memory, replayed from its log if it was not there.
    async fn open(
        &self,
        session_id: &str,
        deadline: Instant,
    ) -> Result<(Arc<Live>, watch::Receiver<Arc<Snapshot>>), Error> {
        let live = self.live.get(session_id);
        match live.load(|| self.replay(session_id, None, i64::MAX, deadline)).await {
            Ok(snapshots) => Ok((live, snapshots)),
            Err(error) => {
                self.live.forget(session_id, &live);
                Err(error)
            }
        }
    }

    fn refuse_while_stopping(&self) -> Result<(), Error> {
        if self.stopping.is_cancelled() { Err(Error::Draining) } else { Ok(()) }
    }
}

/// Runs to its end even when the caller stops waiting.
async fn detached<T: Send + 'static>(
    work: impl Future<Output = Result<T, Error>> + Send + 'static,
) -> Result<T, Error> {
    let task = tokio::spawn(work.in_current_span());
    task.await.unwrap_or_else(|failure| Err(Error::internal(format!("a change failed: {failure}"))))
}

fn check_open(snapshot: &Snapshot, expected_revision: Option<i64>) -> Result<(), Error> {
    match expected_revision {
        Some(expected) if expected != snapshot.revision => {
            return Err(Error::RevisionMismatch { expected, actual: snapshot.revision });
        }
        _ => {}
    }
    match snapshot.life {
        Life::AwaitingPrior | Life::Active => Ok(()),
        Life::Quarantined => {
            let session_id = snapshot.definition.session_id.clone();
            Err(Error::SessionQuarantined { session_id })
        }
    }
}

fn head(snapshot: &Snapshot) -> SessionHead {
    SessionHead {
        session_id: snapshot.definition.session_id.clone(),
        created_us: snapshot.definition.created_us,
        state: to_proto::state(snapshot.life).into(),
        summary: to_proto::session(snapshot).encode_to_vec(),
    }
}

fn new_event(
    after: &Snapshot,
    request: &RequestKey,
    (kind, payload): StoredEvent,
    reply: Vec<u8>,
    actor: &str,
) -> NewEvent {
    NewEvent {
        seq: after.revision,
        request_id: (!request.id.is_empty()).then(|| request.id.clone()),
        request_digest: request.digest.clone(),
        kind,
        payload,
        reply,
        state_hash: after.state_hash(),
        stats_after: to_proto::stats(&after.stats, after.last_update).encode_to_vec(),
        algorithm_version: ALGORITHM_VERSION,
        append_us: after.updated_us,
        actor: actor.to_owned(),
    }
}

/// What a caller is told of the log's failures; conflicts are dealt with before.
pub(crate) fn down(failure: StoreError) -> Error {
    match failure {
        StoreError::QueueFull => Error::QueueFull { queue: "write", retry_after: RETRY_WRITE_AFTER },
        StoreError::Conflict => contended(),
        StoreError::Down(detail) => Error::StoreDown { detail },
    }
}

fn contended() -> Error {
    Error::QueueFull { queue: "session", retry_after: RETRY_WRITE_AFTER }
}
