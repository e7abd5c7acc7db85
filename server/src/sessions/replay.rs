//! Replay: a session's state computed again from its log.

use std::sync::Arc;

use tokio::time::Instant;

use super::live::Live;
use super::{Aggregate, Fold, FoldError, Sessions};
use crate::compute::Queue;
use crate::error::Error;
use crate::store::EventRow;

/// Events folded in one job, so that a long log does not keep a thread from others.
const PAGE: i64 = 16;

/// How far a page could be folded.
struct FoldedPage<S> {
    state: Option<Arc<S>>,
    stopped: Option<FoldError>,
}

impl<S: Aggregate> Sessions<S> {
    /// Folds the events after `from` up to the revision `to`, or as many as there are.
    ///
    /// A log that cannot be folded gives its last sound state, quarantined.
    pub(super) async fn replay(
        &self,
        session_id: &str,
        from: Option<Arc<S>>,
        to: i64,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Arc<S>, Error> {
        let mut state = from;
        loop {
            let after = state.as_ref().map_or(0, |state| state.revision());
            let page = self.store.events(session_id, after, PAGE.min(to - after)).await?;
            if page.is_empty() {
                return state.ok_or_else(|| not_found(session_id));
            }
            let fold = self.fold;
            let folded =
                self.pool.run(queue, session_id, deadline, move || fold_page(fold, state, &page)).await?;
            match (folded.state, folded.stopped) {
                (next, None) => state = next,
                (Some(sound), Some(failure)) => return self.quarantine(&*sound, to, &failure).await,
                (None, Some(failure)) => return Err(Error::internal(format!("{session_id}: {failure}"))),
            }
        }
    }

    /// Whether the log has moved on since this state.
    pub(super) async fn is_behind(&self, state: &S) -> Result<bool, Error> {
        let (session_id, created_us) = state.identity();
        let row = self.store.session(session_id).await?;
        Ok(row.is_none_or(|row| (row.created_us, row.head) != (created_us, state.revision())))
    }

    /// Brings a session in memory up to what another process has written.
    pub(super) async fn catch_up(
        &self,
        session_id: &str,
        live: &Arc<Live<S>>,
        deadline: Instant,
    ) -> Result<(), Error> {
        tracing::warn!(session_id, "another process writes to this session");
        let row = self.store.session(session_id).await?;
        let Some(row) = row else {
            live.mark_gone();
            self.live.forget(session_id, live);
            return Err(not_found(session_id));
        };
        let known = self.loaded(session_id).filter(|known| known.identity().1 == row.created_us);
        live.publish(self.replay(session_id, known, i64::MAX, Queue::ROBOTS, deadline).await?);
        Ok(())
    }

    async fn quarantine(&self, sound: &S, to: i64, failure: &FoldError) -> Result<Arc<S>, Error> {
        let (session_id, _) = sound.identity();
        tracing::error!(session_id, %failure, "a session's log cannot be replayed: it is quarantined");
        let row = self.store.session(session_id).await?;
        let head = row.ok_or_else(|| not_found(session_id))?.head;
        Ok(Arc::new(sound.quarantined(head.min(to))))
    }
}

fn fold_page<S: Aggregate>(fold: Fold<S>, mut state: Option<Arc<S>>, page: &[EventRow]) -> FoldedPage<S> {
    for row in page {
        match fold(state.as_deref(), row) {
            Ok(next) => {
                check_hash(&next, row);
                state = Some(Arc::new(next));
            }
            Err(failure) => return FoldedPage { state, stopped: Some(failure) },
        }
    }
    FoldedPage { state, stopped: None }
}

/// The log rules: a state that differs from the recorded one is used all the same, and reported.
fn check_hash<S: Aggregate>(state: &S, row: &EventRow) {
    if row.algorithm_version == S::ALGORITHM_VERSION && row.state_hash != state.state_hash() {
        let (session_id, _) = state.identity();
        tracing::error!(session_id, seq = row.seq, "replay gave another state than was recorded");
    }
}

fn not_found(session_id: &str) -> Error {
    Error::SessionNotFound { session_id: session_id.to_owned() }
}
