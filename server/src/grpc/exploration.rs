//! `ExplorationService`.

use palpate_proto::v1;
use palpate_proto::v1::exploration_service_server::ExplorationService;
use tokio_stream::StreamExt;
use tonic::{Request, Response, Status, Streaming};

use super::{Handlers, Replies, call, replies, reply, status};

#[tonic::async_trait]
impl ExplorationService for Handlers {
    async fn add_visual_prior(
        &self,
        request: Request<v1::AddVisualPriorRequest>,
    ) -> Result<Response<v1::AddVisualPriorResponse>, Status> {
        let call = call(&request)?;
        reply(self.api.add_visual_prior(request.into_inner(), call).await)
    }

    async fn propose_contacts(
        &self,
        request: Request<v1::ProposeContactsRequest>,
    ) -> Result<Response<v1::ProposeContactsResponse>, Status> {
        let call = call(&request)?;
        reply(self.api.propose_contacts(request.into_inner(), call).await)
    }

    async fn report_contact(
        &self,
        request: Request<v1::ReportContactRequest>,
    ) -> Result<Response<v1::ReportContactResponse>, Status> {
        let call = call(&request)?;
        reply(self.api.report_contact(request.into_inner(), call).await)
    }

    async fn retract_event(
        &self,
        request: Request<v1::RetractEventRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        let call = call(&request)?;
        reply(self.api.retract_event(request.into_inner(), call).await)
    }

    type ExploreStream = Replies<v1::ExploreResponse>;

    async fn explore(
        &self,
        request: Request<Streaming<v1::ExploreRequest>>,
    ) -> Result<Response<Self::ExploreStream>, Status> {
        let call = call(&request)?;
        let limit = self.api.limits().message_bytes;
        let messages = request
            .into_inner()
            .map(move |message| message.map_err(|failure| status::reading_error(&failure, limit)));
        replies(self.api.explore(messages, call).await)
    }
}
