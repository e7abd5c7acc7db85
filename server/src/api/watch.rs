//! Following a session: first what the log has, then each new event, with no gap between the two.
//!
//! The log is the only source of events; a published snapshot only says that there is more to read.

use std::sync::Arc;
use std::time::Duration;

use palpate_proto::v1;
use palpate_proto::v1::watch_session_response::Update;
use prost::Message;
use tokio::sync::watch;
use tokio::time::Instant;
use tracing::Instrument;

use super::made_mesh::{MadeMesh, Rendering};
use super::mesh::Form;
use super::outbox::{self, Gone, Outbox};
use super::{Api, Call, Replies};
use crate::compute::Queue;
use crate::error::Error;
use crate::limits::Limits;
use crate::session::Snapshot;
use crate::sessions::{FoldError, Retractions};
use crate::store::Event;
use crate::wire::{event, to_proto};

/// Events read from the log at once, if they are not large.
const PAGE: i64 = 16;
/// How long a watcher waits before it asks again for what there was no time for.
const AGAIN_AFTER: Duration = Duration::from_millis(100);

/// One message of a watch, with what a transport made of it where all watchers get the same.
#[derive(Debug)]
pub(crate) struct WatchUpdate {
    pub(crate) message: v1::WatchSessionResponse,
    pub(crate) rendering: Option<Rendering>,
}

/// One caller that follows a session.
struct Watcher {
    api: Api,
    session_id: String,
    /// Tells the session from another one of the same id.
    created_us: i64,
    /// The last event that was sent.
    sent: i64,
    include_mesh: bool,
    heartbeat: Duration,
    /// The etag of the faces that the caller has.
    topology: String,
    /// The surface that was sent last.
    shown: Option<[u8; 32]>,
    updates: Arc<Outbox<WatchUpdate>>,
}

impl Api {
    /// Follows a session until the caller leaves, the session is removed or the server stops.
    ///
    /// # Errors
    /// No such session, or a field cannot be used; later failures are the stream's last item.
    pub(crate) async fn watch_session(
        &self,
        request: v1::WatchSessionRequest,
        call: Call,
    ) -> Result<Replies<WatchUpdate>, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("WatchSession", &session_id, &call, async |deadline| {
            let v1::WatchSessionRequest { session_id, after_revision, include_mesh, heartbeat } = request;
            let heartbeat = heartbeat_interval(heartbeat, &self.limits)?;
            let mut place = self.places.take(call.peer, &self.limits)?;
            let snapshots = self.sessions.subscribe(&session_id, deadline).await?;
            place.enter(&session_id, &self.limits)?;
            let (revision, created_us) =
                (snapshots.borrow().revision, snapshots.borrow().definition.created_us);
            if !(0..=revision).contains(&after_revision) {
                let description =
                    format!("{after_revision} is not between 0 and the session's revision {revision}");
                return Err(Error::field("after_revision", description));
            }
            let (updates, replies) = outbox::stream(&self.limits);
            let watcher = Watcher {
                api: self.clone(),
                session_id,
                created_us,
                sent: after_revision,
                include_mesh,
                heartbeat,
                topology: String::new(),
                shown: None,
                updates: Arc::new(updates),
            };
            let follow = async move {
                watcher.follow(snapshots).await;
                drop(place);
            };
            tokio::spawn(follow.in_current_span());
            Ok(replies)
        })
        .await
    }
}

impl Watcher {
    async fn follow(mut self, snapshots: watch::Receiver<Arc<Snapshot>>) {
        let (updates, stopping) = (self.updates.clone(), self.api.stopping.clone());
        let outcome = tokio::select! {
            outcome = self.follow_log(snapshots) => outcome,
            () = stopping.cancelled() => Err(Error::Draining),
            () = updates.closed() => Ok(()),
        };
        match outcome {
            Ok(()) => tracing::debug!("the watcher left"),
            Err(error) => {
                tracing::info!(%error, "a watch ended");
                updates.end(error);
            }
        }
    }

    /// Ends without error when the caller is gone.
    async fn follow_log(&mut self, mut snapshots: watch::Receiver<Arc<Snapshot>>) -> Result<(), Error> {
        let mut silence = 0;
        loop {
            snapshots.mark_unchanged();
            if self.send_new_events(&snapshots).await?.is_err() {
                return Ok(());
            }
            let changed = tokio::time::timeout(self.heartbeat, snapshots.changed()).await;
            match changed {
                Ok(Ok(())) => {}
                // Evicted, and then loaded again here, or removed, and then not found.
                Ok(Err(_)) => snapshots = self.subscribe_again().await?,
                Err(_elapsed) => {
                    silence += 1;
                    let heartbeat = Update::Heartbeat(v1::Ping { nonce: silence });
                    if self.send(heartbeat, None, Vec::new(), None).await.is_err() {
                        return Ok(());
                    }
                }
            }
        }
    }

    async fn subscribe_again(&self) -> Result<watch::Receiver<Arc<Snapshot>>, Error> {
        let snapshots = loop {
            match self.api.sessions.subscribe(&self.session_id, self.deadline()).await {
                Ok(snapshots) => break snapshots,
                Err(error) => try_again(error).await?,
            }
        };
        if snapshots.borrow().definition.created_us != self.created_us {
            return Err(Error::SessionNotFound { session_id: self.session_id.clone() });
        }
        Ok(snapshots)
    }

    /// Sends what the log has beyond the last event sent, up to the newest state: what is in the log and not
    /// acknowledged yet is no news.
    async fn send_new_events(
        &mut self,
        snapshots: &watch::Receiver<Arc<Snapshot>>,
    ) -> Result<Result<(), Gone>, Error> {
        let read_bytes = self.api.limits.read_bytes;
        loop {
            let store = &self.api.sessions.store;
            let unsent = snapshots.borrow().revision - self.sent;
            if unsent <= 0 {
                return Ok(Ok(()));
            }
            let newest = self.sent + unsent;
            let rows = store.events_within(&self.session_id, self.sent, PAGE.min(unsent), read_bytes).await?;
            if rows.is_empty() {
                return Ok(Ok(()));
            }
            let retractions = self.api.sessions.retractions(&self.session_id, newest).await?;
            for row in rows {
                if self.send_event(row, &retractions, snapshots).await?.is_err() {
                    return Ok(Err(Gone));
                }
            }
        }
    }

    async fn send_event(
        &mut self,
        row: Event,
        retractions: &Retractions,
        snapshots: &watch::Receiver<Arc<Snapshot>>,
    ) -> Result<Result<(), Gone>, Error> {
        let unreadable = |error: FoldError| Error::internal(error.to_string());
        let seq = row.seq;
        let (session, candidates) = event::reply_after(&row).map_err(unreadable)?;
        let session = match session {
            Some(session) => session,
            None => to_proto::session(&*self.at_revision(seq).await?),
        };
        let event = event::decode(row, false, retractions.of(seq)).map_err(unreadable)?;
        if self.send(Update::Event(event), Some(session.clone()), candidates, None).await.is_err() {
            return Ok(Err(Gone));
        }
        self.sent = seq;
        if !self.include_mesh {
            return Ok(Ok(()));
        }
        match self.mesh_at(seq, snapshots).await? {
            Some(made) if self.shown != Some(made.surface) => {
                let (mesh, rendering) = made.for_caller_with(&self.topology);
                self.topology = made.topology().to_owned();
                self.shown = Some(made.surface);
                // What is shared is not held while a slow reader is waited for.
                drop(made);
                Ok(self.send(Update::Mesh(mesh), Some(session), Vec::new(), Some(rendering)).await)
            }
            Some(_) | None => Ok(Ok(())),
        }
    }

    async fn at_revision(&self, seq: i64) -> Result<Arc<Snapshot>, Error> {
        let sessions = &self.api.sessions;
        loop {
            match sessions.at_revision(&self.session_id, seq, Queue::WATCHERS, self.deadline()).await {
                Ok(snapshot) => return Ok(snapshot),
                Err(error) => try_again(error).await?,
            }
        }
    }

    /// The mesh after the event `seq`; `None` while nothing was seen.
    async fn mesh_at(
        &self,
        seq: i64,
        snapshots: &watch::Receiver<Arc<Snapshot>>,
    ) -> Result<Option<Arc<MadeMesh>>, Error> {
        let newest = snapshots.borrow().clone();
        loop {
            let deadline = self.deadline();
            match self.api.made_mesh(&newest, seq, Form::Raw, Queue::WATCHERS, deadline).await {
                Ok(made) => return Ok(Some(made)),
                Err(Error::NoVisualPrior) => return Ok(None),
                Err(error) => try_again(error).await?,
            }
        }
    }

    async fn send(
        &self,
        update: Update,
        session: Option<v1::Session>,
        candidates: Vec<v1::Candidate>,
        rendering: Option<Rendering>,
    ) -> Result<(), Gone> {
        let message =
            v1::WatchSessionResponse { update: Some(update), session, candidates, hash_matches: false };
        let bytes = message.encoded_len();
        self.updates.send(WatchUpdate { message, rendering }, bytes).await
    }

    fn deadline(&self) -> Instant {
        Instant::now() + self.api.limits.call_timeout
    }
}

/// Waits a little where there was no room or no time: a watch does not end because others keep the server busy.
pub(super) async fn try_again(after: Error) -> Result<(), Error> {
    if !after.is_about_time() {
        return Err(after);
    }
    tokio::time::sleep(after.retry_after().unwrap_or(AGAIN_AFTER)).await;
    Ok(())
}

fn heartbeat_interval(wanted: Option<palpate_proto::Duration>, limits: &Limits) -> Result<Duration, Error> {
    let Some(wanted) = wanted else { return Ok(limits.heartbeat) };
    let (least, most) = (limits.heartbeat_min, limits.heartbeat_max);
    let interval = Duration::try_from(wanted).ok().filter(|interval| (least..=most).contains(interval));
    interval.ok_or_else(|| {
        let description = format!("is not between {} s and {} s", least.as_secs(), most.as_secs());
        Error::field("heartbeat", description)
    })
}
