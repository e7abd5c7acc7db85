//! Replay: a session's state computed again from its log.

use std::sync::Arc;

use palpate_core::reconstruction::ALGORITHM_VERSION;
use tokio::time::Instant;

use super::live::Live;
use super::{Sessions, down};
use crate::error::Error;
use crate::session::Snapshot;
use crate::store::EventRow;
use crate::wire::event::{self, FoldError};

/// Events folded in one job, so that a long log does not keep a thread from others.
const PAGE: i64 = 16;

/// How far a page could be folded.
struct Folded {
    snapshot: Option<Arc<Snapshot>>,
    stopped: Option<FoldError>,
}

impl Sessions {
    /// Folds the events after `from` up to the revision `to`, or as many as there are.
    ///
    /// A log that cannot be folded gives its last sound state, quarantined.
    pub(super) async fn replay(
        &self,
        session_id: &str,
        from: Option<Arc<Snapshot>>,
        to: i64,
        deadline: Instant,
    ) -> Result<Arc<Snapshot>, Error> {
        let mut snapshot = from;
        loop {
            let after = snapshot.as_ref().map_or(0, |snapshot| snapshot.revision);
            let page = self.store.events(session_id, after, PAGE.min(to - after)).await.map_err(down)?;
            if page.is_empty() {
                return snapshot.ok_or_else(|| not_found(session_id));
            }
            let folded = self.pool.run(deadline, move || fold(snapshot, &page)).await?;
            match (folded.snapshot, folded.stopped) {
                (next, None) => snapshot = next,
                (Some(sound), Some(failure)) => return self.quarantine(&sound, to, &failure).await,
                (None, Some(failure)) => return Err(Error::internal(format!("{session_id}: {failure}"))),
            }
        }
    }

    /// Whether the log has moved on since this snapshot.
    pub(super) async fn is_behind(&self, snapshot: &Snapshot) -> Result<bool, Error> {
        let definition = &snapshot.definition;
        let row = self.store.session(&definition.session_id).await.map_err(down)?;
        Ok(row.is_none_or(|row| (row.created_us, row.head) != (definition.created_us, snapshot.revision)))
    }

    /// Brings a session in memory up to what another process has written.
    pub(super) async fn catch_up(
        &self,
        session_id: &str,
        live: &Arc<Live>,
        deadline: Instant,
    ) -> Result<(), Error> {
        tracing::warn!(session_id, "another process writes to this session");
        let row = self.store.session(session_id).await.map_err(down)?;
        let Some(row) = row else {
            live.mark_gone();
            self.live.forget(session_id, live);
            return Err(not_found(session_id));
        };
        let known = self.loaded(session_id).filter(|known| known.definition.created_us == row.created_us);
        live.publish(self.replay(session_id, known, i64::MAX, deadline).await?);
        Ok(())
    }

    async fn quarantine(
        &self,
        sound: &Snapshot,
        to: i64,
        failure: &FoldError,
    ) -> Result<Arc<Snapshot>, Error> {
        let session_id = &sound.definition.session_id;
        tracing::error!(session_id, %failure, "a session's log cannot be replayed: it is quarantined");
        let row = self.store.session(session_id).await.map_err(down)?;
        let head = row.ok_or_else(|| not_found(session_id))?.head;
        Ok(Arc::new(sound.clone().quarantined(head.min(to))))
    }
}

fn fold(mut snapshot: Option<Arc<Snapshot>>, page: &[EventRow]) -> Folded {
    for row in page {
        match event::fold(snapshot.as_deref(), row) {
            Ok(next) => {
                check_hash(&next, row);
                snapshot = Some(Arc::new(next));
            }
            Err(failure) => return Folded { snapshot, stopped: Some(failure) },
        }
    }
    Folded { snapshot, stopped: None }
}

/// The log rules: a state that differs from the recorded one is used all the same, and reported.
fn check_hash(snapshot: &Snapshot, row: &EventRow) {
    let comparable = row.algorithm_version == ALGORITHM_VERSION;
    if comparable && row.state_hash != snapshot.state_hash() {
        let session_id = &snapshot.definition.session_id;
        tracing::error!(session_id, seq = row.seq, "replay gave another state than was recorded");
    }
}

fn not_found(session_id: &str) -> Error {
    Error::SessionNotFound { session_id: session_id.to_owned() }
}
