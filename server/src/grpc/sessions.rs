//! `SessionService`.

use palpate_proto::v1;
use palpate_proto::v1::session_service_server::SessionService;
use tokio_stream::StreamExt;
use tonic::{Request, Response, Status, Streaming};

use super::{Handlers, Replies, call, replies, reply, status};

#[tonic::async_trait]
impl SessionService for Handlers {
    async fn create_session(
        &self,
        request: Request<v1::CreateSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        let call = call(&request)?;
        reply(self.api.create_session(request.into_inner(), call).await)
    }

    async fn get_session(
        &self,
        request: Request<v1::GetSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        let call = call(&request)?;
        reply(self.api.get_session(request.into_inner(), call).await)
    }

    async fn list_sessions(
        &self,
        request: Request<v1::ListSessionsRequest>,
    ) -> Result<Response<v1::ListSessionsResponse>, Status> {
        let call = call(&request)?;
        reply(self.api.list_sessions(request.into_inner(), call).await)
    }

    async fn update_session(
        &self,
        request: Request<v1::UpdateSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        let call = call(&request)?;
        reply(self.api.update_session(request.into_inner(), call).await)
    }

    async fn finish_session(
        &self,
        request: Request<v1::FinishSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        let call = call(&request)?;
        reply(self.api.finish_session(request.into_inner(), call).await)
    }

    async fn delete_session(
        &self,
        request: Request<v1::DeleteSessionRequest>,
    ) -> Result<Response<v1::DeleteSessionResponse>, Status> {
        let call = call(&request)?;
        reply(self.api.delete_session(request.into_inner(), call).await)
    }

    async fn fork_session(
        &self,
        request: Request<v1::ForkSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        let call = call(&request)?;
        reply(self.api.fork_session(request.into_inner(), call).await)
    }

    type ExportSessionStream = Replies<v1::Chunk>;

    async fn export_session(
        &self,
        request: Request<v1::ExportSessionRequest>,
    ) -> Result<Response<Self::ExportSessionStream>, Status> {
        let call = call(&request)?;
        replies(self.api.export_session(request.into_inner(), call).await.map(|export| export.chunks))
    }

    async fn import_session(
        &self,
        request: Request<Streaming<v1::ImportSessionRequest>>,
    ) -> Result<Response<v1::Session>, Status> {
        let call = call(&request)?;
        let limit = self.api.limits().message_bytes;
        let parts = request
            .into_inner()
            .map(move |part| part.map_err(|failure| status::reading_error(&failure, limit)));
        reply(self.api.import_session(parts, call).await)
    }

    async fn list_experiments(
        &self,
        request: Request<v1::ListExperimentsRequest>,
    ) -> Result<Response<v1::ListExperimentsResponse>, Status> {
        let call = call(&request)?;
        reply(self.api.list_experiments(request.into_inner(), call).await)
    }

    async fn summarize_experiment(
        &self,
        request: Request<v1::SummarizeExperimentRequest>,
    ) -> Result<Response<v1::ExperimentSummary>, Status> {
        let call = call(&request)?;
        reply(self.api.summarize_experiment(request.into_inner(), call).await)
    }

    async fn get_server_info(
        &self,
        request: Request<v1::GetServerInfoRequest>,
    ) -> Result<Response<v1::ServerInfo>, Status> {
        let call = call(&request)?;
        reply(self.api.get_server_info(call).await)
    }
}
