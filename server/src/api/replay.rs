//! The steps of a session again, as the log has them or computed anew.

use std::sync::Arc;

use palpate_proto::v1;
use palpate_proto::v1::watch_session_response::Update;
use prost::Message;
use tokio::time::Instant;
use tracing::Instrument;

use super::mesh::Form;
use super::outbox::{self, Gone, Outbox};
use super::watch::try_again;
use super::{Api, Call, Replies};
use crate::compute::Queue;
use crate::error::Error;
use crate::session::Snapshot;
use crate::sessions::{Aggregate, FoldError, FreshFold};
use crate::store::Event;
use crate::wire::{event, to_proto};

/// Events read from the log at once, if they are not large.
const PAGE: i64 = 16;

/// A replay on its way to one caller.
struct Replay {
    api: Api,
    session_id: String,
    /// The next event to show, and the last one.
    next: i64,
    to: i64,
    include_mesh: bool,
    /// The computation that goes along, where states are to be verified.
    verifying: Option<FreshFold<Snapshot>>,
    /// The etag of the faces that the caller has, and the surface that was sent last.
    topology: String,
    shown: Option<[u8; 32]>,
    replies: Outbox<v1::WatchSessionResponse>,
}

impl Api {
    /// Shows the events of a session again, each with the session after it.
    ///
    /// # Errors
    /// No such session or revision; later failures are the stream's last item.
    pub(crate) async fn replay_session(
        &self,
        request: v1::ReplaySessionRequest,
        call: Call,
    ) -> Result<Replies<v1::WatchSessionResponse>, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("ReplaySession", &session_id, &call, async |_| {
            let v1::ReplaySessionRequest { session_id, from_revision, to_revision, include_mesh, verify } =
                request;
            let mut place = self.places.take(call.peer, &self.limits)?;
            let row = self.sessions.store.session(&session_id).await?;
            let head = row.ok_or_else(|| Error::SessionNotFound { session_id: session_id.clone() })?.head;
            let (from, to) = (from_revision.max(1), if to_revision == 0 { head } else { to_revision });
            check_between("from_revision", from_revision, 0, head)?;
            check_between("to_revision", to, from, head)?;
            place.enter(&session_id, &self.limits)?;
            let (replies, stream) = outbox::stream(&self.limits);
            let replay = Replay {
                api: self.clone(),
                session_id,
                next: from,
                to,
                include_mesh,
                verifying: verify.then(FreshFold::default),
                topology: String::new(),
                shown: None,
                replies,
            };
            let run = async move {
                replay.run().await;
                drop(place);
            };
            tokio::spawn(run.in_current_span());
            Ok(stream)
        })
        .await
    }
}

impl Replay {
    async fn run(mut self) {
        let stopping = self.api.stopping.clone();
        let outcome = tokio::select! {
            outcome = self.show_all() => outcome,
            () = stopping.cancelled() => Err(Error::Draining),
        };
        if let Err(error) = outcome {
            tracing::info!(%error, "a replay ended");
            self.replies.end(error);
        }
    }

    /// Ends without error when the caller is gone.
    async fn show_all(&mut self) -> Result<(), Error> {
        let read_bytes = self.api.limits.read_bytes;
        let retractions = self.api.sessions.retractions(&self.session_id, i64::MAX).await?;
        while self.next <= self.to {
            let count = PAGE.min(self.to - self.next + 1);
            let store = &self.api.sessions.store;
            let rows = store.events_within(&self.session_id, self.next - 1, count, read_bytes).await?;
            if rows.is_empty() {
                return Err(Error::SessionNotFound { session_id: self.session_id.clone() });
            }
            for row in rows {
                let retracted_by = retractions.of(row.seq);
                if self.show(row, retracted_by).await?.is_err() {
                    return Ok(());
                }
                self.next += 1;
            }
        }
        Ok(())
    }

    async fn show(&mut self, row: Event, retracted_by: Option<i64>) -> Result<Result<(), Gone>, Error> {
        let unreadable = |error: FoldError| Error::internal(error.to_string());
        let seq = row.seq;
        let (mut session, candidates) = event::reply_after(&row).map_err(unreadable)?;
        let mut hash_matches = false;
        if self.verifying.is_some() {
            let state = self.computed_at(seq).await?;
            if state.revision != seq {
                // The log is damaged before this event: the state says how.
                state.check_open()?;
            }
            hash_matches = state.state_hash() == row.state_hash;
            session = Some(to_proto::session(&state));
        }
        let session = match session {
            Some(session) => session,
            None => to_proto::session(&*self.state_at(seq).await?),
        };
        let event = event::decode(row, false, retracted_by).map_err(unreadable)?;
        let update = v1::WatchSessionResponse {
            update: Some(Update::Event(event)),
            session: Some(session.clone()),
            candidates,
            hash_matches,
        };
        if self.send(update).await.is_err() {
            return Ok(Err(Gone));
        }
        if !self.include_mesh {
            return Ok(Ok(()));
        }
        let Some(mesh) = self.new_mesh_at(seq).await? else { return Ok(Ok(())) };
        let update = v1::WatchSessionResponse {
            update: Some(Update::Mesh(mesh)),
            session: Some(session),
            ..Default::default()
        };
        Ok(self.send(update).await)
    }

    /// The state after the event `seq`, computed from the log alone.
    async fn computed_at(&mut self, seq: i64) -> Result<Arc<Snapshot>, Error> {
        let (sessions, deadline) = (self.api.sessions.clone(), self.deadline());
        let mut fold = self.verifying.take().unwrap_or_default();
        let state = loop {
            match sessions.fold_afresh(&self.session_id, &mut fold, seq, Queue::WATCHERS, deadline).await {
                Ok(state) => break state,
                Err(error) => try_again(error).await?,
            }
        };
        self.verifying = Some(fold);
        Ok(state)
    }

    async fn state_at(&self, seq: i64) -> Result<Arc<Snapshot>, Error> {
        loop {
            let sessions = &self.api.sessions;
            match sessions.at_revision(&self.session_id, seq, Queue::WATCHERS, self.deadline()).await {
                Ok(state) => return Ok(state),
                Err(error) => try_again(error).await?,
            }
        }
    }

    /// The mesh after the event `seq`, if there is one and it is not the one that was sent last.
    async fn new_mesh_at(&mut self, seq: i64) -> Result<Option<v1::Mesh>, Error> {
        let newest = self.state_at(0).await?;
        let made = loop {
            match self.api.made_mesh(&newest, seq, Form::Raw, Queue::WATCHERS, self.deadline()).await {
                Ok(made) => break made,
                Err(Error::NoVisualPrior) => return Ok(None),
                Err(error) => try_again(error).await?,
            }
        };
        if self.shown == Some(made.surface) {
            return Ok(None);
        }
        let (mesh, _rendering) = made.for_caller_with(&self.topology);
        self.topology = made.topology().to_owned();
        self.shown = Some(made.surface);
        Ok(Some(mesh))
    }

    async fn send(&self, update: v1::WatchSessionResponse) -> Result<(), Gone> {
        let bytes = update.encoded_len();
        self.replies.send(update, bytes).await
    }

    fn deadline(&self) -> Instant {
        Instant::now() + self.api.limits.recompute_timeout
    }
}

fn check_between(field: &str, revision: i64, least: i64, head: i64) -> Result<(), Error> {
    if (least..=head).contains(&revision) {
        return Ok(());
    }
    Err(Error::field(field, format!("{revision} is not between {least} and the session's revision {head}")))
}
