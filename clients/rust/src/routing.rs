//! Which session a request is about: a proxy before several servers sends it to the one that has it in memory.

use palpate_proto::v1;
use tonic::Request;
use tonic::metadata::MetadataValue;

/// Names the session of a call.
const SESSION: &str = "x-session-id";

/// A request that may be about a session.
pub(crate) trait About {
    /// The session's id; empty where the request is about none.
    fn session_id(&self) -> &str {
        ""
    }
}

/// A request whose metadata names its session.
pub(crate) fn routed<Q: About>(message: Q) -> Request<Q> {
    let session_id = message.session_id().to_owned();
    to_session(&session_id, message)
}

/// A request whose metadata names this session.
pub(crate) fn to_session<Q>(session_id: &str, message: Q) -> Request<Q> {
    let mut request = Request::new(message);
    // An id that no header can have is no session's either, which the server says better.
    if let Ok(value) = MetadataValue::try_from(session_id)
        && !session_id.is_empty()
    {
        request.metadata_mut().insert(SESSION, value);
    }
    request
}

macro_rules! about_a_session {
    ($($request:ident)*) => {
        $(impl About for v1::$request {
            fn session_id(&self) -> &str {
                &self.session_id
            }
        })*
    };
}

about_a_session! {
    AddVisualPriorRequest CreateSessionRequest DeleteReferenceRequest DeleteSessionRequest EvaluateSessionRequest
    ExportSessionRequest FinishSessionRequest ForkSessionRequest GetMeshRequest GetReferenceRequest GetSeriesRequest
    GetSessionRequest ListEventsRequest ProposeContactsRequest ReplaySessionRequest ReportContactRequest
    RetractEventRequest SetReferenceRequest WatchSessionRequest
}

impl About for v1::UpdateSessionRequest {
    fn session_id(&self) -> &str {
        self.session.as_ref().map_or("", |session| &session.session_id)
    }
}

impl About for v1::GetServerInfoRequest {}
impl About for v1::ListExperimentsRequest {}
impl About for v1::ListSessionsRequest {}
impl About for v1::SummarizeExperimentRequest {}

#[cfg(test)]
mod tests {
    use super::*;

    fn named<Q: About>(message: Q) -> Option<String> {
        let request = routed(message);
        request.metadata().get(SESSION).map(|value| value.to_str().unwrap().to_owned())
    }

    #[test]
    fn a_call_names_its_session_where_it_has_one() {
        let session_id = "mug".to_owned();
        let report = v1::ReportContactRequest { session_id: session_id.clone(), ..Default::default() };
        let session = Some(v1::Session { session_id, ..Default::default() });
        let update = v1::UpdateSessionRequest { session, ..Default::default() };
        assert_eq!([named(report), named(update)], [Some("mug".to_owned()), Some("mug".to_owned())]);
        assert_eq!(named(v1::ListSessionsRequest::default()), None);
        assert_eq!(named(v1::CreateSessionRequest::default()), None, "the server chooses the id");
    }

    #[test]
    fn an_id_that_no_header_can_have_is_left_to_the_server() {
        let request = v1::GetSessionRequest { session_id: "a mug\n".to_owned() };
        assert_eq!(named(request), None);
    }
}
