//! Sessions that other servers change as well: what is in memory is compared with the log.
//!
//! ```text
//! read  --> looked at within `staleness`? --> shown          (always so where no other server writes)
//!                  `-- else: is the log's head the one in memory? --> shown
//!                                   `-- else: wait for the permit, catch up --> shown
//! write --> on what is in memory; the log refuses it where that is not the newest, and it is caught up with
//! watch --> the heads of all watched sessions are looked at together, every `follow`
//! ```

use std::sync::Arc;

use tokio::time::{Instant, MissedTickBehavior};

use super::live::Live;
use super::{Aggregate, Sessions, detached};
use crate::error::Error;
use crate::store::SessionEnd;

/// Sessions whose heads are asked for at once.
const PAGE: usize = 256;

impl<S: Aggregate> Sessions<S> {
    /// Sees to it that the session in memory is what the log said `since` then or later.
    ///
    /// # Errors
    /// There is no such session any more, or the log could not be read in time.
    pub(super) async fn refresh(
        self: &Arc<Self>,
        session_id: &str,
        live: &Arc<Live<S>>,
        since: Instant,
        deadline: Instant,
    ) -> Result<(), Error> {
        if !self.store.is_shared() || live.looked_at() >= since {
            return Ok(());
        }
        let _looking = live.looking.lock().await;
        if live.looked_at() >= since {
            return Ok(());
        }
        let now = Instant::now();
        let end = self.store.ends(&[session_id]).await?.pop();
        if self.is_at(live, end.as_ref()) {
            live.look(now);
            return Ok(());
        }
        // It goes on when the caller stops waiting, like the opening of a session.
        let (this, live, session_id) = (self.clone(), live.clone(), session_id.to_owned());
        detached(async move { this.catch_up_alone(&session_id, &live, deadline).await }).await
    }

    /// Sees to it that the session is at `revision` or later, wherever that was written.
    ///
    /// # Errors
    /// It is not, or there is no such session.
    pub(crate) async fn reach(
        self: &Arc<Self>,
        session_id: &str,
        revision: i64,
        deadline: Instant,
    ) -> Result<(), Error> {
        let newest = self.newest(session_id, deadline).await?;
        if newest.revision() >= revision {
            return Ok(());
        }
        let live = self.live.get(session_id);
        self.refresh(session_id, &live, Instant::now(), deadline).await?;
        let actual = self.newest(session_id, deadline).await?.revision();
        if actual >= revision { Ok(()) } else { Err(Error::RevisionMismatch { expected: revision, actual }) }
    }

    /// Follows what other servers append to the sessions that somebody watches here, until this one stops.
    pub(crate) async fn follow_others(self: Arc<Self>) {
        if !self.store.is_shared() {
            return;
        }
        let mut rounds = tokio::time::interval(self.limits.follow);
        rounds.set_missed_tick_behavior(MissedTickBehavior::Delay);
        while self.stopping.run_until_cancelled(rounds.tick()).await.is_some() {
            for page in self.live.watched().chunks(PAGE) {
                self.follow(page).await;
            }
        }
    }

    async fn follow(self: &Arc<Self>, watched: &[(String, Arc<Live<S>>)]) {
        let ids: Vec<&str> = watched.iter().map(|(session_id, _)| session_id.as_str()).collect();
        let now = Instant::now();
        // A database that does not answer is looked after by who reads: watchers see no more for a while.
        let Ok(ends) = self.store.ends(&ids).await else { return };
        for (session_id, live) in watched {
            let end = ends.iter().find(|end| end.session_id == *session_id);
            if self.is_at(live, end) {
                live.look(now);
                continue;
            }
            let (this, live, session_id) = (self.clone(), live.clone(), session_id.clone());
            tokio::spawn(async move {
                let Ok(_looking) = live.looking.try_lock() else { return };
                let deadline = Instant::now() + this.limits.call_timeout;
                if let Err(failure) = this.catch_up_alone(&session_id, &live, deadline).await {
                    tracing::debug!(session_id, %failure, "a watched session was not caught up with");
                }
            });
        }
    }

    /// Whether what is in memory is what the log ends with.
    fn is_at(&self, live: &Live<S>, end: Option<&SessionEnd>) -> bool {
        let (Some(state), Some(end)) = (live.state(), end) else { return false };
        if end.created_us != state.identity().1 {
            return false;
        }
        // One that is set aside ends where its log is sound, whatever comes after.
        match state.check_open() {
            Err(Error::SessionQuarantined { .. }) => end.is_damaged,
            _ => !end.is_damaged && end.head == state.revision(),
        }
    }

    async fn catch_up_alone(
        &self,
        session_id: &str,
        live: &Arc<Live<S>>,
        deadline: Instant,
    ) -> Result<(), Error> {
        let _permit = live.permit_to_catch_up(deadline).await?;
        let now = Instant::now();
        let end = self.store.ends(&[session_id]).await?.pop();
        // This server may have appended what was missed.
        if !self.is_at(live, end.as_ref()) {
            self.catch_up(session_id, live, deadline).await?;
        }
        live.look(now);
        Ok(())
    }
}
