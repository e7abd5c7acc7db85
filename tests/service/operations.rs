//! What operators, tools and the curious ask a server.

use std::time::Duration;

use palpate_proto::v1;
use palpate_server::Limits;
use serde_json::Value;
use tokio_stream::StreamExt;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use tonic_reflection::pb::v1::ServerReflectionRequest;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;

use crate::harness::{Refused, Server, Transport, accepted, header, reply, send, soon};

const SERVICES: [&str; 3] =
    ["palpate.v1.SessionService", "palpate.v1.ExplorationService", "palpate.v1.ReconstructionService"];

#[tokio::test]
async fn a_server_tells_what_it_is_and_can_do() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let info = server.caller(transport).server_info().await.unwrap();
        assert!(info.version.starts_with(char::is_numeric) && !info.algorithm_version.is_empty());
        assert!(info.capabilities.iter().any(|name| name == "method:paper"));
        assert_eq!(info.mesh_formats.len(), 5);
        assert_eq!(info.max_message_bytes, 16 << 20);
    }
    let before = server.grpc().server_info().await.unwrap().instance_id;
    let server = server.restart().await;
    assert_ne!(server.grpc().server_info().await.unwrap().instance_id, before);
}

#[tokio::test]
async fn reflection_lists_the_services_and_hands_out_their_description() {
    let server = Server::start().await;
    let mut reflection = ServerReflectionClient::new(server.channel());
    let mut questions = vec![MessageRequest::ListServices(String::new())];
    questions.extend(SERVICES.map(|name| MessageRequest::FileContainingSymbol(name.into())));
    let questions = questions
        .into_iter()
        .map(|question| ServerReflectionRequest { host: String::new(), message_request: Some(question) });
    let answers = reflection.server_reflection_info(tokio_stream::iter(questions.collect::<Vec<_>>()));
    let mut answers = answers.await.unwrap().into_inner();
    let mut next =
        async || soon("an answer", answers.next()).await.unwrap().unwrap().message_response.unwrap();
    let MessageResponse::ListServicesResponse(list) = next().await else { panic!("a list") };
    let names: Vec<&str> = list.service.iter().map(|service| service.name.as_str()).collect();
    for service in SERVICES {
        assert!(names.contains(&service), "{names:?}");
        let MessageResponse::FileDescriptorResponse(files) = next().await else { panic!("a description") };
        assert!(!files.file_descriptor_proto.is_empty());
    }
    assert!(names.contains(&"grpc.health.v1.Health"));
}

#[tokio::test]
async fn every_service_is_healthy() {
    let server = Server::start().await;
    let mut health = HealthClient::new(server.channel());
    for service in SERVICES.into_iter().chain([""]) {
        let request = HealthCheckRequest { service: service.into() };
        let status = soon("an answer", health.check(request)).await.unwrap().into_inner().status();
        assert_eq!(status, ServingStatus::Serving, "{service:?}");
    }
}

#[tokio::test]
async fn probes_answer_and_pages_are_pages() {
    let server = Server::start().await;
    for (path, text) in [("/healthz", "ok\n"), ("/livez", "ok\n"), ("/readyz", "ready\n")] {
        let response = send(server.http().get(path)).await;
        assert_eq!(response.status(), 200, "{path}");
        assert_eq!(response.text().await.unwrap(), text);
    }
    let page = send(server.http().get("/")).await;
    assert_eq!(page.status(), 200);
    assert!(header(&page, "content-security-policy").contains("script-src 'self'"));
    assert!(page.text().await.unwrap().contains("/docs/"));
    for path in ["/docs", "/docs/"] {
        let page = send(server.http().get(path)).await;
        assert_eq!(page.status(), 200, "{path}");
        assert!(header(&page, "content-type").starts_with("text/html"));
        assert!(page.text().await.unwrap().contains("swagger-ui"));
    }
}

#[tokio::test]
async fn the_openapi_document_names_every_route() {
    let server = Server::start().await;
    let document = accepted(server.http().get("/openapi.json")).await.unwrap();
    let document: Value = document.json().await.unwrap();
    let described = |path: &str, method: &str| document["paths"][path][method]["operationId"].is_string();
    for (path, methods) in [
        ("/v1/sessions", vec!["get", "post"]),
        ("/v1/sessions/{session_id}", vec!["get", "delete"]),
        ("/v1/sessions/{session_id}/priors", vec!["post"]),
        ("/v1/sessions/{session_id}/candidates", vec!["post"]),
        ("/v1/sessions/{session_id}/contacts", vec!["post"]),
        ("/v1/sessions/{session_id}/mesh", vec!["get"]),
        ("/v1/sessions/{session_id}/events", vec!["get"]),
        ("/readyz", vec!["get"]),
        ("/version", vec!["get"]),
    ] {
        for method in methods {
            assert!(described(path, method), "{method} {path}");
        }
    }
    let candidate = &document["components"]["schemas"]["Candidate"]["properties"]["score"]["description"];
    assert!(candidate.as_str().unwrap().contains("sum of weight"), "the contract's comments are in it");
}

#[tokio::test]
async fn a_stop_ends_open_streams_at_once_and_tells_why() {
    // The time to finish is never over in this test, so streams that ended were told to.
    let limits = Limits { drain: Duration::from_secs(3600), ..Limits::default() };
    let server = Server::with_limits(limits).await;
    let caller = server.grpc();
    caller.begin("ball").await;
    let request =
        v1::WatchSessionRequest { session_id: "ball".into(), after_revision: 2, ..Default::default() };
    let mut watch = reply(caller.reconstruction().watch_session(request)).await.unwrap();
    let (robot, messages) = tokio::sync::mpsc::channel(1);
    let messages = tokio_stream::wrappers::ReceiverStream::new(messages);
    let mut explore = reply(caller.exploration().explore(messages)).await.unwrap();
    let open = v1::ExploreOpen { session_id: "ball".into(), ..Default::default() };
    let open = v1::explore_request::Message::Open(open);
    robot.send(v1::ExploreRequest { message: Some(open), ..Default::default() }).await.unwrap();
    soon("the opening", explore.next()).await.unwrap().unwrap();
    let mut events = server.http().events("ball", Some(2)).await;

    server.stop().await;
    let end = watch.next().await.unwrap().unwrap_err();
    assert_eq!(Refused::from_status(&end).reason, "DRAINING");
    let end = explore.next().await.unwrap().unwrap_err();
    assert_eq!(Refused::from_status(&end).reason, "DRAINING");
    let end = events.next().await.unwrap();
    assert!(end.name == "problem" && end.data.contains("DRAINING"), "{end:?}");
    assert_eq!(events.next().await, None);
}
