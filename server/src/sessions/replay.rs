//! Replay: a session's state computed again from its log, which is trusted as far as its links hold.

use std::sync::Arc;

use tokio::time::Instant;

use super::checkpoint::kept_after;
use super::live::{Head, Live, Replayed};
use super::retraction::Retractions;
use super::{ATTEMPTS, Aggregate, FoldError, Folding, Sessions, contended};
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::store::{Checkpoint, Damage, Event, Kept, SessionRow, StoreError};

/// Events folded in one job: whoever comes waits for that long behind a long log.
const PAGE: i64 = 4;
/// The same where states are left out.
const DEFERRING_PAGE: i64 = 64;

/// How events are folded.
#[derive(Clone, Debug)]
pub(super) enum Manner {
    /// Each state is computed, and compared with what was recorded.
    Computing,
    /// States are left out: a checkpoint gives back the last one.
    Deferring,
    /// The state is given back by a checkpoint, and compared with what was recorded.
    Restoring(Checkpoint),
}

/// Where a fold begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Begin {
    /// Where the latest checkpoint takes it.
    AtCheckpoint,
    /// At the first event, or where it was left.
    AsItIs,
}

/// What is folded, and until when.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) row: &'a SessionRow,
    /// What is left out of its log.
    pub(super) retractions: &'a Retractions,
    pub(super) queue: Queue,
    pub(super) deadline: Instant,
}

/// How far a log could be folded.
pub(super) struct Folded<S> {
    pub(super) state: Option<Arc<S>>,
    pub(super) head: Head,
    pub(super) damage: Option<Damage>,
}

/// A fold of a log, a few events at a time: from its beginning, and then it uses nothing of what is in memory.
#[derive(Debug)]
pub(crate) struct FreshFold<S> {
    reached: Option<Replayed<S>>,
}

impl<S> Default for FreshFold<S> {
    fn default() -> Self {
        Self { reached: None }
    }
}

impl<S> FreshFold<S> {
    /// A fold that goes on from a state in memory. Where its log ends is not known, so it must not be taken to the
    /// newest event.
    pub(crate) fn from(state: Arc<S>, session_id: &str) -> Self {
        Self { reached: Some(Replayed { state, head: Head::empty(session_id) }) }
    }
}

/// The evidence of a log's first events, without their states.
#[derive(Debug)]
pub(crate) struct Entered<S> {
    reached: Option<Replayed<S>>,
}

impl<S> Default for Entered<S> {
    fn default() -> Self {
        Self { reached: None }
    }
}

impl<S: Aggregate> Entered<S> {
    /// From where a fold goes on: from the first event where something that was entered is retracted now.
    fn start(&self, session_id: &str, retractions: &Retractions) -> Folded<S> {
        let usable = self.reached.as_ref().filter(|reached| retractions.agree_at(reached.state.revision()));
        match usable {
            Some(Replayed { state, head }) => {
                Folded { state: Some(state.clone()), head: *head, damage: None }
            }
            None => Folded { state: None, head: Head::empty(session_id), damage: None },
        }
    }
}

impl<S: Aggregate> Sessions<S> {
    /// Goes on with a fold up to the event `to`: the state there, or an earlier and quarantined one where the log is
    /// damaged before.
    ///
    /// # Errors
    /// There is no such session, not even its first event is sound, or the log cannot be read in time.
    pub(crate) async fn fold_afresh(
        &self,
        session_id: &str,
        fold: &mut FreshFold<S>,
        to: i64,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Arc<S>, Error> {
        let from = fold
            .reached
            .as_ref()
            .map(|Replayed { state, head }| Replayed { state: state.clone(), head: *head });
        let reached = self.folded(session_id, from, to, Begin::AsItIs, queue, deadline).await?;
        let state = reached.state.clone();
        fold.reached = Some(reached);
        Ok(state)
    }

    /// The state after the event `to` by its checkpoint alone, without any state before it, so that many are computed at
    /// a time; `entered` holds the evidence of events before it. Nothing where no checkpoint gives it back.
    ///
    /// # Errors
    /// There is no such session, or the log cannot be read in time.
    pub(crate) async fn restored_alone(
        &self,
        session_id: &str,
        entered: &Entered<S>,
        to: i64,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Option<Arc<S>>, Error> {
        let row = self.row(session_id).await?;
        let retractions = self.retractions(session_id, to).await?;
        let task = Task { row: &row, retractions: &retractions, queue, deadline };
        let start = entered.start(session_id, &retractions);
        let before = start.revision();
        let jumped = self.jumped(task, start, to).await?;
        if jumped.revision() == before {
            return Ok(None);
        }
        let folded = self.fold_on(task, jumped, to).await?;
        let is_it = folded.damage.is_none() && folded.revision() == to;
        Ok(folded.state.filter(|_| is_it))
    }

    /// Enters the evidence of the events up to `to`, whose states are left out.
    ///
    /// # Errors
    /// There is no such session, or the log cannot be read in time.
    pub(crate) async fn enter(
        &self,
        session_id: &str,
        entered: Entered<S>,
        to: i64,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Entered<S>, Error> {
        let row = self.row(session_id).await?;
        let retractions = self.retractions(session_id, to).await?;
        let task = Task { row: &row, retractions: &retractions, queue, deadline };
        let start = entered.start(session_id, &retractions);
        let Folded { state, head, .. } = self.fold_pages(task, start, to, Manner::Deferring).await?;
        Ok(Entered { reached: state.map(|state| Replayed { state, head }) })
    }

    /// The state at the revision `to`, or at the last one there is, by way of what is in memory and of checkpoints.
    ///
    /// # Errors
    /// There is no such session, not even its first event is sound, or the log cannot be read in time.
    pub(super) async fn replay(
        &self,
        session_id: &str,
        from: Option<Replayed<S>>,
        to: i64,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Replayed<S>, Error> {
        self.folded(session_id, from, to, Begin::AtCheckpoint, queue, deadline).await
    }

    /// Folds the events after `from` up to the revision `to`, or as many as there are.
    ///
    /// A log that is damaged gives its last sound state, quarantined.
    ///
    /// # Errors
    /// There is no such session, not even its first event is sound, or the log cannot be read in time.
    async fn folded(
        &self,
        session_id: &str,
        from: Option<Replayed<S>>,
        to: i64,
        begin: Begin,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Replayed<S>, Error> {
        for _ in 0..ATTEMPTS {
            let row = self.row(session_id).await?;
            let end = to.min(row.head);
            let retractions = self.retractions(session_id, end).await?;
            // What was retracted since is in the state.
            let from = from.as_ref().filter(|from| retractions.agree_at(from.state.revision()));
            let (state, head) = match from {
                Some(from) => (Some(from.state.clone()), from.head),
                None => (None, Head::empty(session_id)),
            };
            let task = Task { row: &row, retractions: &retractions, queue, deadline };
            let mut start = Folded { state, head, damage: None };
            if begin == Begin::AtCheckpoint {
                start = self.jumped(task, start, end).await?;
            }
            let folded = self.fold_on(task, start, end).await?;
            let Some(damage) = folded.damage else {
                let state = folded.state.ok_or_else(|| not_found(session_id))?;
                if row.damage().is_some() && from.is_none() && to >= row.head {
                    self.store.restore(session_id);
                }
                return Ok(Replayed { state, head: folded.head });
            };
            // A session that was deleted or went on meanwhile is not damaged.
            let now = self.row(session_id).await?;
            if (now.created_us, now.head) == (row.created_us, row.head) {
                return self.set_aside(&row, damage, folded.state, folded.head);
            }
        }
        Err(contended())
    }

    /// Folds the events up to `end`, and sees whether the log ends as its row says.
    pub(super) async fn fold_on(
        &self,
        task: Task<'_>,
        start: Folded<S>,
        end: i64,
    ) -> Result<Folded<S>, Error> {
        let mut folded = self.fold_pages(task, start, end, Manner::Computing).await?;
        let (row, last) = (task.row, folded.revision());
        if folded.damage.is_some() || (end < row.head && last == end) {
            return Ok(folded);
        }
        let is_another = |state: &Arc<S>| state.identity().1 != row.created_us;
        let disagreement = row.disagreement(last, &folded.head.link).or_else(|| {
            folded.state.as_ref().is_some_and(is_another).then(|| "was created at another time".to_owned())
        });
        let damage = |reason| Damage { session_id: row.session_id.clone(), sound: last, reason };
        folded.damage = disagreement.map(damage);
        Ok(folded)
    }

    /// Folds the events up to `end` in one manner, or as many as there are and are sound.
    pub(super) async fn fold_pages(
        &self,
        task: Task<'_>,
        start: Folded<S>,
        end: i64,
        manner: Manner,
    ) -> Result<Folded<S>, Error> {
        let Task { row, retractions, mut queue, deadline } = task;
        let session_id = row.session_id.as_str();
        let mut folded = start;
        let most = if matches!(manner, Manner::Deferring) { DEFERRING_PAGE } else { PAGE };
        loop {
            let after = folded.revision();
            if after >= end {
                break;
            }
            let page = match self.store.events(session_id, after, most.min(end - after)).await {
                Err(StoreError::Damaged(damage)) => return Ok(Folded { damage: Some(damage), ..folded }),
                page => page?,
            };
            if page.is_empty() {
                break;
            }
            let (folding, id, retractions) = (self.folding, session_id.to_owned(), retractions.clone());
            let manner = manner.clone();
            let fold = move || fold_page(folding, &id, folded, &page, &retractions, &manner);
            let (reached, all_kept) = self.pool.run(queue, Work::Fold, session_id, deadline, fold).await?;
            for kept in all_kept {
                self.store.checkpoints.keep((session_id, row.created_us), kept);
            }
            folded = reached;
            if folded.damage.is_some() {
                return Ok(folded);
            }
            // What has begun is not given up because others came meanwhile.
            queue = queue.patient();
        }
        Ok(folded)
    }

    fn set_aside(
        &self,
        row: &SessionRow,
        damage: Damage,
        sound: Option<Arc<S>>,
        head: Head,
    ) -> Result<Replayed<S>, Error> {
        if row.damage().as_ref() != Some(&damage) {
            self.store.set_aside(damage.clone());
        }
        match sound {
            Some(sound) => {
                let state = Arc::new(sound.quarantined(&damage.reason, row.head));
                Ok(Replayed { state, head })
            }
            None => Err(StoreError::Damaged(damage).into()),
        }
    }

    pub(super) async fn row(&self, session_id: &str) -> Result<SessionRow, Error> {
        self.store.session(session_id).await?.ok_or_else(|| not_found(session_id))
    }

    /// Whether the log has moved on since this state.
    pub(super) async fn is_behind(&self, state: &S) -> Result<bool, Error> {
        let (session_id, created_us) = state.identity();
        let row = self.store.session(session_id).await?;
        Ok(row.is_none_or(|row| (row.created_us, row.head) != (created_us, state.revision())))
    }

    /// Brings a session in memory up to what the log says: another process has written, or it was found damaged.
    pub(super) async fn catch_up(
        &self,
        session_id: &str,
        live: &Arc<Live<S>>,
        deadline: Instant,
    ) -> Result<(), Error> {
        if self.store.is_shared() {
            tracing::debug!(session_id, "another server has written to a session");
        } else {
            tracing::warn!(session_id, "the log of a session is not where this process left it");
        }
        let begun = Instant::now();
        let row = self.store.session(session_id).await?;
        let Some(row) = row else {
            live.mark_gone();
            self.live.forget(session_id, live);
            return Err(not_found(session_id));
        };
        let known = self.loaded(session_id).filter(|known| known.identity().1 == row.created_us);
        let known = known.filter(|_| row.damage().is_none());
        let known = known.zip(live.head()).map(|(state, head)| Replayed { state, head });
        live.publish(self.replay(session_id, known, i64::MAX, Queue::ROBOTS, deadline).await?);
        live.look(begun);
        Ok(())
    }
}

impl<S: Aggregate> Folded<S> {
    pub(super) fn revision(&self) -> i64 {
        self.state.as_ref().map_or(0, |state| state.revision())
    }

    /// The same fold, from where states are left out.
    pub(super) fn deferring(&self) -> Self {
        Self {
            state: self.state.as_ref().map(|state| Arc::new(state.deferring())),
            head: self.head,
            damage: None,
        }
    }
}

/// Folds some events; with what is kept of the states that were computed.
pub(super) fn fold_page<S: Aggregate>(
    folding: Folding<S>,
    session_id: &str,
    mut folded: Folded<S>,
    page: &[Event],
    retractions: &Retractions,
    manner: &Manner,
) -> (Folded<S>, Vec<Kept>) {
    let mut kept = Vec::new();
    for row in page {
        let before = folded.state.as_deref();
        match next(folding, before, row, retractions, manner) {
            Ok(next) => {
                if matches!(manner, Manner::Computing) && retractions.agree_at(row.seq) {
                    let before = before.filter(|before| retractions.agree_at(before.revision()));
                    kept.push(kept_after(before, &next));
                }
                folded.head =
                    Head { link: row.link(&folded.head.link), bytes: folded.head.bytes + row.bytes() };
                folded.state = Some(Arc::new(next));
            }
            Err(failure) => {
                let session_id = session_id.to_owned();
                let (sound, reason) = (failure.seq - 1, failure.to_string());
                folded.damage = Some(Damage { session_id, sound, reason });
                break;
            }
        }
    }
    (folded, kept)
}

/// The state after one more event, which must be the one that was recorded, unless states are left out.
fn next<S: Aggregate>(
    folding: Folding<S>,
    before: Option<&S>,
    row: &Event,
    retractions: &Retractions,
    manner: &Manner,
) -> Result<S, FoldError> {
    let next = match before {
        Some(before) if retractions.leaves_out(row.seq) => before.without_event(row),
        _ => (folding.fold)(before, row)?,
    };
    let next = match manner {
        Manner::Computing => next,
        // After one that defers, it defers already.
        Manner::Deferring => return Ok(if before.is_none() { next.deferring() } else { next }),
        Manner::Restoring(checkpoint) => {
            let unreadable =
                || FoldError { seq: row.seq, reason: "its checkpoint cannot be read".to_owned() };
            next.deferring().restored(&checkpoint.bytes).ok_or_else(unreadable)?
        }
    };
    if retractions.agree_at(row.seq) { checked(next, row) } else { Ok(next) }
}

/// The same state, where it is the one that was recorded; one of another version may differ.
fn checked<S: Aggregate>(state: S, row: &Event) -> Result<S, FoldError> {
    if row.algorithm_version != S::algorithm_version() || row.state_hash == state.state_hash() {
        return Ok(state);
    }
    let reason =
        "its replay gives another state than was recorded under this version of the method".to_owned();
    Err(FoldError { seq: row.seq, reason })
}

pub(super) fn not_found(session_id: &str) -> Error {
    Error::SessionNotFound { session_id: session_id.to_owned() }
}
