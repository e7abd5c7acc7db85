//! The same call over either transport, with the same messages: what holds for one is tried on both.

use palpate_proto::v1;
use palpate_proto::v1::exploration_service_client::ExplorationServiceClient;
use palpate_proto::v1::reconstruction_service_client::ReconstructionServiceClient;
use palpate_proto::v1::session_service_client::SessionServiceClient;
use reqwest::Method;
use tonic::transport::Channel;
use tonic::{Response, Status};

use super::http::{accepted, answered, to_json};
use super::{Http, Outcome, Refused, soon};

/// Larger than any message that a test sends on purpose.
const MESSAGE_BYTES: usize = 64 << 20;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Transport {
    Grpc,
    Http,
}

impl Transport {
    pub(crate) const BOTH: [Self; 2] = [Self::Grpc, Self::Http];

    /// A name for what belongs to this transport in a test.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Grpc => "grpc",
            Self::Http => "http",
        }
    }
}

/// Calls a server over one transport.
#[derive(Clone, Debug)]
pub(crate) struct Caller {
    transport: Transport,
    channel: Channel,
    http: Http,
}

impl Caller {
    pub(super) fn new(transport: Transport, channel: Channel, http: Http) -> Self {
        Self { transport, channel, http }
    }

    pub(crate) fn sessions(&self) -> SessionServiceClient<Channel> {
        SessionServiceClient::new(self.channel.clone())
    }

    pub(crate) fn exploration(&self) -> ExplorationServiceClient<Channel> {
        ExplorationServiceClient::new(self.channel.clone()).max_encoding_message_size(MESSAGE_BYTES)
    }

    pub(crate) fn reconstruction(&self) -> ReconstructionServiceClient<Channel> {
        ReconstructionServiceClient::new(self.channel.clone()).max_decoding_message_size(MESSAGE_BYTES)
    }

    pub(crate) async fn create(&self, request: v1::CreateSessionRequest) -> Outcome<v1::Session> {
        match self.transport {
            Transport::Grpc => reply(self.sessions().create_session(request)).await,
            Transport::Http => answered(self.http.post("/v1/sessions", &to_json(&request))).await,
        }
    }

    pub(crate) async fn get(&self, session_id: &str) -> Outcome<v1::Session> {
        match self.transport {
            Transport::Grpc => {
                let request = v1::GetSessionRequest { session_id: session_id.into() };
                reply(self.sessions().get_session(request)).await
            }
            Transport::Http => answered(self.http.get(&path(session_id, ""))).await,
        }
    }

    pub(crate) async fn list(&self, request: v1::ListSessionsRequest) -> Outcome<v1::ListSessionsResponse> {
        if self.transport == Transport::Grpc {
            return reply(self.sessions().list_sessions(request)).await;
        }
        let mut query =
            vec![format!("page_size={}", request.page_size), format!("page_token={}", request.page_token)];
        if !request.experiment.is_empty() {
            query.push(format!("experiment={}", request.experiment));
        }
        if request.state() != v1::SessionState::Unspecified {
            query.push(format!("state={}", request.state().as_str_name()));
        }
        if !request.labels.is_empty() {
            let labels: Vec<_> = request.labels.iter().map(|(key, value)| format!("{key}:{value}")).collect();
            query.push(format!("labels={}", labels.join(",")));
        }
        answered(self.http.get(&format!("/v1/sessions?{}", query.join("&")))).await
    }

    pub(crate) async fn delete(&self, request: v1::DeleteSessionRequest) -> Outcome<()> {
        match self.transport {
            Transport::Grpc => reply(self.sessions().delete_session(request)).await.map(|_| ()),
            Transport::Http => {
                let mut call = self.http.request(Method::DELETE, &path(&request.session_id, ""));
                if !request.request_id.is_empty() {
                    call = call.header("idempotency-key", request.request_id);
                }
                if !request.etag.is_empty() {
                    call = call.header("if-match", format!("\"{}\"", request.etag));
                }
                let response = accepted(call).await?;
                assert_eq!(response.status(), 204);
                Ok(())
            }
        }
    }

    pub(crate) async fn add_prior(
        &self,
        request: v1::AddVisualPriorRequest,
    ) -> Outcome<v1::AddVisualPriorResponse> {
        match self.transport {
            Transport::Grpc => reply(self.exploration().add_visual_prior(request)).await,
            Transport::Http => {
                answered(self.http.post(&path(&request.session_id, "/priors"), &to_json(&request))).await
            }
        }
    }

    pub(crate) async fn propose(
        &self,
        request: v1::ProposeContactsRequest,
    ) -> Outcome<v1::ProposeContactsResponse> {
        match self.transport {
            Transport::Grpc => reply(self.exploration().propose_contacts(request)).await,
            Transport::Http => {
                answered(self.http.post(&path(&request.session_id, "/candidates"), &to_json(&request))).await
            }
        }
    }

    pub(crate) async fn report(
        &self,
        request: v1::ReportContactRequest,
    ) -> Outcome<v1::ReportContactResponse> {
        match self.transport {
            Transport::Grpc => reply(self.exploration().report_contact(request)).await,
            Transport::Http => {
                answered(self.http.post(&path(&request.session_id, "/contacts"), &to_json(&request))).await
            }
        }
    }

    /// A page of events.
    pub(crate) async fn events(&self, request: v1::ListEventsRequest) -> Outcome<v1::ListEventsResponse> {
        match self.transport {
            Transport::Grpc => reply(self.reconstruction().list_events(request)).await,
            Transport::Http => {
                let v1::ListEventsRequest { session_id, page_size, page_token, include_points } = request;
                let query = format!(
                    "/events?page_size={page_size}&page_token={page_token}&include_points={include_points}"
                );
                answered(self.http.get(&path(&session_id, &query.replace("page_token=&", "")))).await
            }
        }
    }

    /// The whole log of a session, page by page.
    pub(crate) async fn log(&self, session_id: &str) -> Vec<v1::Event> {
        let mut request = v1::ListEventsRequest { session_id: session_id.into(), ..Default::default() };
        let mut log = Vec::new();
        loop {
            let page = self.events(request.clone()).await.unwrap();
            log.extend(page.events);
            request.page_token = page.next_page_token;
            if request.page_token.is_empty() {
                return log;
            }
        }
    }

    pub(crate) async fn server_info(&self) -> Outcome<v1::ServerInfo> {
        match self.transport {
            Transport::Grpc => reply(self.sessions().get_server_info(v1::GetServerInfoRequest {})).await,
            Transport::Http => answered(self.http.get("/version")).await,
        }
    }

    /// A mesh, which HTTP has in other shapes: files and arrays.
    pub(crate) async fn mesh(&self, request: v1::GetMeshRequest) -> Outcome<v1::Mesh> {
        reply(self.reconstruction().get_mesh(request)).await
    }
}

/// A gRPC reply, or why there is none.
pub(crate) async fn reply<T>(call: impl Future<Output = Result<Response<T>, Status>>) -> Outcome<T> {
    match soon("a reply", call).await {
        Ok(response) => Ok(response.into_inner()),
        Err(status) => Err(Refused::from_status(&status)),
    }
}

fn path(session_id: &str, rest: &str) -> String {
    format!("/v1/sessions/{session_id}{rest}")
}
