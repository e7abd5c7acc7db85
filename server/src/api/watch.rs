//! Following a session: first what the log has, then each new event, with no gap between the two.
//!
//! The log is the only source of events; a published snapshot only says that there is more to read.

use std::sync::Arc;
use std::time::Duration;

use palpate_proto::v1;
use palpate_proto::v1::watch_session_response::Update;
use tokio::sync::{mpsc, watch};
use tokio::time::Instant;
use tracing::Instrument;

use super::{Api, Call, Replies, STREAM_BUFFER};
use crate::error::Error;
use crate::limits::Limits;
use crate::session::Snapshot;
use crate::sessions::FoldError;
use crate::store::EventRow;
use crate::wire::{event, to_proto};

/// Events read from the log at once.
const PAGE: i64 = 16;

type Sender = mpsc::Sender<Result<v1::WatchSessionResponse, Error>>;

/// One caller that follows a session.
struct Watcher {
    api: Api,
    session_id: String,
    /// The last event that was sent.
    sent: i64,
    include_mesh: bool,
    heartbeat: Duration,
    /// The etag of the faces that the caller has.
    topology: String,
    /// The state whose mesh was sent last.
    shown: Option<Arc<Snapshot>>,
    updates: Sender,
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
    ) -> Result<Replies<v1::WatchSessionResponse>, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("WatchSession", &session_id, &call, async |deadline| {
            let v1::WatchSessionRequest { session_id, after_revision, include_mesh, heartbeat } = request;
            let heartbeat = heartbeat_interval(heartbeat, &self.limits)?;
            let slot = self.stream_slot()?;
            let snapshots = self.sessions.subscribe(&session_id, deadline).await?;
            let revision = snapshots.borrow().revision;
            if !(0..=revision).contains(&after_revision) {
                let description =
                    format!("{after_revision} is not between 0 and the session's revision {revision}");
                return Err(Error::field("after_revision", description));
            }
            let (updates, receiver) = mpsc::channel(STREAM_BUFFER);
            let watcher = Watcher {
                api: self.clone(),
                session_id,
                sent: after_revision,
                include_mesh,
                heartbeat,
                topology: String::new(),
                shown: None,
                updates,
            };
            let follow = async move {
                watcher.follow(snapshots).await;
                drop(slot);
            };
            tokio::spawn(follow.in_current_span());
            Ok(Replies::new(receiver))
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
                // A reader whose buffer is full, or who is gone, only sees the stream end.
                let _ = updates.try_send(Err(error));
            }
        }
    }

    /// Ends without error when the caller is gone.
    async fn follow_log(&mut self, mut snapshots: watch::Receiver<Arc<Snapshot>>) -> Result<(), Error> {
        let mut silence = 0;
        loop {
            snapshots.mark_unchanged();
            if !self.send_new_events().await? {
                return Ok(());
            }
            let changed = tokio::time::timeout(self.heartbeat, snapshots.changed()).await;
            match changed {
                Ok(Ok(())) => {}
                // Evicted, and then loaded again here, or removed, and then not found.
                Ok(Err(_)) => {
                    snapshots = self.api.sessions.subscribe(&self.session_id, self.deadline()).await?;
                }
                Err(_elapsed) => {
                    silence += 1;
                    let heartbeat = Update::Heartbeat(v1::Ping { nonce: silence });
                    if !self.send(heartbeat, None, Vec::new()).await {
                        return Ok(());
                    }
                }
            }
        }
    }

    /// Sends what the log has beyond the last event sent; false when the caller is gone.
    async fn send_new_events(&mut self) -> Result<bool, Error> {
        loop {
            let rows = self.api.sessions.store.events(&self.session_id, self.sent, PAGE).await?;
            if rows.is_empty() {
                return Ok(true);
            }
            for row in rows {
                if !self.send_event(row).await? {
                    return Ok(false);
                }
            }
        }
    }

    async fn send_event(&mut self, row: EventRow) -> Result<bool, Error> {
        let unreadable = |error: FoldError| Error::internal(error.to_string());
        let seq = row.seq;
        let (session, candidates) = event::reply_after(&row).map_err(unreadable)?;
        let session = match session {
            Some(session) => session,
            None => to_proto::session(&*self.at_revision(seq).await?),
        };
        let session = Some(session);
        let event = event::decode(row, false).map_err(unreadable)?;
        if !self.send(Update::Event(event), session.clone(), candidates).await {
            return Ok(false);
        }
        self.sent = seq;
        if self.include_mesh && self.surface_changed(seq).await? {
            let topology = self.topology.clone();
            let mesh = self.api.raw_mesh(&self.session_id, seq, topology, self.deadline()).await?;
            if let Some(v1::mesh::Body::Raw(raw)) = &mesh.body {
                self.topology.clone_from(&raw.topology_etag);
            }
            return Ok(self.send(Update::Mesh(mesh), session, Vec::new()).await);
        }
        Ok(true)
    }

    async fn at_revision(&self, seq: i64) -> Result<Arc<Snapshot>, Error> {
        self.api.sessions.at_revision(&self.session_id, seq, self.deadline()).await
    }

    /// Whether the event `seq` gave another surface than the one that was sent last.
    async fn surface_changed(&mut self, seq: i64) -> Result<bool, Error> {
        let snapshot = self.at_revision(seq).await?;
        let changed = match &self.shown {
            Some(shown) => !snapshot.reconstruction.has_surface_of(&shown.reconstruction),
            None => snapshot.reconstruction.last_estimate().is_some(),
        };
        self.shown = Some(snapshot);
        Ok(changed)
    }

    async fn send(
        &self,
        update: Update,
        session: Option<v1::Session>,
        candidates: Vec<v1::Candidate>,
    ) -> bool {
        let message =
            v1::WatchSessionResponse { update: Some(update), session, candidates, hash_matches: false };
        self.updates.send(Ok(message)).await.is_ok()
    }

    fn deadline(&self) -> Instant {
        Instant::now() + self.api.limits.call_timeout
    }
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
