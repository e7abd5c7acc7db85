//! Checkpoints of a fold: an event's state without the states before it, and what readers are shown of it.
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
use crate::store::Kept;

impl<S: Aggregate> Sessions<S> {
    /// Keeps what gives the state back, and what readers are shown of it.
    pub(super) fn keep_checkpoint(&self, before: &S, state: &S) {
        self.store.checkpoints.keep(state.identity(), kept_after(Some(before), state));
    }

    /// What readers are shown of the state at a revision before the newest, with its hash; nothing where that is not
    /// kept, or is not of the state that the log recorded.
    pub(crate) async fn shown_at(&self, newest: &S, revision: i64) -> Option<(String, Vec<u8>)> {
        if !(1..newest.revision()).contains(&revision) {
            return None;
        }
        self.shown_after(newest.identity(), revision).await
    }

    /// The same for a session that is not in memory, which stays so; its log is proved, once.
    pub(crate) async fn shown_unopened(&self, session_id: &str, revision: i64) -> Option<(String, Vec<u8>)> {
        if self.loaded(session_id).is_some() {
            return None;
        }
        let row = self.store.session(session_id).await.ok()??;
        if !(1..=row.head).contains(&revision) || !self.is_proven(&row).await.ok()? {
            return None;
        }
        self.shown_after((session_id, row.created_us), revision).await
    }

    async fn shown_after(&self, identity: (&str, i64), revision: i64) -> Option<(String, Vec<u8>)> {
        let event = self.store.events(identity.0, revision - 1, 1).await.ok()?.pop()?;
        if event.algorithm_version != S::algorithm_version() {
            return None;
        }
        let shown = self.store.checkpoints.shown(identity, revision, &event.state_hash).await?;
        Some((event.state_hash, shown))
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

/// What is kept of a state: what gives it back, where that is not what gives back the one before, and what readers are
/// shown of it.
pub(super) fn kept_after<S: Aggregate>(before: Option<&S>, state: &S) -> Kept {
    let is_new = before.is_none_or(|before| !state.shares_checkpoint_with(before));
    Kept {
        seq: state.revision(),
        state_hash: state.state_hash(),
        checkpoint: state.checkpoint().filter(|_| is_new),
        shown: state.shown(),
    }
}
