//! Replay: a session's state computed again from its log, which is trusted as far as its links hold.

use std::sync::Arc;

use tokio::time::Instant;

use super::live::{Head, Live, Replayed};
use super::retraction::Retractions;
use super::{ATTEMPTS, Aggregate, FoldError, Folding, Sessions, contended};
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::store::{Damage, Event, SessionRow, StoreError};

/// Events folded in one job: whoever comes waits for that long behind a long log.
const PAGE: i64 = 4;

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
        let reached = self.replay(session_id, from, to, queue, deadline).await?;
        let state = reached.state.clone();
        fold.reached = Some(reached);
        Ok(state)
    }

    /// Folds the events after `from` up to the revision `to`, or as many as there are.
    ///
    /// A log that is damaged gives its last sound state, quarantined.
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
            let start = Folded { state, head, damage: None };
            let folded = self.fold_on(&row, start, end, &retractions, queue, deadline).await?;
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

    pub(super) async fn fold_on(
        &self,
        row: &SessionRow,
        start: Folded<S>,
        end: i64,
        retractions: &Retractions,
        mut queue: Queue,
        deadline: Instant,
    ) -> Result<Folded<S>, Error> {
        let session_id = row.session_id.as_str();
        let mut folded = start;
        let damage = |sound: i64, reason: String| Damage { session_id: session_id.to_owned(), sound, reason };
        loop {
            let after = folded.revision();
            if after >= end {
                break;
            }
            let page = match self.store.events(session_id, after, PAGE.min(end - after)).await {
                Err(StoreError::Damaged(damage)) => return Ok(Folded { damage: Some(damage), ..folded }),
                page => page?,
            };
            if page.is_empty() {
                break;
            }
            let (folding, id, retractions) = (self.folding, session_id.to_owned(), retractions.clone());
            let fold = move || fold_page(folding, &id, folded, &page, &retractions);
            folded = self.pool.run(queue, Work::Fold, session_id, deadline, fold).await?;
            if folded.damage.is_some() {
                return Ok(folded);
            }
            // What has begun is not given up because others came meanwhile.
            queue = queue.patient();
        }
        let last = folded.revision();
        if end < row.head && last == end {
            return Ok(folded);
        }
        let is_another = |state: &Arc<S>| state.identity().1 != row.created_us;
        let disagreement = row.disagreement(last, &folded.head.link).or_else(|| {
            folded.state.as_ref().is_some_and(is_another).then(|| "was created at another time".to_owned())
        });
        folded.damage = disagreement.map(|reason| damage(last, reason));
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
        tracing::warn!(session_id, "the log of a session is not where this process left it");
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
        Ok(())
    }
}

impl<S: Aggregate> Folded<S> {
    fn revision(&self) -> i64 {
        self.state.as_ref().map_or(0, |state| state.revision())
    }
}

pub(super) fn fold_page<S: Aggregate>(
    folding: Folding<S>,
    session_id: &str,
    mut folded: Folded<S>,
    page: &[Event],
    retractions: &Retractions,
) -> Folded<S> {
    for row in page {
        match next(folding, folded.state.as_deref(), row, retractions) {
            Ok(next) => {
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
    folded
}

/// The state after one more event, which must be the one that was recorded.
fn next<S: Aggregate>(
    folding: Folding<S>,
    before: Option<&S>,
    row: &Event,
    retractions: &Retractions,
) -> Result<S, FoldError> {
    let next = match before {
        Some(before) if retractions.leaves_out(row.seq) => before.without_event(row),
        _ => (folding.fold)(before, row)?,
    };
    if retractions.agree_at(row.seq) { checked(next, row) } else { Ok(next) }
}

/// The same state, where it is the one that was recorded; one of another version may differ.
fn checked<S: Aggregate>(state: S, row: &Event) -> Result<S, FoldError> {
    if row.algorithm_version != S::ALGORITHM_VERSION || row.state_hash == state.state_hash() {
        return Ok(state);
    }
    let reason =
        "its replay gives another state than was recorded under this version of the method".to_owned();
    Err(FoldError { seq: row.seq, reason })
}

pub(super) fn not_found(session_id: &str) -> Error {
    Error::SessionNotFound { session_id: session_id.to_owned() }
}
