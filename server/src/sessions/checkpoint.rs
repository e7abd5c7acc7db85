//! Checkpoints of a fold: an event's state without the states before it.
//!
//! ```text
//! events up to k, entered and not computed --+
//!                                            +--> the state after k --> as recorded? --> the fold goes on from it
//! checkpoint of k ---------------------------+
//! ```
//! So any revision costs the reading of the log and one computation. A checkpoint that gives another state than the
//! log recorded is dropped, and all is folded.

use super::replay::{Folded, Manner, Task};
use super::{Aggregate, Sessions};
use crate::error::Error;
use crate::store::Checkpoint;

impl<S: Aggregate> Sessions<S> {
    /// Keeps what gives the state back, where it is not what gives back the one before.
    pub(super) fn keep_checkpoint(&self, before: &S, state: &S) {
        if let Some(checkpoint) = checkpoint_after(Some(before), state) {
            self.store.checkpoints.keep(state.identity(), checkpoint);
        }
    }

    /// A fold that has come as far towards the event `end` as a checkpoint takes it: where it began, if none does.
    ///
    /// # Errors
    /// The log cannot be read in time.
    pub(super) async fn jumped(
        &self,
        task: Task<'_>,
        start: Folded<S>,
        end: i64,
    ) -> Result<Folded<S>, Error> {
        let Task { row, retractions, .. } = task;
        let identity = (row.session_id.as_str(), row.created_us);
        let from = start.revision();
        let agrees = |seq| retractions.agree_at(seq);
        let Some(checkpoint) = self.store.checkpoints.latest(identity, from, end, agrees).await else {
            return Ok(start);
        };
        let before = checkpoint.seq - 1;
        let mut restored = self.fold_pages(task, start.deferring(), before, Manner::Deferring).await?;
        if restored.damage.is_none() && restored.revision() == before {
            let manner = Manner::Restoring(checkpoint.clone());
            restored = self.fold_pages(task, restored, before + 1, manner).await?;
        }
        let is_it =
            |state: &S| state.revision() == checkpoint.seq && state.state_hash() == checkpoint.state_hash;
        if restored.damage.is_none() && restored.state.as_deref().is_some_and(is_it) {
            return Ok(restored);
        }
        tracing::warn!(session_id = row.session_id, seq = checkpoint.seq, "a checkpoint is not of this log");
        self.store.checkpoints.forget(&row.session_id);
        Ok(start)
    }
}

/// What gives a state back, where it is not what gives back the one before.
pub(super) fn checkpoint_after<S: Aggregate>(before: Option<&S>, state: &S) -> Option<Checkpoint> {
    if before.is_some_and(|before| state.shares_checkpoint_with(before)) {
        return None;
    }
    Some(Checkpoint { seq: state.revision(), state_hash: state.state_hash(), bytes: state.checkpoint()? })
}
