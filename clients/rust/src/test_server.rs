//! A server in the test's own process that follows a script: it answers, fails or hangs as told, and keeps what it saw.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use palpate_proto::v1::exploration_service_server::{ExplorationService, ExplorationServiceServer};
use palpate_proto::v1::reconstruction_service_server::{ReconstructionService, ReconstructionServiceServer};
use palpate_proto::v1::{
    AddVisualPriorRequest, AddVisualPriorResponse, DeleteReferenceRequest, DeleteReferenceResponse,
    EvaluateSessionRequest, EvaluateSessionResponse, Event, ExploreRequest, ExploreResponse, FieldViolation,
    GetMeshRequest, GetReferenceRequest, GetSeriesRequest, GetSeriesResponse, ListEventsRequest,
    ListEventsResponse, Mesh, Problem, ProposeContactsRequest, ProposeContactsResponse, Reference,
    ReplaySessionRequest, ReportContactRequest, ReportContactResponse, RetractEventRequest, Session,
    SetReferenceRequest, WatchSessionRequest, WatchSessionResponse, explore_request, explore_response,
    watch_session_response,
};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Notify;
use tokio_stream::StreamExt;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::codegen::BoxStream;
use tonic::transport::Server;
use tonic::{Code, Request, Response, Status, Streaming};

use crate::{Client, ClientBuilder, RetryPolicy};

/// What the server does with the next request; with the script at its end it answers.
#[derive(Debug)]
pub(crate) enum Step {
    Answer,
    /// Fails the call, or ends the stream.
    Fail(Status),
    /// Refuses a message and leaves its stream open.
    Problem,
    /// Never answers.
    Hang,
}

/// A running server.
#[derive(Debug)]
pub(crate) struct Scripted {
    address: SocketAddr,
    state: Arc<State>,
}

#[derive(Debug, Default)]
struct State {
    script: Mutex<VecDeque<Step>>,
    request_ids: Mutex<Vec<String>>,
    deadlines: Mutex<Vec<String>>,
    resumed_after: Mutex<Vec<i64>>,
    accepted: Mutex<i64>,
    hanging: Notify,
}

/// The services, which follow the state's script.
struct Service(Arc<State>);

impl Scripted {
    pub(crate) async fn start(script: Vec<Step>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let state = Arc::new(State { script: Mutex::new(script.into()), ..State::default() });
        let server = Server::builder()
            .add_service(ExplorationServiceServer::new(Service(state.clone())))
            .add_service(ReconstructionServiceServer::new(Service(state.clone())))
            .serve_with_incoming(TcpListenerStream::new(listener));
        tokio::spawn(server);
        Self { address, state }
    }

    pub(crate) fn builder(&self) -> ClientBuilder {
        builder(self.address)
    }

    pub(crate) async fn client(&self) -> Client {
        self.builder().connect().await.unwrap()
    }

    /// A client behind a proxy whose first connection is cut as soon as the server hangs.
    pub(crate) async fn client_whose_first_connection_breaks(&self) -> Client {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let proxy = listener.local_addr().unwrap();
        let (server, state) = (self.address, self.state.clone());
        tokio::spawn(async move {
            loop {
                let (mut near, _) = listener.accept().await.unwrap();
                let mut far = TcpStream::connect(server).await.unwrap();
                tokio::select! {
                    _ = tokio::io::copy_bidirectional(&mut near, &mut far) => {}
                    () = state.hanging.notified() => {}
                }
            }
        });
        builder(proxy).connect().await.unwrap()
    }

    /// The request ids that arrived, in order.
    pub(crate) fn request_ids(&self) -> Vec<String> {
        self.state.request_ids.lock().unwrap().clone()
    }

    /// The `grpc-timeout` of the reports that arrived, in order.
    pub(crate) fn deadlines(&self) -> Vec<String> {
        self.state.deadlines.lock().unwrap().clone()
    }

    /// The revision after which each stream was opened, in order.
    pub(crate) fn resumed_after(&self) -> Vec<i64> {
        self.state.resumed_after.lock().unwrap().clone()
    }
}

/// A client that does not wait long between its attempts.
fn builder(address: SocketAddr) -> ClientBuilder {
    Client::builder(&address.to_string())
        .retry(RetryPolicy { first_wait: Duration::from_millis(1), ..RetryPolicy::default() })
}

impl State {
    fn next_step(&self) -> Step {
        self.script.lock().unwrap().pop_front().unwrap_or(Step::Answer)
    }

    fn accept(&self) -> i64 {
        let mut accepted = self.accepted.lock().unwrap();
        *accepted += 1;
        *accepted
    }

    /// What the server says to one message of an exploration stream.
    fn explore_step(&self, request: ExploreRequest) -> Vec<Result<ExploreResponse, Status>> {
        use explore_request::Message as Said;
        use explore_response::Message as Answer;

        let answers = match request.message {
            Some(Said::Open(open)) => {
                let resumed_after = open.resume_after_revision;
                self.resumed_after.lock().unwrap().push(resumed_after);
                let session_id = open.session_id;
                vec![Answer::Opened(Session { session_id, ..Default::default() })]
            }
            Some(Said::Ping(ping)) => vec![Answer::Pong(ping)],
            Some(Said::Propose(_)) => vec![Answer::Candidates(ProposeContactsResponse {
                revision: *self.accepted.lock().unwrap(),
                ..Default::default()
            })],
            _ => {
                self.request_ids.lock().unwrap().push(request.request_id);
                match self.next_step() {
                    Step::Fail(status) => return vec![Err(status)],
                    Step::Problem => vec![Answer::Problem(Problem {
                        code: Code::InvalidArgument.into(),
                        reason: "FIELD_INVALID".to_owned(),
                        message: "one field is wrong".to_owned(),
                        fields: vec![FieldViolation {
                            field: "result".to_owned(),
                            description: "is required".to_owned(),
                        }],
                    })],
                    Step::Answer | Step::Hang => {
                        let seq = self.accept();
                        let accepted = ReportContactResponse { seq, ..Default::default() };
                        let mesh = Mesh { revision: seq, ..Default::default() };
                        vec![Answer::Accepted(accepted), Answer::Mesh(mesh)]
                    }
                }
            }
        };
        let revision = *self.accepted.lock().unwrap();
        let respond =
            |message| Ok(ExploreResponse { in_reply_to: request.id, revision, message: Some(message) });
        answers.into_iter().map(respond).collect()
    }
}

fn not_scripted<T>() -> Result<Response<T>, Status> {
    Err(Status::unimplemented("no test needs this"))
}

#[tonic::async_trait]
impl ExplorationService for Service {
    async fn report_contact(
        &self,
        request: Request<ReportContactRequest>,
    ) -> Result<Response<ReportContactResponse>, Status> {
        if let Some(deadline) = request.metadata().get("grpc-timeout") {
            let deadline = deadline.to_str().unwrap().to_owned();
            self.0.deadlines.lock().unwrap().push(deadline);
        }
        let request_id = request.into_inner().request_id;
        self.0.request_ids.lock().unwrap().push(request_id);
        match self.0.next_step() {
            Step::Answer | Step::Problem => {
                let seq = self.0.accept();
                Ok(Response::new(ReportContactResponse { seq, ..Default::default() }))
            }
            Step::Fail(status) => Err(status),
            Step::Hang => {
                self.0.hanging.notify_waiters();
                std::future::pending().await
            }
        }
    }

    type ExploreStream = BoxStream<ExploreResponse>;

    async fn explore(
        &self,
        request: Request<Streaming<ExploreRequest>>,
    ) -> Result<Response<Self::ExploreStream>, Status> {
        let state = self.0.clone();
        let (sender, receiver) = tokio::sync::mpsc::channel(1);
        let mut requests = request.into_inner();
        tokio::spawn(async move {
            while let Some(Ok(request)) = requests.next().await {
                for response in state.explore_step(request) {
                    if sender.send(response).await.is_err() {
                        return;
                    }
                }
            }
        });
        let responses = tokio_stream::wrappers::ReceiverStream::new(receiver);
        Ok(Response::new(Box::pin(responses)))
    }

    async fn add_visual_prior(
        &self,
        _: Request<AddVisualPriorRequest>,
    ) -> Result<Response<AddVisualPriorResponse>, Status> {
        not_scripted()
    }

    async fn propose_contacts(
        &self,
        _: Request<ProposeContactsRequest>,
    ) -> Result<Response<ProposeContactsResponse>, Status> {
        not_scripted()
    }

    async fn retract_event(&self, _: Request<RetractEventRequest>) -> Result<Response<Session>, Status> {
        not_scripted()
    }
}

#[tonic::async_trait]
impl ReconstructionService for Service {
    type WatchSessionStream = BoxStream<WatchSessionResponse>;
    type ReplaySessionStream = BoxStream<WatchSessionResponse>;

    /// Each step of the script is an event or a broken stream; the script's end ends the stream.
    async fn watch_session(
        &self,
        request: Request<WatchSessionRequest>,
    ) -> Result<Response<Self::WatchSessionStream>, Status> {
        let after_revision = request.into_inner().after_revision;
        self.0.resumed_after.lock().unwrap().push(after_revision);
        let mut updates = Vec::new();
        while let Some(step) = self.0.script.lock().unwrap().pop_front() {
            if let Step::Fail(status) = step {
                updates.push(Err(status));
                break;
            }
            let event = Event { seq: self.0.accept(), ..Default::default() };
            updates.push(Ok(WatchSessionResponse {
                update: Some(watch_session_response::Update::Event(event)),
                ..Default::default()
            }));
        }
        Ok(Response::new(Box::pin(tokio_stream::iter(updates))))
    }

    async fn get_mesh(&self, _: Request<GetMeshRequest>) -> Result<Response<Mesh>, Status> {
        not_scripted()
    }

    async fn list_events(
        &self,
        _: Request<ListEventsRequest>,
    ) -> Result<Response<ListEventsResponse>, Status> {
        not_scripted()
    }

    async fn replay_session(
        &self,
        _: Request<ReplaySessionRequest>,
    ) -> Result<Response<Self::ReplaySessionStream>, Status> {
        not_scripted()
    }

    async fn evaluate_session(
        &self,
        _: Request<EvaluateSessionRequest>,
    ) -> Result<Response<EvaluateSessionResponse>, Status> {
        not_scripted()
    }

    async fn get_series(&self, _: Request<GetSeriesRequest>) -> Result<Response<GetSeriesResponse>, Status> {
        not_scripted()
    }

    async fn set_reference(&self, _: Request<SetReferenceRequest>) -> Result<Response<Reference>, Status> {
        not_scripted()
    }

    async fn get_reference(&self, _: Request<GetReferenceRequest>) -> Result<Response<Reference>, Status> {
        not_scripted()
    }

    async fn delete_reference(
        &self,
        _: Request<DeleteReferenceRequest>,
    ) -> Result<Response<DeleteReferenceResponse>, Status> {
        not_scripted()
    }
}
