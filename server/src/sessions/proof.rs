//! The proof of a log: all its links hold, and it ends where its session's row says.
//!
//! Before anything of a session is shown that was not folded here, its log is proved once; all logs are, one after the
//! other and slowly, in the background.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::{Aggregate, Sessions};
use crate::error::Error;
use crate::store::{Damage, Filter, PageEnd, SessionRow, StoreError};

/// Sessions that are looked up at once.
const PAGE: i64 = 100;
/// When logs are proved again that could not all be read.
const UNREAD_PAUSE: Duration = Duration::from_secs(60);

/// The sessions whose logs were proved by this process, with when they were created.
#[derive(Debug, Default)]
pub(super) struct Proven {
    sessions: Mutex<HashMap<String, i64>>,
}

impl Proven {
    fn has(&self, row: &SessionRow) -> bool {
        self.lock().get(&row.session_id) == Some(&row.created_us)
    }

    fn note(&self, row: &SessionRow, is_sound: bool) {
        if is_sound {
            self.lock().insert(row.session_id.clone(), row.created_us);
        } else {
            self.lock().remove(&row.session_id);
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, i64>> {
        // Nothing panics while it is held.
        self.sessions.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<S: Aggregate> Sessions<S> {
    /// The bytes that tell of a session in lists, where they and its log are as they were written; otherwise the log
    /// is to be folded.
    ///
    /// # Errors
    /// The database cannot be read.
    pub(crate) async fn trusted_summary<'a>(&self, row: &'a SessionRow) -> Result<Option<&'a [u8]>, Error> {
        Ok(if self.is_proven(row).await? { row.summary() } else { None })
    }

    /// Whether the log is as it was written, which is looked up once.
    ///
    /// # Errors
    /// The database cannot be read.
    pub(super) async fn is_proven(&self, row: &SessionRow) -> Result<bool, Error> {
        Ok(row.damage().is_none() && (self.proven.has(row) || self.prove(row).await?.is_ok()))
    }

    /// Reads a log to its end and compares it with the session's row: its bytes, or what is wrong.
    async fn prove(&self, row: &SessionRow) -> Result<Result<u64, Damage>, StoreError> {
        let proof = self.store.prove(row).await?;
        self.proven.note(row, proof.is_ok());
        Ok(proof)
    }

    /// The same for a session as it is now: since it was listed it may have moved on, or be gone.
    async fn prove_now(&self, session_id: &str) -> Result<Option<Result<u64, Damage>>, StoreError> {
        match self.store.session(session_id).await? {
            Some(row) => self.prove(&row).await.map(Some),
            None => Ok(None),
        }
    }

    /// Proves all logs, again and again with a pause, until the server stops.
    pub(crate) async fn prove_all(self: Arc<Self>) {
        let stopping = self.stopping.clone();
        let rounds = async {
            loop {
                let mut pause = self.limits.proof_pause;
                match self.prove_each().await {
                    Ok((sessions, damaged)) => tracing::debug!(sessions, damaged, "all logs were proved"),
                    Err(failure) => {
                        tracing::warn!(%failure, "the logs could not all be proved");
                        pause = pause.min(UNREAD_PAUSE);
                    }
                }
                tokio::time::sleep(pause).await;
            }
        };
        stopping.run_until_cancelled(rounds).await;
    }

    /// How many sessions there are, and how many of them are damaged.
    ///
    /// # Errors
    /// What kept the last one from being read that was not; the others were proved all the same.
    async fn prove_each(&self) -> Result<(usize, usize), StoreError> {
        let (mut sessions, mut damaged, mut unread) = (0, 0, None);
        let mut after: Option<PageEnd> = None;
        loop {
            let page = self.store.list(&Filter::default(), after.as_ref(), PAGE).await?;
            let Some(last) = page.last() else { return unread.map_or(Ok((sessions, damaged)), Err) };
            after = Some(last.page_end());
            for row in &page {
                sessions += 1;
                let bytes = match self.prove_now(&row.session_id).await {
                    Ok(Some(Ok(bytes))) => bytes,
                    Ok(Some(Err(_))) => {
                        damaged += 1;
                        0
                    }
                    Ok(None) => 0,
                    Err(failure) => {
                        unread = Some(failure);
                        0
                    }
                };
                let pause_s = bytes as f64 / self.limits.proof_bytes_per_s.max(1) as f64;
                tokio::time::sleep(Duration::from_secs_f64(pause_s)).await;
            }
        }
    }
}
