//! The robot's whole loop on one stream: messages are answered one by one, in order.
//!
//! ```text
//! (new) --open--> (open) --visual_prior, result, propose, ping--> (open) --end of requests--> (done)
//! ```
//!
//! A message that fails is answered by a problem and the stream goes on. What was accepted is in the
//! log, so after a broken stream the robot opens another one and gets the replies that it missed.

use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use palpate_proto::v1::explore_request::Message as RequestMessage;
use palpate_proto::v1::explore_response::Message as ReplyMessage;
use prost::Message;
use tokio::time::Instant;
use tokio_stream::{Stream, StreamExt};
use tracing::Instrument;

use super::exploration::FieldNames;
use super::mesh::Form;
use super::outbox::{self, Gone, Outbox};
use super::places::Place;
use super::{Api, Call, Replies, request_key, stored};
use crate::access::Caller;
use crate::compute::{Queue, on_account};
use crate::error::{Error, FieldViolation};
use crate::wire::{from_proto, to_proto};

/// Missed replies read from the log at once, if their events are not large.
const PAGE: i64 = 16;

const NAMES: FieldNames = FieldNames {
    prior: "visual_prior",
    propose: "open.top_k",
    robot: "open.robot",
    lease: "propose.lease",
    explain: "propose.explain_vertices",
};

/// One stream, once it is open.
struct Exploration {
    session_id: String,
    robot: Option<v1::RobotContext>,
    top_k: u32,
    send_mesh: bool,
    /// The etag of the faces that the caller has.
    topology: String,
}

/// A stream as the server sees it: what it knows of the caller, and where its replies go.
struct ExploreStream {
    api: Api,
    caller: Caller,
    open: Option<Exploration>,
    place: Place,
    replies: Outbox<v1::ExploreResponse>,
}

impl Api {
    /// Runs the exploration loop over a stream of messages.
    ///
    /// # Errors
    /// Too many streams are open; later failures are problems within the stream, or its last item.
    pub(crate) async fn explore(
        &self,
        messages: impl Stream<Item = Result<v1::ExploreRequest, Error>> + Send + Unpin + 'static,
        call: Call,
    ) -> Result<Replies<v1::ExploreResponse>, Error> {
        self.run("Explore", "", &call, async |_| {
            let place = self.places.take(call.peer, &self.limits)?;
            let (outbox, replies) = outbox::stream(&self.limits);
            let (api, caller) = (self.clone(), call.caller.clone());
            let stream = ExploreStream { api, caller, open: None, place, replies: outbox };
            let account = call.caller.account().clone();
            tokio::spawn(on_account(account, stream.run(messages)).in_current_span());
            Ok(replies)
        })
        .await
    }
}

impl ExploreStream {
    async fn run(mut self, mut messages: impl Stream<Item = Result<v1::ExploreRequest, Error>> + Unpin) {
        let stopping = self.api.stopping.clone();
        loop {
            let next = tokio::select! {
                next = messages.next() => next,
                () = stopping.cancelled() => Some(Err(Error::Draining)),
                () = self.replies.closed() => None,
            };
            match next {
                None => return,
                Some(Err(error)) => {
                    // Either the caller's stream broke or the server stops: nothing comes after it.
                    self.replies.end(error);
                    return;
                }
                Some(Ok(message)) => {
                    if self.handle(message).await.is_err() {
                        return;
                    }
                }
            }
        }
    }

    async fn handle(&mut self, request: v1::ExploreRequest) -> Result<(), Gone> {
        let v1::ExploreRequest { id, request_id, message } = request;
        let started = Instant::now();
        let deadline = started + self.api.limits.call_timeout;
        let resumed_after = match &message {
            Some(RequestMessage::Open(open)) => open.resume_after_revision,
            _ => 0,
        };
        let kind = match &message {
            None => "Explore",
            Some(RequestMessage::Ping(_)) => "Explore.ping",
            Some(RequestMessage::Open(_)) => "Explore.open",
            Some(RequestMessage::VisualPrior(_)) => "Explore.visual_prior",
            Some(RequestMessage::Result(_)) => "Explore.result",
            Some(RequestMessage::Propose(_)) => "Explore.propose",
        };
        let outcome = match message {
            None => Err(Error::field("message", "is missing")),
            Some(RequestMessage::Ping(ping)) => Ok(vec![ReplyMessage::Pong(ping)]),
            Some(RequestMessage::Open(open)) => self.open(open, deadline).await,
            Some(RequestMessage::VisualPrior(prior)) => self.add_prior(prior, request_id, deadline).await,
            Some(RequestMessage::Result(result)) => self.report(result, request_id, deadline).await,
            Some(RequestMessage::Propose(propose)) => self.propose(propose, request_id, deadline).await,
        };
        let session_id = self.open.as_ref().map_or("", |open| open.session_id.as_str());
        tracing::info_span!("explore", session_id, id)
            .in_scope(|| super::log(outcome.as_ref().err(), started));
        self.api.metrics().call(kind, outcome.as_ref().err(), started.elapsed());
        let was_resumed = outcome.is_ok() && resumed_after > 0;
        let replies = outcome.unwrap_or_else(|error| vec![ReplyMessage::Problem(problem(&error))]);
        for reply in replies {
            self.reply(id, reply).await?;
        }
        if was_resumed { self.send_missed(id, resumed_after).await } else { Ok(()) }
    }

    async fn reply(&self, id: u64, message: ReplyMessage) -> Result<(), Gone> {
        let revision = match &message {
            ReplyMessage::Opened(session) => session.revision,
            ReplyMessage::Accepted(reply) => reply.session.as_ref().map_or(0, |session| session.revision),
            ReplyMessage::Prior(reply) => reply.session.as_ref().map_or(0, |session| session.revision),
            ReplyMessage::Candidates(reply) => reply.revision,
            ReplyMessage::Mesh(mesh) => mesh.revision,
            ReplyMessage::Problem(_) | ReplyMessage::Pong(_) => self.known_revision(),
        };
        let reply = v1::ExploreResponse { in_reply_to: id, revision, message: Some(message) };
        let bytes = reply.encoded_len();
        self.replies.send(reply, bytes).await
    }

    fn known_revision(&self) -> i64 {
        let open = self.open.as_ref();
        let snapshot = open.and_then(|open| self.api.sessions.loaded(&open.session_id));
        snapshot.map_or(0, |snapshot| snapshot.revision)
    }

    async fn open(&mut self, open: v1::ExploreOpen, deadline: Instant) -> Result<Vec<ReplyMessage>, Error> {
        let v1::ExploreOpen { session_id, robot, top_k, send_mesh, resume_after_revision } = open;
        if self.open.is_some() {
            return Err(Error::field("open", "came before: a stream explores one session"));
        }
        from_proto::exploration_request(NAMES.propose, top_k, NAMES.robot, robot.as_ref(), &self.api.limits)?;
        from_proto::check_session_named("open.session_id", &session_id)?;
        self.api.check_visible(&session_id, &self.caller).await?;
        let snapshot = self.api.sessions.newest(&session_id, deadline).await?;
        if !(0..=snapshot.revision).contains(&resume_after_revision) {
            let revision = snapshot.revision;
            let description =
                format!("{resume_after_revision} is not between 0 and the session's revision {revision}");
            return Err(Error::field("open.resume_after_revision", description));
        }
        self.place.enter(&session_id, &self.api.limits)?;
        let opened = ReplyMessage::Opened(to_proto::session(&snapshot));
        self.open = Some(Exploration { session_id, robot, top_k, send_mesh, topology: String::new() });
        Ok(vec![opened])
    }

    /// Sends the replies that a broken stream may have swallowed, as they are read from the log. Where that
    /// fails the stream ends, and the robot opens it again.
    async fn send_missed(&self, id: u64, mut after: i64) -> Result<(), Gone> {
        loop {
            let (missed, last) = match self.missed(after).await {
                Ok(missed) => missed,
                Err(error) => {
                    self.replies.end(error);
                    return Err(Gone);
                }
            };
            for reply in missed {
                self.reply(id, reply).await?;
            }
            let Some(last) = last else { return Ok(()) };
            after = last;
        }
    }

    /// A few of those replies, and the last event that was looked at; `None` at the end of the log.
    async fn missed(&self, after: i64) -> Result<(Vec<ReplyMessage>, Option<i64>), Error> {
        let session_id = self.open.as_ref().map_or("", |open| open.session_id.as_str());
        let read_bytes = self.api.limits.read_bytes;
        let rows = self.api.sessions.store.events_within(session_id, after, PAGE, read_bytes).await?;
        let mut missed = Vec::new();
        for row in &rows {
            let kind = crate::wire::event::kind(row.seq, &row.payload);
            match kind.map_err(|error| Error::internal(error.to_string()))? {
                Kind::VisualPrior(_) => missed.push(ReplyMessage::Prior(stored(&row.reply)?)),
                Kind::ContactResult(_) => missed.push(ReplyMessage::Accepted(stored(&row.reply)?)),
                Kind::Lease(_) => missed.push(ReplyMessage::Candidates(stored(&row.reply)?)),
                Kind::Created(_)
                | Kind::Forked(_)
                | Kind::RetractedSeq(_)
                | Kind::Updated(_)
                | Kind::Finished(_) => {}
            }
        }
        Ok((missed, rows.last().map(|row| row.seq)))
    }

    async fn add_prior(
        &mut self,
        prior: v1::VisualPrior,
        request_id: String,
        deadline: Instant,
    ) -> Result<Vec<ReplyMessage>, Error> {
        let open = self.open.as_ref().ok_or_else(not_open)?;
        let session_id = open.session_id.clone();
        let request =
            v1::AddVisualPriorRequest { session_id, prior: Some(prior), request_id, ..Default::default() };
        // The key is that of the view alone: a stream opened anew may ask for other candidates.
        let key = request_key(&request.request_id, &request, &self.api.limits)?;
        let request = v1::AddVisualPriorRequest { propose: open.top_k, ..request };
        let robot = open.robot.as_ref();
        let reply = self.api.add_prior(request, robot, key, self.caller.actor(), NAMES, deadline).await?;
        let revision = reply.session.as_ref().map_or(0, |session| session.revision);
        self.with_mesh(ReplyMessage::Prior(reply), revision, deadline).await
    }

    async fn report(
        &mut self,
        result: v1::ContactResult,
        request_id: String,
        deadline: Instant,
    ) -> Result<Vec<ReplyMessage>, Error> {
        let open = self.open.as_ref().ok_or_else(not_open)?;
        let session_id = open.session_id.clone();
        let request =
            v1::ReportContactRequest { session_id, result: Some(result), request_id, ..Default::default() };
        let key = request_key(&request.request_id, &request, &self.api.limits)?;
        let request = v1::ReportContactRequest { propose: open.top_k, robot: open.robot.clone(), ..request };
        let reply = self.api.report(request, key, self.caller.actor(), NAMES, deadline).await?;
        let revision = reply.seq;
        self.with_mesh(ReplyMessage::Accepted(reply), revision, deadline).await
    }

    async fn propose(
        &self,
        mut request: v1::ProposeContactsRequest,
        request_id: String,
        deadline: Instant,
    ) -> Result<Vec<ReplyMessage>, Error> {
        let open = self.open.as_ref().ok_or_else(not_open)?;
        if !request.session_id.is_empty() && request.session_id != open.session_id {
            let description =
                format!("{:?} is not the session that this stream explores", request.session_id);
            return Err(Error::field("propose.session_id", description));
        }
        request.session_id.clone_from(&open.session_id);
        if request.request_id.is_empty() {
            request.request_id = request_id;
        }
        let mut names = FieldNames { propose: "propose.top_k", robot: "propose.robot", ..NAMES };
        if request.robot.is_none() {
            request.robot.clone_from(&open.robot);
            names.robot = NAMES.robot;
        }
        Ok(vec![ReplyMessage::Candidates(
            self.api.propose(request, self.caller.actor(), names, deadline).await?,
        )])
    }

    /// The reply, and after it the mesh if the caller wants meshes.
    async fn with_mesh(
        &mut self,
        reply: ReplyMessage,
        revision: i64,
        deadline: Instant,
    ) -> Result<Vec<ReplyMessage>, Error> {
        let Some(open) = self.open.as_mut().filter(|open| open.send_mesh) else { return Ok(vec![reply]) };
        let made = async {
            let newest = self.api.sessions.newest(&open.session_id, deadline).await?;
            self.api.made_mesh(&newest, revision, Form::Raw, Queue::EXPLORERS, deadline).await
        };
        match made.await {
            Ok(made) => {
                let (mesh, _) = made.for_caller_with(&open.topology);
                open.topology = made.topology().to_owned();
                Ok(vec![reply, ReplyMessage::Mesh(mesh)])
            }
            // What was accepted stays accepted, and the caller must know both.
            Err(error) => Ok(vec![reply, ReplyMessage::Problem(problem(&error))]),
        }
    }
}

fn not_open() -> Error {
    Error::field("message", "the stream is not open: send open with a session_id first")
}

fn problem(error: &Error) -> v1::Problem {
    let field = |violation: &FieldViolation| v1::FieldViolation {
        field: violation.field.clone(),
        description: violation.description.clone(),
    };
    v1::Problem {
        code: error.grpc_code().into(),
        message: error.to_string(),
        fields: error.fields().iter().map(field).collect(),
        reason: error.reason().to_owned(),
    }
}
