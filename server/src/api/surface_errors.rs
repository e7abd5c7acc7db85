//! The error of each revision against the reference mesh that the session keeps: computed in the background, kept
//! beside the log.
//!
//! ```text
//! a series lacks some --> one task for the session --> log folded once, in order --> compared --> a few noted at once
//! ```
//! Whoever asks meanwhile is told how many are missing. A task computes in the readers' queue and waits there for room,
//! so that no robot is slower for it.

use std::collections::{BTreeMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use palpate_core::metrics::Reference;
use palpate_core::reconstruction;
use tokio::sync::Semaphore;
use tokio::time::Instant;

use super::Api;
use super::references::Truth;
use super::watch::try_again;
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::session::Snapshot;
use crate::sessions::{Aggregate, FreshFold};
use crate::store::{NewErrors, SurfaceError};

/// Errors that are noted at once.
const NOTED_AT_ONCE: usize = 8;
/// Sessions whose errors are computed at the same time: each holds a reference and a state.
const AT_ONCE: usize = 2;

/// The sessions whose errors are being computed.
#[derive(Debug)]
pub(super) struct ErrorTasks {
    running: Mutex<HashSet<String>>,
    turns: Semaphore,
}

impl Default for ErrorTasks {
    fn default() -> Self {
        Self { running: Mutex::default(), turns: Semaphore::new(AT_ONCE) }
    }
}

impl ErrorTasks {
    fn begin(self: &Arc<Self>, session_id: &str) -> Option<Running> {
        let is_first = self.lock().insert(session_id.to_owned());
        is_first.then(|| Running { tasks: self.clone(), session_id: session_id.to_owned() })
    }

    fn lock(&self) -> MutexGuard<'_, HashSet<String>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The right to compute the errors of a session.
#[derive(Debug)]
struct Running {
    tasks: Arc<ErrorTasks>,
    session_id: String,
}

impl Drop for Running {
    fn drop(&mut self) {
        self.tasks.lock().remove(&self.session_id);
    }
}

impl Api {
    /// The errors that are known, by their revision.
    ///
    /// # Errors
    /// The database cannot be read.
    pub(super) async fn known_errors(&self, session_id: &str) -> Result<BTreeMap<i64, SurfaceError>, Error> {
        Ok(self.sessions.store.surface_errors(session_id, reconstruction::version()).await?)
    }

    /// Sees to it that the missing errors of a session are computed, and returns at once.
    pub(super) fn compute_errors(&self, session_id: &str) {
        let Some(running) = self.errors.begin(session_id) else { return };
        let api = self.clone();
        tokio::spawn(async move {
            let computing = async {
                let _turn = api.errors.turns.acquire().await;
                api.compute_missing(&running.session_id).await
            };
            if let Some(Err(error)) = api.stopping.run_until_cancelled(computing).await {
                // Whoever asks next begins again.
                tracing::info!(session_id = running.session_id, %error, "errors were not all computed");
            }
        });
    }

    async fn compute_missing(&self, session_id: &str) -> Result<(), Error> {
        let mut before = Vec::new();
        loop {
            let newest = self.patient_state(session_id, 0).await?;
            let truth = self.patient_truth(session_id).await?;
            let known = self.known_errors(session_id).await?;
            let missing: Vec<i64> =
                newest.evidence_seqs().into_iter().filter(|seq| !known.contains_key(seq)).collect();
            if missing.is_empty() || missing == before {
                // What cannot be noted now is computed when somebody asks again.
                return Ok(());
            }
            self.compute_each(&newest, &truth, &missing).await?;
            before = missing;
        }
    }

    /// Computes the errors after these events, which are in order.
    async fn compute_each(
        &self,
        newest: &Arc<Snapshot>,
        truth: &Truth,
        missing: &[i64],
    ) -> Result<(), Error> {
        let (session_id, _) = newest.identity();
        let mut fold: Option<FreshFold<Snapshot>> = None;
        let mut last: Option<(Arc<Snapshot>, SurfaceError)> = None;
        for some in missing.chunks(NOTED_AT_ONCE) {
            let mut errors = Vec::with_capacity(some.len());
            for &seq in some {
                let state = self.folded_to(newest, &mut fold, seq).await?;
                if state.revision != seq {
                    // The log is damaged before this event.
                    state.check_sound()?;
                }
                let error = match &last {
                    Some((before, error)) if before.reconstruction.has_surface_of(&state.reconstruction) => {
                        *error
                    }
                    _ => self.patient_error(&state, truth).await?,
                };
                errors.push((seq, error));
                last = Some((state, error));
            }
            self.note_errors(session_id, newest.definition.created_us, truth, errors).await?;
        }
        Ok(())
    }

    /// The state after the event `seq`, in the order of their calls: each goes on from the one before.
    async fn folded_to(
        &self,
        newest: &Arc<Snapshot>,
        fold: &mut Option<FreshFold<Snapshot>>,
        seq: i64,
    ) -> Result<Arc<Snapshot>, Error> {
        if seq == newest.revision {
            return Ok(newest.clone());
        }
        let (session_id, _) = newest.identity();
        let Some(begun) = fold else {
            // From the nearest state in memory.
            let first = self.patient_state(session_id, seq).await?;
            *fold = Some(FreshFold::from(first.clone(), session_id));
            return Ok(first);
        };
        loop {
            let deadline = self.soon();
            match self.sessions.fold_afresh(session_id, begun, seq, Queue::WATCHERS, deadline).await {
                Ok(state) => return Ok(state),
                Err(error) => try_again(error).await?,
            }
        }
    }

    /// How far the estimate of a state is from a reference; nothing where it cannot be compared.
    ///
    /// # Errors
    /// It could not be computed in time.
    pub(super) async fn surface_error(
        &self,
        state: &Arc<Snapshot>,
        truth: &Truth,
        queue: Queue,
        deadline: Instant,
    ) -> Result<SurfaceError, Error> {
        let (session_id, _) = state.identity();
        let (state, surface) = (state.clone(), truth.surface.clone());
        let compare = move || distance_m(&state, &surface);
        self.sessions.pool.run(queue, Work::Comparison, session_id, deadline, compare).await
    }

    /// Notes errors of a session that was created at `created_us`.
    ///
    /// # Errors
    /// They could not be written.
    pub(super) async fn note_errors(
        &self,
        session_id: &str,
        created_us: i64,
        truth: &Truth,
        errors: Vec<(i64, SurfaceError)>,
    ) -> Result<(), Error> {
        let new = NewErrors {
            session_id: session_id.to_owned(),
            created_us,
            reference: truth.kept.key.clone(),
            algorithm_version: reconstruction::version(),
            errors,
        };
        Ok(self.sessions.store.note_errors(new).await?)
    }

    /// The state at a revision, 0 being the newest, however long it has to be waited for.
    async fn patient_state(&self, session_id: &str, revision: i64) -> Result<Arc<Snapshot>, Error> {
        loop {
            let deadline = self.soon();
            match self.sessions.at_revision(session_id, revision, Queue::WATCHERS, deadline).await {
                Ok(state) => return Ok(state),
                Err(error) => try_again(error).await?,
            }
        }
    }

    async fn patient_truth(&self, session_id: &str) -> Result<Truth, Error> {
        loop {
            match self.kept_truth(session_id, Queue::WATCHERS, self.soon()).await {
                Ok(truth) => return Ok(truth),
                Err(error) => try_again(error).await?,
            }
        }
    }

    async fn patient_error(&self, state: &Arc<Snapshot>, truth: &Truth) -> Result<SurfaceError, Error> {
        loop {
            match self.surface_error(state, truth, Queue::WATCHERS, self.soon()).await {
                Ok(error) => return Ok(error),
                Err(error) => try_again(error).await?,
            }
        }
    }

    fn soon(&self) -> Instant {
        Instant::now() + self.limits.recompute_timeout
    }
}

fn distance_m(state: &Snapshot, truth: &Reference) -> SurfaceError {
    let surface = state.reconstruction.surface()?;
    truth.surface_distance_m(&surface.mesh).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_has_one_task_at_a_time() {
        let tasks = Arc::new(ErrorTasks::default());
        let running = tasks.begin("ball");
        assert!(running.is_some() && tasks.begin("ball").is_none() && tasks.begin("mug").is_some());
        drop(running);
        assert!(tasks.begin("ball").is_some());
    }
}
