//! What becomes of a request before any session is asked, without a server: whether it is read, and why not.
//!
//! A request goes the way that it goes in a server with the default [`Limits`]: bytes or JSON to a message, the message
//! to values of the method, each of them checked. What is refused is worded for both transports.

use http::{HeaderMap, HeaderValue};
use palpate_core::evidence::{Target, VisualPrior};
use palpate_proto::v1;
use prost::{Message, Name};

use crate::error::Error;
use crate::grpc;
use crate::http::dry_run as web;
use crate::limits::Limits;
use crate::session::PlausibleSize;
use crate::wire::{candidate_id as wire_id, from_proto};

/// The call that a request is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// `CreateSession`.
    CreateSession,
    /// `AddVisualPrior`, of any session.
    AddVisualPrior,
    /// `ReportContact`, of a session without declared pads.
    ReportContact,
    /// `ProposeContacts`, of any session.
    ProposeContacts,
}

/// Why a request is refused, as its caller reads it.
#[derive(Clone, Debug)]
pub struct Refusal {
    /// The problem document over HTTP.
    pub problem: String,
    /// The headers of the reply over gRPC; empty for a body that is not JSON, which no gRPC caller sends.
    pub trailers: HeaderMap,
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        let reply = grpc::refusal(&error, &HeaderValue::from_static("application/grpc"));
        Self { problem: web::problem(&error), trailers: reply.into_parts().0.headers }
    }
}

/// What a candidate id stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct CandidateId {
    /// Where the candidate aims.
    pub target: Target,
    /// The id as this service writes it.
    pub written: String,
}

/// Reads the JSON body of a request over HTTP, and gives the JSON of the message that was understood.
///
/// # Errors
/// Whatever a server would refuse without looking at the session.
pub fn json(call: Call, body: &[u8]) -> Result<String, Refusal> {
    let limits = &Limits::default();
    let unread = |problem| Refusal { problem, trailers: HeaderMap::new() };
    match call {
        Call::CreateSession => checked(&web::read(body, limits).map_err(unread)?, creation),
        Call::AddVisualPrior => checked(&web::read_prior(body, limits).map_err(unread)?, view),
        Call::ReportContact => checked(&web::read(body, limits).map_err(unread)?, report),
        Call::ProposeContacts => checked(&web::read(body, limits).map_err(unread)?, question),
    }
}

/// Reads the message of a request over gRPC, and gives the JSON of what was understood.
///
/// # Errors
/// Whatever a server would refuse without looking at the session.
pub fn message(call: Call, bytes: &[u8]) -> Result<String, Refusal> {
    match call {
        Call::CreateSession => checked(&decoded(bytes)?, creation),
        Call::AddVisualPrior => checked(&decoded(bytes)?, view),
        Call::ReportContact => checked(&decoded(bytes)?, report),
        Call::ProposeContacts => checked(&decoded(bytes)?, question),
    }
}

/// Reads a camera's view, in the session's frame and in metres.
///
/// # Errors
/// Whatever a server would refuse without looking at the session.
pub fn visual_prior(prior: &v1::VisualPrior) -> Result<VisualPrior, Refusal> {
    Ok(from_proto::sent_prior("prior", prior)?.evidence)
}

/// Reads a candidate id; `None` for what this service did not write.
pub fn candidate_id(text: &str) -> Option<CandidateId> {
    let id = wire_id::decode(text)?;
    Some(CandidateId { target: id.target, written: wire_id::encode(&id) })
}

fn decoded<T: Message + Default>(bytes: &[u8]) -> Result<T, Error> {
    T::decode(bytes).map_err(|error| Error::field("message", error.to_string()))
}

fn checked<T: Message + Name>(
    request: &T,
    check: fn(&T, &Limits) -> Result<(), Error>,
) -> Result<String, Refusal> {
    check(request, &Limits::default())?;
    Ok(web::write(request)?)
}

fn creation(request: &v1::CreateSessionRequest, limits: &Limits) -> Result<(), Error> {
    if !request.session_id.is_empty() {
        from_proto::check_session_id(&request.session_id)?;
    }
    from_proto::definition(request, 0, limits).map(drop)
}

fn view(request: &v1::AddVisualPriorRequest, limits: &Limits) -> Result<(), Error> {
    let v1::AddVisualPriorRequest { session_id, prior, expected_revision: _, request_id, propose } = request;
    check_ids(session_id, request_id, limits)?;
    from_proto::exploration_request("propose", *propose, "robot", None, limits)?;
    let prior = prior.as_ref().ok_or_else(|| Error::field("prior", "is missing"))?;
    let read = from_proto::sent_prior("prior", prior)?;
    from_proto::check_size("prior", read.evidence.points(), &PlausibleSize::default()).map(drop)
}

fn report(request: &v1::ReportContactRequest, limits: &Limits) -> Result<(), Error> {
    let v1::ReportContactRequest { session_id, result, expected_revision: _, request_id, propose, robot } =
        request;
    check_ids(session_id, request_id, limits)?;
    from_proto::exploration_request("propose", *propose, "robot", robot.as_ref(), limits)?;
    let result = result.as_ref().ok_or_else(|| Error::field("result", "is missing"))?;
    let definition = from_proto::definition(&v1::CreateSessionRequest::default(), 0, limits)?;
    from_proto::sent_report(result, &definition, i64::MAX, limits).map(drop)
}

fn question(request: &v1::ProposeContactsRequest, limits: &Limits) -> Result<(), Error> {
    let v1::ProposeContactsRequest { session_id, top_k, robot, lease, request_id, explain_vertices } =
        request;
    check_ids(session_id, request_id, limits)?;
    let question = from_proto::exploration_request("top_k", *top_k, "robot", robot.as_ref(), limits)?;
    let question = from_proto::explaining("explain_vertices", explain_vertices.clone(), question, limits)?;
    match *lease {
        None => Ok(()),
        Some(wanted) => from_proto::lease_duration("lease", wanted, "robot", &question, limits).map(drop),
    }
}

/// Over HTTP the path names the session, so that the body need not.
fn check_ids(session_id: &str, request_id: &str, limits: &Limits) -> Result<(), Error> {
    if !session_id.is_empty() {
        from_proto::check_session_named("session_id", session_id)?;
    }
    from_proto::check_name("request_id", request_id, limits)
}

#[cfg(test)]
mod tests {
    use palpate_proto::Timestamp;

    use super::*;

    fn problem(outcome: Result<String, Refusal>) -> String {
        outcome.unwrap_err().problem
    }

    #[test]
    fn a_time_that_json_cannot_write_is_refused_and_every_other_is_written() {
        let result = |seconds| v1::ContactResult {
            observe_time: Some(Timestamp { seconds, nanos: 0 }),
            outcome: Some(v1::contact_result::Outcome::NoContact(v1::NoContact {
                swept_from: Some(v1::Vector3 { x: 0.1, y: 0.0, z: 0.0 }),
                swept_to: Some(v1::Vector3::default()),
                sweep_radius_m: 0.0,
            })),
            ..Default::default()
        };
        let report = |seconds| {
            let request = v1::ReportContactRequest { result: Some(result(seconds)), ..Default::default() };
            message(Call::ReportContact, &request.encode_to_vec())
        };
        for seconds in [i64::MIN, -62_135_596_801, 253_402_300_800, i64::MAX] {
            assert!(problem(report(seconds)).contains("result.observe_time"), "{seconds}");
        }
        for seconds in [-62_135_596_800, 0, 253_402_300_799] {
            assert!(report(seconds).unwrap().contains("observe_time"), "{seconds}");
        }
    }

    #[test]
    fn both_transports_understand_the_same_and_refuse_in_their_own_words() {
        let body = br#"{"session_id": "a-cup", "config": {"method": "METHOD_PAPER"}}"#;
        let understood = json(Call::CreateSession, body).unwrap();
        let request = v1::CreateSessionRequest {
            session_id: "a-cup".into(),
            config: Some(v1::SessionConfig { method: v1::Method::Paper.into(), ..Default::default() }),
            ..Default::default()
        };
        assert_eq!(message(Call::CreateSession, &request.encode_to_vec()).unwrap(), understood);
        let refused = json(Call::CreateSession, br#"{"session_id": "A CUP"}"#).unwrap_err();
        assert!(refused.problem.contains("session_id") && refused.trailers.contains_key("grpc-status"));
        assert!(problem(json(Call::ProposeContacts, b"{")).contains("UNPARSABLE"));
        assert!(problem(message(Call::ProposeContacts, b"\xff")).contains("message"));
    }
}
