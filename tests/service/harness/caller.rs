//! The same call over either transport, with the same messages: what holds for one is tried on both.

use palpate_proto::v1;
use palpate_proto::v1::exploration_service_client::ExplorationServiceClient;
use palpate_proto::v1::reconstruction_service_client::ReconstructionServiceClient;
use palpate_proto::v1::session_service_client::SessionServiceClient;
use reqwest::Method;
use sha2::{Digest, Sha256};
use tonic::transport::Channel;
use tonic::{Response, Status};

use super::http::{accepted, answered, from_json, to_json};
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

    pub(crate) async fn update(&self, request: v1::UpdateSessionRequest) -> Outcome<v1::Session> {
        if self.transport == Transport::Grpc {
            return reply(self.sessions().update_session(request)).await;
        }
        let session = request.session.clone().unwrap_or_default();
        let mut body = serde_json::Map::new();
        let all = to_json(&session);
        for name in request.update_mask.iter().flat_map(|mask| &mask.paths) {
            body.insert(name.clone(), all.get(name).cloned().unwrap_or_default());
        }
        let mut call = self.http.request(Method::PATCH, &path(&session.session_id, "")).json(&body);
        if !session.etag.is_empty() {
            call = call.header("if-match", format!("\"{}\"", session.etag));
        }
        if !request.request_id.is_empty() {
            call = call.header("idempotency-key", request.request_id);
        }
        answered(call).await
    }

    pub(crate) async fn finish(&self, request: v1::FinishSessionRequest) -> Outcome<v1::Session> {
        match self.transport {
            Transport::Grpc => reply(self.sessions().finish_session(request)).await,
            Transport::Http => {
                answered(self.http.post(&path(&request.session_id, "/finish"), &to_json(&request))).await
            }
        }
    }

    pub(crate) async fn fork(&self, request: v1::ForkSessionRequest) -> Outcome<v1::Session> {
        match self.transport {
            Transport::Grpc => reply(self.sessions().fork_session(request)).await,
            Transport::Http => {
                answered(self.http.post(&path(&request.session_id, "/fork"), &to_json(&request))).await
            }
        }
    }

    pub(crate) async fn retract(&self, request: v1::RetractEventRequest) -> Outcome<v1::Session> {
        match self.transport {
            Transport::Grpc => reply(self.exploration().retract_event(request)).await,
            Transport::Http => {
                let rest = format!("/events/{}/retract", request.seq);
                answered(self.http.post(&path(&request.session_id, &rest), &to_json(&request))).await
            }
        }
    }

    /// All steps of a replay.
    pub(crate) async fn replay(
        &self,
        request: v1::ReplaySessionRequest,
    ) -> Outcome<Vec<v1::WatchSessionResponse>> {
        if self.transport == Transport::Grpc {
            let mut steps = reply(self.reconstruction().replay_session(request)).await?;
            let mut all = Vec::new();
            while let Some(step) =
                soon("a step", steps.message()).await.map_err(|s| Refused::from_status(&s))?
            {
                all.push(step);
            }
            return Ok(all);
        }
        let v1::ReplaySessionRequest { session_id, from_revision, to_revision, include_mesh, verify } =
            request;
        let query = format!(
            "/replay?from_revision={from_revision}&to_revision={to_revision}&include_mesh={include_mesh}&verify={verify}"
        );
        let response = accepted(self.http.get(&path(&session_id, &query))).await?;
        let text = soon("all steps", response.text()).await.unwrap();
        Ok(text.lines().map(from_json).collect())
    }

    /// A session as a file, up to a revision.
    pub(crate) async fn export(
        &self,
        session_id: &str,
        format: v1::ArchiveFormat,
        revision: i64,
    ) -> Outcome<Vec<u8>> {
        if self.transport == Transport::Http {
            let format = format.as_str_name().trim_start_matches("ARCHIVE_FORMAT_").to_lowercase();
            let query = format!("/export?format={format}&revision={revision}");
            let response = accepted(self.http.get(&path(session_id, &query))).await?;
            return Ok(soon("a file", response.bytes()).await.unwrap().into());
        }
        let request =
            v1::ExportSessionRequest { session_id: session_id.into(), revision, format: format.into() };
        let mut chunks = reply(self.sessions().export_session(request)).await?;
        let (mut file, mut sha256) = (Vec::new(), String::new());
        while let Some(chunk) =
            soon("a chunk", chunks.message()).await.map_err(|s| Refused::from_status(&s))?
        {
            assert!(sha256.is_empty(), "the digest comes last");
            file.extend_from_slice(&chunk.data);
            sha256 = chunk.sha256;
        }
        let digest = Sha256::digest(&file);
        assert_eq!(sha256, digest.iter().map(|byte| format!("{byte:02x}")).collect::<String>());
        Ok(file)
    }

    /// A session from a bundle, which is sent in pieces.
    pub(crate) async fn import(
        &self,
        header: v1::CreateSessionRequest,
        bundle: &[u8],
    ) -> Outcome<v1::Session> {
        if self.transport == Transport::Http {
            let mut query = Vec::new();
            for (name, value) in [
                ("session_id", &header.session_id),
                ("display_name", &header.display_name),
                ("experiment", &header.experiment),
            ] {
                if !value.is_empty() {
                    query.push(format!("{name}={value}"));
                }
            }
            let path = format!("/v1/imports?{}", query.join("&"));
            let call = self.http.request(Method::POST, &path).header("content-type", "application/x-tar");
            let call = match header.request_id.as_str() {
                "" => call,
                id => call.header("idempotency-key", id),
            };
            return answered(call.body(bundle.to_vec())).await;
        }
        let part = |part| v1::ImportSessionRequest { part: Some(part) };
        let header = part(v1::import_session_request::Part::Header(header));
        let pieces = bundle.chunks(10_000).map(|piece| piece.to_vec().into());
        let pieces = pieces.map(|data| part(v1::import_session_request::Part::Data(data)));
        let parts: Vec<_> = std::iter::once(header).chain(pieces).collect();
        reply(self.sessions().import_session(tokio_stream::iter(parts))).await
    }

    /// Over HTTP the request as JSON; files are tried where they are promised.
    pub(crate) async fn evaluate(
        &self,
        request: v1::EvaluateSessionRequest,
    ) -> Outcome<v1::EvaluateSessionResponse> {
        match self.transport {
            Transport::Grpc => reply(self.reconstruction().evaluate_session(request)).await,
            Transport::Http => {
                answered(self.http.post(&path(&request.session_id, "/evaluate"), &to_json(&request))).await
            }
        }
    }

    pub(crate) async fn set_reference(&self, request: v1::SetReferenceRequest) -> Outcome<v1::Reference> {
        if self.transport == Transport::Grpc {
            return reply(self.reconstruction().set_reference(request)).await;
        }
        let media_type = match request.format() {
            v1::MeshFormat::Ply => "model/ply",
            v1::MeshFormat::Stl => "model/stl",
            v1::MeshFormat::Obj => "model/obj",
            _ => "application/octet-stream",
        };
        let rest = format!("/reference?metres_per_unit={}", request.metres_per_unit);
        let call = self.http.request(Method::PUT, &path(&request.session_id, &rest));
        answered(call.header("content-type", media_type).body(request.mesh)).await
    }

    /// With its file, which HTTP sends apart from what is known of it.
    pub(crate) async fn reference(&self, session_id: &str) -> Outcome<v1::Reference> {
        if self.transport == Transport::Grpc {
            let request = v1::GetReferenceRequest { session_id: session_id.into(), without_mesh: false };
            return reply(self.reconstruction().get_reference(request)).await;
        }
        let call = || self.http.get(&path(session_id, "/reference"));
        let known: v1::Reference = answered(call().header("accept", "application/json")).await?;
        let file = accepted(call()).await?;
        assert_eq!(super::header(&file, "etag"), format!("\"{}\"", known.sha256));
        Ok(v1::Reference { mesh: file.bytes().await.unwrap(), ..known })
    }

    pub(crate) async fn delete_reference(&self, session_id: &str) -> Outcome<()> {
        if self.transport == Transport::Grpc {
            let request = v1::DeleteReferenceRequest { session_id: session_id.into() };
            return reply(self.reconstruction().delete_reference(request)).await.map(|_| ());
        }
        let call = self.http.request(Method::DELETE, &path(session_id, "/reference"));
        assert_eq!(accepted(call).await?.status(), 204);
        Ok(())
    }

    pub(crate) async fn series(&self, request: v1::GetSeriesRequest) -> Outcome<v1::GetSeriesResponse> {
        if self.transport == Transport::Grpc {
            return reply(self.reconstruction().get_series(request)).await;
        }
        let v1::GetSeriesRequest { session_id, after_revision, without_shadow } = request;
        let query = format!("/series?after_revision={after_revision}&without_shadow={without_shadow}");
        answered(self.http.get(&path(&session_id, &query))).await
    }

    pub(crate) async fn experiments(
        &self,
        request: v1::ListExperimentsRequest,
    ) -> Outcome<v1::ListExperimentsResponse> {
        if self.transport == Transport::Grpc {
            return reply(self.sessions().list_experiments(request)).await;
        }
        let v1::ListExperimentsRequest { page_size, page_token } = request;
        answered(self.http.get(&format!("/v1/experiments?page_size={page_size}&page_token={page_token}")))
            .await
    }

    pub(crate) async fn summarize(
        &self,
        request: v1::SummarizeExperimentRequest,
    ) -> Outcome<v1::ExperimentSummary> {
        if self.transport == Transport::Grpc {
            return reply(self.sessions().summarize_experiment(request)).await;
        }
        let v1::SummarizeExperimentRequest { experiment, by, labels } = request;
        let mut query = vec![format!("by={}", by.join(","))];
        if !labels.is_empty() {
            let labels: Vec<_> = labels.iter().map(|(key, value)| format!("{key}:{value}")).collect();
            query.push(format!("labels={}", labels.join(",")));
        }
        // Names are free, and a path is not.
        let name: String = experiment.bytes().map(|byte| format!("%{byte:02X}")).collect();
        answered(self.http.get(&format!("/v1/experiments/{name}/summary?{}", query.join("&")))).await
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
