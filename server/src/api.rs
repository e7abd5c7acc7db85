//! What the service does, in messages of the contract: the one layer under gRPC and HTTP.
//!
//! Here a request is read, checked and turned into values of the method, and the outcome is turned
//! back. The transports above only move bytes; the sessions below know nothing of messages.

use palpate_proto::v1;
use tokio_stream::Stream;

use crate::error::Error;

/// The service; cheap to clone.
#[derive(Clone)]
pub struct Api { limits: std::sync::Arc<crate::limits::Limits> }

/// Who calls, and until when an answer is of use.
#[derive(Clone, Debug, Default)]
pub struct Call {
    /// When the caller stops waiting; unset = the server's own bound.
    pub deadline: Option<tokio::time::Instant>,
    /// Who calls, as far as the server knows: written to the log of events.
    pub actor: String,
}

impl Api {
    #[doc = ""]
    pub async fn create_session(&self, request: v1::CreateSessionRequest, call: Call) -> Result<v1::Session, Error> { let _ = (request, call); Err(Error::unimplemented("create_session")) }
    #[doc = ""]
    pub async fn get_session(&self, request: v1::GetSessionRequest, call: Call) -> Result<v1::Session, Error> { let _ = (request, call); Err(Error::unimplemented("get_session")) }
    #[doc = ""]
    pub async fn list_sessions(&self, request: v1::ListSessionsRequest, call: Call) -> Result<v1::ListSessionsResponse, Error> { let _ = (request, call); Err(Error::unimplemented("list_sessions")) }
    #[doc = ""]
    pub async fn delete_session(&self, request: v1::DeleteSessionRequest, call: Call) -> Result<v1::DeleteSessionResponse, Error> { let _ = (request, call); Err(Error::unimplemented("delete_session")) }
    #[doc = ""]
    pub async fn add_visual_prior(&self, request: v1::AddVisualPriorRequest, call: Call) -> Result<v1::AddVisualPriorResponse, Error> { let _ = (request, call); Err(Error::unimplemented("add_visual_prior")) }
    #[doc = ""]
    pub async fn propose_contacts(&self, request: v1::ProposeContactsRequest, call: Call) -> Result<v1::ProposeContactsResponse, Error> { let _ = (request, call); Err(Error::unimplemented("propose_contacts")) }
    #[doc = ""]
    pub async fn report_contact(&self, request: v1::ReportContactRequest, call: Call) -> Result<v1::ReportContactResponse, Error> { let _ = (request, call); Err(Error::unimplemented("report_contact")) }
    #[doc = ""]
    pub async fn get_mesh(&self, request: v1::GetMeshRequest, call: Call) -> Result<v1::Mesh, Error> { let _ = (request, call); Err(Error::unimplemented("get_mesh")) }
    #[doc = ""]
    pub async fn list_events(&self, request: v1::ListEventsRequest, call: Call) -> Result<v1::ListEventsResponse, Error> { let _ = (request, call); Err(Error::unimplemented("list_events")) }
    /// The first error (no such session, bad field) comes before the stream begins.
    pub async fn watch_session(&self, request: v1::WatchSessionRequest, call: Call)
        -> Result<impl Stream<Item = Result<v1::WatchSessionResponse, Error>> + Send + 'static, Error> {
            let _ = (request, call); if true { return Err(Error::unimplemented("watch")); } Ok(tokio_stream::iter(Vec::new())) }
    #[doc = ""]
    pub fn server_info(&self) -> v1::ServerInfo { v1::ServerInfo::default() }
    #[doc = ""]
    pub async fn ready(&self) -> Result<(), Error> { Ok(()) }
    #[doc = ""]
    pub fn limits(&self) -> &crate::limits::Limits { &self.limits }
}
// Etags in messages (Session.etag, Mesh.etag, topology_etag) are bare, without quotes; HTTP adds them.
// delete_session and get_mesh accept an etag with or without quotes.
