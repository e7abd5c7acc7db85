//! `SessionService`.

use palpate_proto::v1;
use palpate_proto::v1::session_service_server::SessionService;
use tonic::{Request, Response, Status, Streaming};

use super::{Handlers, Replies, call, reply, unavailable};

#[tonic::async_trait]
impl SessionService for Handlers {
    async fn create_session(
        &self,
        request: Request<v1::CreateSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        let call = call(&request);
        reply(self.api.create_session(request.into_inner(), call).await)
    }

    async fn get_session(
        &self,
        request: Request<v1::GetSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        let call = call(&request);
        reply(self.api.get_session(request.into_inner(), call).await)
    }

    async fn list_sessions(
        &self,
        request: Request<v1::ListSessionsRequest>,
    ) -> Result<Response<v1::ListSessionsResponse>, Status> {
        let call = call(&request);
        reply(self.api.list_sessions(request.into_inner(), call).await)
    }

    async fn update_session(
        &self,
        _request: Request<v1::UpdateSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        Err(unavailable("UpdateSession"))
    }

    async fn finish_session(
        &self,
        _request: Request<v1::FinishSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        Err(unavailable("FinishSession"))
    }

    async fn delete_session(
        &self,
        request: Request<v1::DeleteSessionRequest>,
    ) -> Result<Response<v1::DeleteSessionResponse>, Status> {
        let call = call(&request);
        reply(self.api.delete_session(request.into_inner(), call).await)
    }

    async fn fork_session(
        &self,
        _request: Request<v1::ForkSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        Err(unavailable("ForkSession"))
    }

    type ExportSessionStream = Replies<v1::Chunk>;

    async fn export_session(
        &self,
        _request: Request<v1::ExportSessionRequest>,
    ) -> Result<Response<Self::ExportSessionStream>, Status> {
        Err(unavailable("ExportSession"))
    }

    async fn import_session(
        &self,
        _request: Request<Streaming<v1::ImportSessionRequest>>,
    ) -> Result<Response<v1::Session>, Status> {
        Err(unavailable("ImportSession"))
    }

    async fn get_server_info(
        &self,
        _request: Request<v1::GetServerInfoRequest>,
    ) -> Result<Response<v1::ServerInfo>, Status> {
        Ok(Response::new(self.api.server_info()))
    }
}
