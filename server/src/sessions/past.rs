//! States of earlier revisions: a few are kept, and what is not kept is computed again from the nearest one or the
//! latest checkpoint before it.
//!
//! One computation at a time goes on in a session, whoever began it and whether or not anybody waits for it still, so
//! that each revision is reached in the end, however short the deadlines are.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::time::Instant;

use super::live::{Head, Live, Replayed};
use super::{Aggregate, Sessions, detached};
use crate::compute::Queue;
use crate::error::Error;

/// The states used last, the newest use in front.
#[derive(Debug)]
pub(super) struct PastStates<S> {
    recent: Mutex<VecDeque<Arc<S>>>,
    most: usize,
}

impl<S: Aggregate> PastStates<S> {
    pub(super) fn new(most: usize) -> Self {
        Self { recent: Mutex::default(), most }
    }

    /// The kept state of this session that is nearest to `revision` and not after it, of those of revisions that are
    /// `usable`.
    fn nearest(&self, newest: &S, revision: i64, usable: impl Fn(i64) -> bool) -> Option<Arc<S>> {
        let recent = self.lock();
        let earlier = recent.iter().filter(|kept| {
            kept.identity() == newest.identity() && kept.revision() <= revision && usable(kept.revision())
        });
        earlier.max_by_key(|kept| kept.revision()).cloned()
    }

    fn keep(&self, state: Arc<S>) {
        let mut recent = self.lock();
        recent.retain(|kept| kept.identity() != state.identity() || kept.revision() != state.revision());
        recent.push_front(state);
        recent.truncate(self.most);
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<Arc<S>>> {
        self.recent.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<S: Aggregate> Sessions<S> {
    /// The state at a revision before the newest.
    ///
    /// # Errors
    /// Too many wait for the past of this session, or the log could not be read in time.
    pub(super) async fn past_state(
        self: &Arc<Self>,
        live: Arc<Live<S>>,
        newest: Arc<S>,
        revision: i64,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Arc<S>, Error> {
        let is_it = |kept: i64| kept == revision;
        if let Some(known) = self.past.nearest(&newest, revision, is_it) {
            return Ok(known);
        }
        let pass = live.past.enter(queue.is_patient(), deadline).await?;
        let this = self.clone();
        let computed = detached(async move {
            let _alone = pass;
            this.compute_past(&newest, revision, queue).await
        });
        tokio::time::timeout_at(deadline, computed).await.unwrap_or(Err(Error::DeadlineExceeded))
    }

    async fn compute_past(&self, newest: &S, revision: i64, queue: Queue) -> Result<Arc<S>, Error> {
        let session_id = newest.identity().0;
        let until = Instant::now() + self.limits.recompute_timeout;
        let retractions = self.retractions(session_id, revision).await?;
        let nearest = self.past.nearest(newest, revision, |kept| retractions.agree_at(kept));
        // Each event is checked by the one before it, so where the kept state ends need not be known.
        let from = nearest.map(|state| Replayed { state, head: Head::empty(session_id) });
        let state = self.replay(session_id, from, revision, queue, until).await?.state;
        self.past.keep(state.clone());
        Ok(state)
    }
}
