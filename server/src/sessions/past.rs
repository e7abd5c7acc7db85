//! A few snapshots of earlier revisions, so that looking through a session's past is not replayed
//! from the beginning each time.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::session::{Definition, Snapshot};

/// The snapshots used last, the newest use in front.
#[derive(Debug)]
pub(super) struct PastStates {
    recent: Mutex<VecDeque<Arc<Snapshot>>>,
    most: usize,
}

impl PastStates {
    pub(super) fn new(most: usize) -> Self {
        Self { recent: Mutex::default(), most }
    }

    /// The kept snapshot of this session that is nearest to `revision` and not after it.
    pub(super) fn nearest(&self, definition: &Definition, revision: i64) -> Option<Arc<Snapshot>> {
        let recent = self.lock();
        let of_session = recent.iter().filter(|snapshot| is_of(snapshot, definition));
        of_session
            .filter(|snapshot| snapshot.revision <= revision)
            .max_by_key(|snapshot| snapshot.revision)
            .cloned()
    }

    pub(super) fn keep(&self, snapshot: Arc<Snapshot>) {
        let mut recent = self.lock();
        recent.retain(|kept| !is_of(kept, &snapshot.definition) || kept.revision != snapshot.revision);
        recent.push_front(snapshot);
        recent.truncate(self.most);
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<Arc<Snapshot>>> {
        self.recent.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn is_of(snapshot: &Snapshot, definition: &Definition) -> bool {
    let kept = &snapshot.definition;
    // The time tells the session from an earlier one of the same id.
    kept.session_id == definition.session_id && kept.created_us == definition.created_us
}
