//! Every call of the contract is served, over gRPC and over HTTP: taken from the descriptors, so that a new one cannot be
//! forgotten.

use palpate_proto::Bytes;
use prost_reflect::{DescriptorPool, MethodDescriptor};
use reqwest::Method;
use tonic::{Code, Request, Status};

use crate::harness::{OnTheWire, Server, send, soon};

/// Where each call is over HTTP; nothing for the stream of a robot, which needs both directions.
const ROUTES: [(&str, Option<(&str, &str)>); 25] = [
    ("CreateSession", Some(("POST", "/v1/sessions"))),
    ("GetSession", Some(("GET", "/v1/sessions/ball"))),
    ("ListSessions", Some(("GET", "/v1/sessions"))),
    ("UpdateSession", Some(("PATCH", "/v1/sessions/ball"))),
    ("FinishSession", Some(("POST", "/v1/sessions/ball/finish"))),
    ("DeleteSession", Some(("DELETE", "/v1/sessions/ball"))),
    ("ForkSession", Some(("POST", "/v1/sessions/ball/fork"))),
    ("ExportSession", Some(("GET", "/v1/sessions/ball/export?format=csv"))),
    ("ImportSession", Some(("POST", "/v1/imports"))),
    ("ListExperiments", Some(("GET", "/v1/experiments"))),
    ("SummarizeExperiment", Some(("GET", "/v1/experiments/mine/summary"))),
    ("GetServerInfo", Some(("GET", "/version"))),
    ("AddVisualPrior", Some(("POST", "/v1/sessions/ball/priors"))),
    ("ProposeContacts", Some(("POST", "/v1/sessions/ball/candidates"))),
    ("ReportContact", Some(("POST", "/v1/sessions/ball/contacts"))),
    ("RetractEvent", Some(("POST", "/v1/sessions/ball/events/2/retract"))),
    ("Explore", None),
    ("GetMesh", Some(("GET", "/v1/sessions/ball/mesh"))),
    ("ListEvents", Some(("GET", "/v1/sessions/ball/events"))),
    ("WatchSession", Some(("GET", "/v1/sessions/ball/events"))),
    ("ReplaySession", Some(("GET", "/v1/sessions/ball/replay"))),
    ("EvaluateSession", Some(("POST", "/v1/sessions/ball/evaluate"))),
    ("GetSeries", Some(("GET", "/v1/sessions/ball/series"))),
    ("SetReference", Some(("PUT", "/v1/sessions/ball/reference"))),
    ("GetReference", Some(("GET", "/v1/sessions/ball/reference"))),
];
const ALSO: [(&str, &str); 1] = [("DELETE", "/v1/sessions/ball/reference")];

fn calls() -> Vec<MethodDescriptor> {
    let contract = DescriptorPool::decode(palpate_proto::FILE_DESCRIPTOR_SET).unwrap();
    let services: Vec<_> =
        contract.services().filter(|service| service.package_name() == "palpate.v1").collect();
    assert_eq!(services.len(), 3);
    services.iter().flat_map(|service| service.methods().collect::<Vec<_>>()).collect()
}

#[tokio::test]
async fn every_call_of_the_contract_is_served_over_grpc() {
    let server = Server::start().await;
    for call in calls() {
        let path = format!("/{}/{}", call.parent_service().full_name(), call.name());
        let mut client = tonic::client::Grpc::new(server.channel());
        client.ready().await.unwrap();
        // An empty message, and none after it: every call can answer that, if only with a refusal.
        let messages = Request::new(tokio_stream::iter([Bytes::new()]));
        let answer = soon("an answer", client.streaming(messages, path.parse().unwrap(), OnTheWire)).await;
        let refusal = match answer {
            Ok(answer) => soon("its first message", answer.into_inner().message()).await.err(),
            Err(status) => Some(status),
        };
        let code = refusal.as_ref().map_or(Code::Ok, Status::code);
        assert!(!matches!(code, Code::Unimplemented | Code::Internal | Code::Unknown), "{path}: {refusal:?}");
    }
}

#[tokio::test]
async fn every_call_of_the_contract_has_its_route() {
    let server = Server::start().await;
    for call in calls() {
        let is_listed =
            ROUTES.iter().any(|(name, _)| *name == call.name()) || call.name() == "DeleteReference";
        assert!(is_listed, "{} has no route: say which, or that it needs both directions", call.name());
    }
    for (method, path) in ROUTES.iter().filter_map(|(_, route)| *route).chain(ALSO) {
        let response =
            send(server.http().request(Method::from_bytes(method.as_bytes()).unwrap(), path)).await;
        let status = response.status().as_u16();
        let text = response.text().await.unwrap();
        let is_refused_as_such = text.contains("NO_SUCH_PATH") || matches!(status, 405 | 500 | 501);
        assert!(!is_refused_as_such, "{method} {path}: {status} {text}");
    }
}
