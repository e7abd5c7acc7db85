//! `ReconstructionService`.

use palpate_proto::v1;
use palpate_proto::v1::reconstruction_service_server::ReconstructionService;
use tokio_stream::StreamExt;
use tonic::{Request, Response, Status};

use super::{Handlers, Replies, call, replies, reply};

#[tonic::async_trait]
impl ReconstructionService for Handlers {
    async fn get_mesh(&self, request: Request<v1::GetMeshRequest>) -> Result<Response<v1::Mesh>, Status> {
        let call = call(&request)?;
        reply(self.api.get_mesh(request.into_inner(), call).await)
    }

    async fn list_events(
        &self,
        request: Request<v1::ListEventsRequest>,
    ) -> Result<Response<v1::ListEventsResponse>, Status> {
        let call = call(&request)?;
        reply(self.api.list_events(request.into_inner(), call).await)
    }

    type WatchSessionStream = Replies<v1::WatchSessionResponse>;

    async fn watch_session(
        &self,
        request: Request<v1::WatchSessionRequest>,
    ) -> Result<Response<Self::WatchSessionStream>, Status> {
        let call = call(&request)?;
        let updates = self.api.watch_session(request.into_inner(), call).await;
        replies(updates.map(|updates| updates.map(|update| update.map(|update| update.message))))
    }

    type ReplaySessionStream = Replies<v1::WatchSessionResponse>;

    async fn replay_session(
        &self,
        request: Request<v1::ReplaySessionRequest>,
    ) -> Result<Response<Self::ReplaySessionStream>, Status> {
        let call = call(&request)?;
        replies(self.api.replay_session(request.into_inner(), call).await)
    }

    async fn evaluate_session(
        &self,
        request: Request<v1::EvaluateSessionRequest>,
    ) -> Result<Response<v1::EvaluateSessionResponse>, Status> {
        let call = call(&request)?;
        reply(self.api.evaluate_session(request.into_inner(), call).await)
    }

    async fn get_series(
        &self,
        request: Request<v1::GetSeriesRequest>,
    ) -> Result<Response<v1::GetSeriesResponse>, Status> {
        let call = call(&request)?;
        reply(self.api.get_series(request.into_inner(), call).await)
    }

    async fn set_reference(
        &self,
        request: Request<v1::SetReferenceRequest>,
    ) -> Result<Response<v1::Reference>, Status> {
        let call = call(&request)?;
        reply(self.api.set_reference(request.into_inner(), call).await)
    }

    async fn get_reference(
        &self,
        request: Request<v1::GetReferenceRequest>,
    ) -> Result<Response<v1::Reference>, Status> {
        let call = call(&request)?;
        reply(self.api.get_reference(request.into_inner(), call).await)
    }

    async fn delete_reference(
        &self,
        request: Request<v1::DeleteReferenceRequest>,
    ) -> Result<Response<v1::DeleteReferenceResponse>, Status> {
        let call = call(&request)?;
        reply(self.api.delete_reference(request.into_inner(), call).await)
    }
}
