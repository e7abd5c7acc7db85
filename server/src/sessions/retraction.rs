//! Retractions: from an event that retracts another one on, the state is that of the log without the other one.
//!
//! ```text
//! log:    1   2   3   4   5  6: retracts 3  7
//! state:  1   12  123 ..  .. 1 2 4 5        1 2 4 5 7
//! ```
//! So a fold to some revision has to know beforehand what is retracted up to there, and the states that it passes on the
//! way between an event and its retraction are not those that were recorded.

use std::sync::Arc;

use tokio::time::Instant;

use super::live::Head;
use super::replay::{Folded, Task};
use super::{Aggregate, Computed, Recompute, Sessions, StoredEvent};
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::store::Event;

/// What is retracted of a log up to some revision.
#[derive(Clone, Debug, Default)]
pub(crate) struct Retractions {
    /// Each with the seq of the retraction and of the event that it retracts.
    pairs: Vec<(i64, i64)>,
}

impl Retractions {
    /// What is retracted among all events of a log.
    pub(super) fn among(events: &[Event], retracts: fn(&Event) -> Option<i64>) -> Self {
        Self { pairs: events.iter().filter_map(|row| Some((row.seq, retracts(row)?))).collect() }
    }

    /// The same, and the event `seq` as well, by a retraction at `at`.
    pub(super) fn and(mut self, at: i64, seq: i64) -> Self {
        self.pairs.push((at, seq));
        self
    }

    /// The event that retracts the event `seq`, if it is left out.
    pub(crate) fn of(&self, seq: i64) -> Option<i64> {
        self.pairs.iter().find(|&&(_, retracted)| retracted == seq).map(|&(at, _)| at)
    }

    /// Whether the event `seq` is left out.
    pub(super) fn leaves_out(&self, seq: i64) -> bool {
        self.of(seq).is_some()
    }

    /// Whether the state after the event `seq` is, with these events left out, the one that was recorded then; a fold
    /// can then go on from that one.
    pub(super) fn agree_at(&self, seq: i64) -> bool {
        self.pairs.iter().all(|&(at, retracted)| seq < retracted || at <= seq)
    }
}

impl<S: Aggregate> Sessions<S> {
    /// What is retracted of a session's log up to the event `to`.
    pub(crate) async fn retractions(&self, session_id: &str, to: i64) -> Result<Retractions, Error> {
        let rows = self.store.of_kind(session_id, self.folding.retraction, to).await?;
        Ok(Retractions::among(&rows, self.folding.retracts))
    }

    /// The event that retracts the event `seq`, computed from the state that the log up to `before` gives without it. It
    /// goes on when the caller stops waiting: a retry then finds it done.
    ///
    /// # Errors
    /// Without the event the log has no state.
    pub(super) async fn retract(
        &self,
        before: &Arc<S>,
        seq: i64,
        compute: Recompute<S>,
    ) -> Result<(StoredEvent, Computed<S>), Error> {
        let (session_id, head) = (before.identity().0.to_owned(), before.revision());
        let deadline = Instant::now() + self.limits.recompute_timeout;
        let row = self.row(&session_id).await?;
        let retractions = self.retractions(&session_id, head).await?.and(head + 1, seq);
        let start = Folded { state: None, head: Head::empty(&session_id), damage: None };
        let task = Task { row: &row, retractions: &retractions, queue: Queue::ROBOTS, deadline };
        let start = self.jumped(task, start, seq - 1).await?;
        let folded = self.fold_on(task, start, head).await?;
        let without = match (folded.state, folded.damage) {
            (Some(state), None) => state,
            (_, damage) => {
                let reason = damage.map(|damage| damage.reason).unwrap_or_default();
                let description = format!("is needed by later events, so it cannot be retracted: {reason}");
                return Err(Error::field("seq", description));
            }
        };
        self.pool.run(Queue::ROBOTS, Work::Edit, &session_id, deadline, move || compute(&without)).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_between_an_event_and_its_retraction_states_are_others_than_were_recorded() {
        let retractions = Retractions::default().and(6, 3).and(8, 5);
        let agree: Vec<i64> = (1..=9).filter(|&seq| retractions.agree_at(seq)).collect();
        assert_eq!(agree, [1, 2, 8, 9]);
        let left_out: Vec<i64> = (1..=9).filter(|&seq| retractions.leaves_out(seq)).collect();
        assert_eq!(left_out, [3, 5]);
    }
}
