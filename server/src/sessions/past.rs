//! A few states of earlier revisions, so that looking through a session's past is not replayed
//! from the beginning each time.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::Aggregate;

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

    /// The kept state of this session that is nearest to `revision` and not after it.
    pub(super) fn nearest(&self, newest: &S, revision: i64) -> Option<Arc<S>> {
        let recent = self.lock();
        let earlier =
            recent.iter().filter(|kept| kept.identity() == newest.identity() && kept.revision() <= revision);
        earlier.max_by_key(|kept| kept.revision()).cloned()
    }

    pub(super) fn keep(&self, state: Arc<S>) {
        let mut recent = self.lock();
        recent.retain(|kept| kept.identity() != state.identity() || kept.revision() != state.revision());
        recent.push_front(state);
        recent.truncate(self.most);
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<Arc<S>>> {
        self.recent.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
