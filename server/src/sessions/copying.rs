//! Sessions that are made of the events of another one, here or elsewhere.
//!
//! ```text
//! fork:   creation of the copy, then each event of the original computed anew --> one change of the log
//! import: each event as it was, folded to see that it gives the recorded states --> one change of the log
//! ```
//! A stored reply names the session that it was made for, so a fork makes its replies anew.

use std::sync::Arc;

use tokio::time::Instant;

use super::checkpoint::kept_after;
use super::creation::chosen_id;
use super::live::{Head, Replayed};
use super::replay::{Folded, Manner, fold_page};
use super::retraction::Retractions;
use super::{
    Aggregate, Computed, Created, Creation, Reply, RequestKey, Sessions, StoredEvent, contended, detached,
    recorded,
};
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::session::now_us;
use crate::store::{Event, Import, Kept, Link, NewSession, SessionHead, StoreError, first_link};

/// Events that are computed anew in one job: whoever comes waits for that long behind a long log.
const PAGE: i64 = 4;

/// A session to make of the events of another one.
pub(crate) struct Copy<S> {
    /// Makes its first event.
    pub(crate) creation: Creation<S>,
    /// Where the events after the first come from.
    pub(crate) original: Original,
    /// Computes what an event of the original comes to in the copy.
    pub(crate) carry: Carry<S>,
    /// The reply to the caller, of the copy as it ends.
    pub(crate) reply: fn(&S) -> Vec<u8>,
}

/// Where the events of a copy come from.
pub(crate) enum Original {
    /// A session of this log, up to a revision.
    Session(String, i64),
    /// The events of a session elsewhere, from the first on.
    Events(Vec<Event>),
}

/// What an event of the original comes to after the state before it, which is without what a retraction retracts.
pub(crate) type Carry<S> = Arc<dyn Fn(&S, &Event) -> Result<Carried<S>, Error> + Send + Sync>;

/// An event of a copy.
pub(crate) type Carried<S> = (StoredEvent, Computed<S>);

/// A session to take over as it was elsewhere, byte for byte.
pub(crate) struct Takeover<S> {
    pub(crate) session_id: String,
    pub(crate) request: RequestKey,
    pub(crate) events: Vec<Event>,
    /// The token that it is counted for.
    pub(crate) owner: Option<String>,
    /// What lists show of the session as it ends, and the reply to the caller.
    pub(crate) describe: fn(S) -> Created<S>,
}

impl<S: Aggregate + Clone> Sessions<S> {
    /// Makes a session of the events of another one. It goes on when the caller stops waiting: a retry then finds it.
    ///
    /// # Errors
    /// The id is taken, the database is full, there is no such original, or one of its events cannot be carried over.
    pub(crate) async fn copy(self: &Arc<Self>, copy: Copy<S>) -> Result<Reply, Error> {
        let this = self.clone();
        detached(async move { this.copy_now(copy).await }).await
    }

    /// Takes a session over as it was elsewhere.
    ///
    /// # Errors
    /// The id is taken, the database is full, or the events do not give the states that they recorded.
    pub(crate) async fn take_over(self: &Arc<Self>, takeover: Takeover<S>) -> Result<Reply, Error> {
        let this = self.clone();
        detached(async move { this.take_over_now(takeover).await }).await
    }

    async fn copy_now(&self, copy: Copy<S>) -> Result<Reply, Error> {
        let Copy { creation, mut original, carry, reply } = copy;
        let Creation { session_id: wanted, request, actor, owner, create } = creation;
        self.refuse_while_stopping()?;
        let session_id = chosen_id(&wanted, &request);
        if let Some(first) = self.first_creation(&wanted, &session_id, &request).await? {
            return Ok(first);
        }
        self.check_quota().await?;
        if self.store.session(&session_id).await?.is_some() {
            return Err(Error::SessionExists { session_id });
        }
        let Created { event, computed, experiment, labels } = create(&session_id, now_us())?;
        let link = first_link(&session_id);
        let (mut state, mut head, first) = recorded(computed, &request, event, &actor, &link);
        let mut events = vec![first];
        let mut kept = Vec::new();
        let deadline = Instant::now() + self.limits.recompute_timeout;
        while let Some(page) = self.next_page(&mut original, events.len() as i64).await? {
            for rows in page.chunk_by(|before, row| !self.is_retraction(before) && !self.is_retraction(row)) {
                if rows.iter().any(|row| self.is_retraction(row)) {
                    state = self.without_retracted(&session_id, &events, &rows[0], deadline).await?;
                }
                let (carry, rows) = (carry.clone(), rows.to_vec());
                let compute = move || carry_all(&carry, state, &rows);
                let carried =
                    self.pool.run(Queue::READERS, Work::Fold, &session_id, deadline, compute).await??;
                events.extend(carried.events);
                kept.extend(carried.kept);
                (state, head) = (carried.state, carried.head.unwrap_or(head));
            }
            self.check_size(&events)?;
        }
        events[0].reply = reply(&state);
        let reply = events[0].reply.clone();
        head.link = last_link(&session_id, &events);
        let reference_of = match original {
            Original::Session(session_id, _) => Some(session_id),
            Original::Events(_) => None,
        };
        let session = NewSession { head, experiment, labels, imported_by: None, owner, reference_of };
        let copied = Copied { session, events, state, kept };
        self.write_copy(copied, &wanted, &request, reply).await
    }

    async fn take_over_now(&self, takeover: Takeover<S>) -> Result<Reply, Error> {
        let Takeover { session_id, request, events, owner, describe } = takeover;
        self.refuse_while_stopping()?;
        if let Some(first) = self.first_creation(&session_id, &session_id, &request).await? {
            return Ok(first);
        }
        self.check_quota().await?;
        if self.store.session(&session_id).await?.is_some() {
            return Err(Error::SessionExists { session_id });
        }
        self.check_size(&events)?;
        let retractions = Retractions::among(&events, self.folding.retracts);
        let deadline = Instant::now() + self.limits.recompute_timeout;
        let (state, kept) = self.fold_all(&session_id, &events, &retractions, deadline).await?;
        let Created { event: _, computed, experiment, labels } = describe((*state).clone());
        let (state, mut head, described) =
            recorded(computed, &request, ("", Vec::new()), "", &first_link(&session_id));
        head.link = last_link(&session_id, &events);
        let RequestKey { id: request_id, digest: request_digest } = request.clone();
        let imported_by = Some(Import { request_id, request_digest, reply: described.reply.clone() });
        let session = NewSession { head, experiment, labels, imported_by, owner, reference_of: None };
        let copied = Copied { session, events, state, kept };
        self.write_copy(copied, &session_id, &request, described.reply).await
    }

    /// Writes all of a copy at once, and keeps its state in memory.
    async fn write_copy(
        &self,
        copied: Copied<S>,
        wanted: &str,
        request: &RequestKey,
        reply: Vec<u8>,
    ) -> Result<Reply, Error> {
        let Copied { session, events, state, kept } = copied;
        let session_id = session.head.session_id.clone();
        let head = Head { link: session.head.link, bytes: events.iter().map(Event::bytes).sum() };
        match self.store.create(session, events).await {
            Ok(()) => {
                for kept in kept {
                    self.store.checkpoints.keep(state.identity(), kept);
                }
                let replayed = Replayed { state: Arc::new(state), head };
                self.live.get(&session_id).load(async || Ok(replayed)).await?;
                Ok(Reply { bytes: reply, duplicate: false })
            }
            Err(StoreError::Conflict) if self.store.session(&session_id).await?.is_some() => {
                // The same request may have won the race against itself.
                let first = self.first_creation(wanted, &session_id, request).await?;
                first.ok_or(Error::SessionExists { session_id })
            }
            Err(StoreError::Conflict) => Err(contended()),
            Err(failure) => Err(failure.into()),
        }
    }

    fn is_retraction(&self, row: &Event) -> bool {
        (self.folding.retracts)(row).is_some()
    }

    /// The state that the events of a copy give once `retraction` counts as well.
    async fn without_retracted(
        &self,
        session_id: &str,
        events: &[Event],
        retraction: &Event,
        deadline: Instant,
    ) -> Result<S, Error> {
        let retracts = self.folding.retracts;
        let mut retractions = Retractions::among(events, retracts);
        if let Some(seq) = retracts(retraction) {
            retractions = retractions.and(retraction.seq, seq);
        }
        let (folded, _) = self.fold_all(session_id, events, &retractions, deadline).await?;
        Ok((*folded).clone())
    }

    /// The state that all events give together, and each on the way the one that it recorded; with what is kept of them.
    async fn fold_all(
        &self,
        session_id: &str,
        events: &[Event],
        retractions: &Retractions,
        deadline: Instant,
    ) -> Result<(Arc<S>, Vec<Kept>), Error> {
        let mut folded = Folded { state: None, head: Head::empty(session_id), damage: None };
        let mut kept = Vec::new();
        for page in events.chunks(PAGE as usize) {
            let (folding, id, page, left_out) =
                (self.folding, session_id.to_owned(), page.to_vec(), retractions.clone());
            let fold = move || fold_page(folding, &id, folded, &page, &left_out, &Manner::Computing);
            let (reached, new) =
                self.pool.run(Queue::READERS, Work::Fold, session_id, deadline, fold).await?;
            folded = reached;
            kept.extend(new);
            if let Some(damage) = &folded.damage {
                let description = format!("holds a log that cannot be taken over: {}", damage.reason);
                return Err(Error::field("data", description));
            }
        }
        let state = folded.state.ok_or_else(|| Error::field("data", "holds a log without events"))?;
        Ok((state, kept))
    }

    /// The events after the event `after`; nothing where there are no more.
    async fn next_page(&self, original: &mut Original, after: i64) -> Result<Option<Vec<Event>>, Error> {
        let page = match original {
            Original::Session(_, revision) if after >= *revision => Vec::new(),
            Original::Session(session_id, revision) => {
                let count = PAGE.min(*revision - after);
                self.store.events_within(session_id, after, count, self.limits.read_bytes).await?
            }
            Original::Events(events) => {
                let start = (after as usize).min(events.len());
                events[start..(start + PAGE as usize).min(events.len())].to_vec()
            }
        };
        Ok((!page.is_empty()).then_some(page))
    }

    fn check_size(&self, events: &[Event]) -> Result<(), Error> {
        let bytes: u64 = events.iter().map(Event::bytes).sum();
        if bytes > self.limits.session_bytes { Err(self.session_is_full()) } else { Ok(()) }
    }
}

struct CarriedAll<S> {
    state: S,
    head: Option<SessionHead>,
    events: Vec<Event>,
    kept: Vec<Kept>,
}

/// A copy before it is written.
struct Copied<S> {
    session: NewSession,
    events: Vec<Event>,
    state: S,
    kept: Vec<Kept>,
}

fn carry_all<S: Aggregate>(carry: &Carry<S>, mut state: S, rows: &[Event]) -> Result<CarriedAll<S>, Error> {
    let nobody = RequestKey { id: String::new(), digest: Vec::new() };
    let (mut head, mut events, mut kept) = (None, Vec::with_capacity(rows.len()), Vec::new());
    for row in rows {
        let (event, computed) = carry(&state, row)?;
        let (after, new_head, new) = recorded(computed, &nobody, event, &row.actor, &Link::default());
        kept.push(kept_after(Some(&state), &after));
        (state, head) = (after, Some(new_head));
        events.push(new);
    }
    Ok(CarriedAll { state, head, events, kept })
}

fn last_link(session_id: &str, events: &[Event]) -> Link {
    events.iter().fold(first_link(session_id), |before, event| event.link(&before))
}
