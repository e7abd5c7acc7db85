//! The calls of the three services, each with its deadline and its retries.

use std::future::Future;
use std::time::Duration;

use palpate_proto::v1::exploration_service_client::ExplorationServiceClient;
use palpate_proto::v1::reconstruction_service_client::ReconstructionServiceClient;
use palpate_proto::v1::session_service_client::SessionServiceClient;
use palpate_proto::v1::{
    AddVisualPriorRequest, AddVisualPriorResponse, CreateSessionRequest, DeleteReferenceRequest,
    DeleteSessionRequest, EvaluateSessionRequest, EvaluateSessionResponse, ExperimentSummary, ExploreOpen,
    FinishSessionRequest, ForkSessionRequest, GetMeshRequest, GetReferenceRequest, GetSeriesRequest,
    GetSeriesResponse, GetServerInfoRequest, GetSessionRequest, ListEventsRequest, ListEventsResponse,
    ListExperimentsRequest, ListExperimentsResponse, ListSessionsRequest, ListSessionsResponse, Mesh,
    ProposeContactsRequest, ProposeContactsResponse, Reference, ReportContactRequest, ReportContactResponse,
    RetractEventRequest, ServerInfo, Session, SetReferenceRequest, SummarizeExperimentRequest,
    UpdateSessionRequest, WatchSessionRequest,
};
use tokio::time::timeout;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::Channel;
use tonic::{Code, Request, Response, Status};

use crate::builder::Bearer;
use crate::retry::ensure_request_id;
use crate::routing::{About, routed};
use crate::{ClientBuilder, Error, Exploration, RetryPolicy, Watch};

/// A mesh of the finest tessellation fits with room to spare; tonic's own limit is 4 MiB.
const MAX_REPLY_BYTES: usize = 64 * 1024 * 1024;

/// A channel whose calls say who makes them.
pub(crate) type Connection = InterceptedService<Channel, Bearer>;

/// A connection to a Palpate server; cheap to clone, and clones share the connection.
///
/// Every method fails with [`Error::Refused`] when the server says no, and with [`Error::NoAnswer`] when it says
/// nothing in any attempt.
#[derive(Debug, Clone)]
pub struct Client {
    channel: Connection,
    deadline: Duration,
    retry: RetryPolicy,
}

impl Client {
    /// Connects to the server at `url`, for instance `http://127.0.0.1:7257`, with the default settings.
    ///
    /// # Errors
    /// [`Error::Url`] when the address cannot be one, [`Error::Connect`] when nobody answers there.
    pub async fn connect(url: &str) -> Result<Self, Error> {
        Self::builder(url).connect().await
    }

    /// Starts a client with other settings than the default ones.
    pub fn builder(url: &str) -> ClientBuilder {
        ClientBuilder::new(url)
    }

    pub(crate) fn over(channel: Connection, deadline: Duration, retry: RetryPolicy) -> Self {
        Self { channel, deadline, retry }
    }

    /// Creates a session, which then awaits its visual prior.
    pub async fn create_session(&self, mut request: CreateSessionRequest) -> Result<Session, Error> {
        ensure_request_id(&mut request.request_id);
        self.call(request, |request| async { self.sessions().create_session(request).await }).await
    }

    /// Returns a session at its newest revision.
    pub async fn get_session(&self, session_id: &str) -> Result<Session, Error> {
        let request = GetSessionRequest { session_id: session_id.to_owned() };
        self.call(request, |request| async { self.sessions().get_session(request).await }).await
    }

    /// Returns a page of sessions.
    pub async fn list_sessions(&self, request: ListSessionsRequest) -> Result<ListSessionsResponse, Error> {
        self.call(request, |request| async { self.sessions().list_sessions(request).await }).await
    }

    /// Removes a session with all its events, for good.
    pub async fn delete_session(&self, mut request: DeleteSessionRequest) -> Result<(), Error> {
        ensure_request_id(&mut request.request_id);
        let deleted =
            self.call(request, |request| async { self.sessions().delete_session(request).await }).await;
        match deleted {
            Err(error) if !is_gone_after_retry(&error) => Err(error),
            _ => Ok(()),
        }
    }

    /// Changes what people call a session; `session.etag` says which state was read.
    pub async fn update_session(&self, mut request: UpdateSessionRequest) -> Result<Session, Error> {
        ensure_request_id(&mut request.request_id);
        self.call(request, |request| async { self.sessions().update_session(request).await }).await
    }

    /// Closes a session: it stays readable, and can be forked.
    pub async fn finish_session(&self, mut request: FinishSessionRequest) -> Result<Session, Error> {
        ensure_request_id(&mut request.request_id);
        self.call(request, |request| async { self.sessions().finish_session(request).await }).await
    }

    /// Copies a session up to any revision, with another configuration if wanted. The copy is computed anew: where that
    /// takes longer than the deadline, the retries ask until it is done.
    pub async fn fork_session(&self, mut request: ForkSessionRequest) -> Result<Session, Error> {
        ensure_request_id(&mut request.request_id);
        self.call(request, |request| async { self.sessions().fork_session(request).await }).await
    }

    /// Returns a page of experiments.
    pub async fn list_experiments(
        &self,
        request: ListExperimentsRequest,
    ) -> Result<ListExperimentsResponse, Error> {
        self.call(request, |request| async { self.sessions().list_experiments(request).await }).await
    }

    /// Tells the mean and the spread of the groups of an experiment.
    pub async fn summarize_experiment(
        &self,
        request: SummarizeExperimentRequest,
    ) -> Result<ExperimentSummary, Error> {
        self.call(request, |request| async { self.sessions().summarize_experiment(request).await }).await
    }

    /// Returns the server's versions, capabilities and limits.
    pub async fn server_info(&self) -> Result<ServerInfo, Error> {
        self.call(GetServerInfoRequest {}, |request| async { self.sessions().get_server_info(request).await })
            .await
    }

    /// Adds a camera's view of the object; [`visual_prior`](crate::visual_prior) makes one from points.
    pub async fn add_visual_prior(
        &self,
        mut request: AddVisualPriorRequest,
    ) -> Result<AddVisualPriorResponse, Error> {
        ensure_request_id(&mut request.request_id);
        self.call(request, |request| async { self.exploration().add_visual_prior(request).await }).await
    }

    /// Asks where to touch next. An empty list is no error: `should_stop` and `excluded` say why.
    pub async fn propose_contacts(
        &self,
        mut request: ProposeContactsRequest,
    ) -> Result<ProposeContactsResponse, Error> {
        // Without a lease the call only reads.
        if request.lease.is_some() {
            ensure_request_id(&mut request.request_id);
        }
        self.call(request, |request| async { self.exploration().propose_contacts(request).await }).await
    }

    /// Reports what came of an approach; the reply is sent once it is durable.
    pub async fn report_contact(
        &self,
        mut request: ReportContactRequest,
    ) -> Result<ReportContactResponse, Error> {
        ensure_request_id(&mut request.request_id);
        self.call(request, |request| async { self.exploration().report_contact(request).await }).await
    }

    /// Takes a view or a result out of the estimate, as if it had never been reported.
    pub async fn retract_event(&self, mut request: RetractEventRequest) -> Result<Session, Error> {
        ensure_request_id(&mut request.request_id);
        self.call(request, |request| async { self.exploration().retract_event(request).await }).await
    }

    /// Opens the whole loop on one stream.
    pub async fn explore(&self, open: ExploreOpen) -> Result<Exploration, Error> {
        Exploration::open(self.clone(), open).await
    }

    /// Returns the estimated surface at any revision; [`positions`](crate::positions), [`faces`](crate::faces) and
    /// [`uncertainty`](crate::uncertainty) unpack a raw one.
    pub async fn get_mesh(&self, request: GetMeshRequest) -> Result<Mesh, Error> {
        self.call(request, |request| async { self.reconstruction().get_mesh(request).await }).await
    }

    /// Returns a page of a session's events, oldest first.
    pub async fn list_events(&self, request: ListEventsRequest) -> Result<ListEventsResponse, Error> {
        self.call(request, |request| async { self.reconstruction().list_events(request).await }).await
    }

    /// Compares the estimate of some revisions with a reference mesh.
    pub async fn evaluate_session(
        &self,
        request: EvaluateSessionRequest,
    ) -> Result<EvaluateSessionResponse, Error> {
        self.call(request, |request| async { self.reconstruction().evaluate_session(request).await }).await
    }

    /// Returns one row per view and attempt of a session.
    pub async fn get_series(&self, request: GetSeriesRequest) -> Result<GetSeriesResponse, Error> {
        self.call(request, |request| async { self.reconstruction().get_series(request).await }).await
    }

    /// Keeps a reference mesh with a session, in place of an earlier one.
    pub async fn set_reference(&self, request: SetReferenceRequest) -> Result<Reference, Error> {
        self.call(request, |request| async { self.reconstruction().set_reference(request).await }).await
    }

    /// Returns the reference mesh of a session.
    pub async fn get_reference(&self, request: GetReferenceRequest) -> Result<Reference, Error> {
        self.call(request, |request| async { self.reconstruction().get_reference(request).await }).await
    }

    /// Forgets the reference mesh of a session.
    pub async fn delete_reference(&self, session_id: &str) -> Result<(), Error> {
        let request = DeleteReferenceRequest { session_id: session_id.to_owned() };
        self.call(request, |request| async { self.reconstruction().delete_reference(request).await }).await?;
        Ok(())
    }

    /// Follows a session: the events after a revision, then each new one.
    pub async fn watch_session(&self, request: WatchSessionRequest) -> Result<Watch, Error> {
        Watch::open(self.clone(), request).await
    }

    /// Sends `message` until there is an answer, a refusal that stands, or no attempt left.
    async fn call<Q, A, F>(&self, message: Q, send: impl Fn(Request<Q>) -> F) -> Result<A, Error>
    where
        Q: About + Clone,
        F: Future<Output = Result<Response<A>, Status>>,
    {
        self.retry
            .run(|attempts| {
                let mut request = routed(message.clone());
                request.set_timeout(self.deadline);
                let answer = self.in_time(send(request), attempts);
                async { Ok(answer.await?.into_inner()) }
            })
            .await
    }

    /// Waits for `answer` no longer than the deadline.
    ///
    /// The time to get a connection counts, which `grpc-timeout` leaves out; and a stream's opening has none.
    pub(crate) async fn in_time<A>(
        &self,
        answer: impl Future<Output = Result<A, Status>>,
        attempts: u32,
    ) -> Result<A, Error> {
        match timeout(self.deadline, answer).await {
            Ok(Ok(answer)) => Ok(answer),
            Ok(Err(status)) => Err(Error::from_status(&status, attempts)),
            Err(_) => Err(Error::NoAnswer {
                attempts,
                detail: format!("the deadline of {:?} passed", self.deadline),
            }),
        }
    }

    pub(crate) fn retry(&self) -> RetryPolicy {
        self.retry
    }

    pub(crate) fn sessions(&self) -> SessionServiceClient<Connection> {
        SessionServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_REPLY_BYTES)
    }

    pub(crate) fn exploration(&self) -> ExplorationServiceClient<Connection> {
        ExplorationServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_REPLY_BYTES)
    }

    pub(crate) fn reconstruction(&self) -> ReconstructionServiceClient<Connection> {
        ReconstructionServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_REPLY_BYTES)
    }
}

/// Whether a retry found no session: then an earlier attempt, whose reply was lost, removed it and its log.
fn is_gone_after_retry(error: &Error) -> bool {
    error.refusal().is_some_and(|refusal| refusal.code == Code::NotFound && refusal.attempts > 1)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use palpate_proto::v1::ReportContactRequest;
    use tonic::{Code, Status};
    use tonic_types::{ErrorDetails, StatusExt};

    use super::is_gone_after_retry;
    use crate::test_server::{Scripted, Step};
    use crate::{Error, FieldProblem, RetryPolicy};

    fn report() -> ReportContactRequest {
        ReportContactRequest::default()
    }

    #[tokio::test]
    async fn a_call_that_fails_for_a_while_arrives_under_one_request_id() {
        let away = || Step::Fail(Status::unavailable("starting"));
        let server = Scripted::start(vec![away(), away()]).await;
        server.client().await.report_contact(report()).await.unwrap();
        let ids = server.request_ids();
        assert_eq!(ids.len(), 3);
        assert!(!ids[0].is_empty());
        assert!(ids.iter().all(|id| *id == ids[0]), "{ids:?}");
    }

    #[tokio::test]
    async fn two_calls_have_two_request_ids_and_a_given_one_is_kept() {
        let server = Scripted::start(vec![]).await;
        let client = server.client().await;
        client.report_contact(report()).await.unwrap();
        client.report_contact(report()).await.unwrap();
        let mut chosen = report();
        chosen.request_id = "mine".to_owned();
        client.report_contact(chosen).await.unwrap();
        let ids = server.request_ids();
        assert_ne!(ids[0], ids[1]);
        assert_eq!(ids[2], "mine");
    }

    #[tokio::test]
    async fn wrong_fields_are_named_and_not_sent_again() {
        let mut details = ErrorDetails::with_bad_request_violation("result", "is required");
        details.set_error_info("FIELD_INVALID", "palpate.v1", []);
        let refusal = Status::with_error_details(Code::InvalidArgument, "one field is wrong", details);
        let server = Scripted::start(vec![Step::Fail(refusal)]).await;
        let client = server.client().await;
        let error = client.report_contact(report()).await.unwrap_err();
        assert_eq!(server.request_ids().len(), 1);
        assert_eq!(error.code(), Code::InvalidArgument);
        assert_eq!(error.reason(), "FIELD_INVALID");
        let expected = FieldProblem { field: "result".to_owned(), description: "is required".to_owned() };
        assert_eq!(error.refusal().unwrap().fields, vec![expected]);
        let text = "one field is wrong; result: is required (FIELD_INVALID)";
        assert_eq!(error.to_string(), text);
    }

    #[tokio::test]
    async fn a_revision_that_moved_on_is_left_to_the_caller() {
        let mut details = ErrorDetails::new();
        details.set_error_info("REVISION_MISMATCH", "palpate.v1", []);
        let refusal = Status::with_error_details(Code::Aborted, "now at 7", details);
        let server = Scripted::start(vec![Step::Fail(refusal)]).await;
        let client = server.client().await;
        let error = client.report_contact(report()).await.unwrap_err();
        assert_eq!(error.reason(), "REVISION_MISMATCH");
        assert_eq!(server.request_ids().len(), 1);
    }

    #[tokio::test]
    async fn the_last_refusal_is_returned_with_the_number_of_attempts() {
        let away = (0..9).map(|_| Step::Fail(Status::unavailable("starting")));
        let server = Scripted::start(away.collect()).await;
        let client = server.client().await;
        let error = client.report_contact(report()).await.unwrap_err();
        assert_eq!(error.to_string(), "starting (Unavailable, after 5 attempts)");
        assert_eq!(server.request_ids().len(), 5);
    }

    #[tokio::test]
    async fn the_server_is_told_the_deadline_and_a_late_answer_is_asked_for_again() {
        let server = Scripted::start(vec![Step::Hang]).await;
        let client = server.builder().deadline(Duration::from_millis(500)).connect().await.unwrap();
        client.report_contact(report()).await.unwrap();
        let ids = server.request_ids();
        assert_eq!(ids.len(), 2);
        assert_eq!(ids[0], ids[1]);
        assert_eq!(server.deadlines(), vec!["500000u", "500000u"]);
    }

    #[tokio::test]
    async fn a_reply_lost_with_its_connection_is_asked_for_again_under_the_same_id() {
        let server = Scripted::start(vec![Step::Hang]).await;
        let client = server.client_whose_first_connection_breaks().await;
        client.report_contact(report()).await.unwrap();
        let ids = server.request_ids();
        assert_eq!(ids.len(), 2);
        assert_eq!(ids[0], ids[1]);
    }

    #[tokio::test]
    async fn a_server_that_never_answers_gives_no_answer() {
        let server = Scripted::start(vec![Step::Hang, Step::Hang]).await;
        let twice = RetryPolicy { max_attempts: 2, ..RetryPolicy::default() };
        let client =
            server.builder().deadline(Duration::from_millis(300)).retry(twice).connect().await.unwrap();
        let error = client.report_contact(report()).await.unwrap_err();
        assert!(error.is_transient(), "{error:?}");
        assert_eq!(server.request_ids().len(), 2);
    }

    #[test]
    fn a_session_that_is_gone_counts_as_deleted_only_after_a_retry() {
        let missing = |attempts| Error::from_status(&Status::not_found("none"), attempts);
        assert!(!is_gone_after_retry(&missing(1)));
        assert!(is_gone_after_retry(&missing(2)));
    }
}
