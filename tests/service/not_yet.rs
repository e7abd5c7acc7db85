//! What the contract has and this version has not says so, instead of pretending.

use palpate_proto::v1;
use reqwest::Method;

use crate::harness::{Outcome, Server, accepted, reply};

#[track_caller]
fn check<T: std::fmt::Debug>(outcome: Outcome<T>, what: &str) {
    let refused = outcome.unwrap_err();
    assert_eq!(refused.reason, "UNIMPLEMENTED", "{what}");
    assert!(refused.message.contains(what), "{}", refused.message);
}

#[tokio::test]
async fn calls_of_a_later_version_say_so_over_grpc() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.begin("ball").await;
    let mut sessions = caller.sessions();
    check(reply(sessions.export_session(v1::ExportSessionRequest::default())).await, "ExportSession");
    let nothing = tokio_stream::empty::<v1::ImportSessionRequest>();
    check(reply(sessions.import_session(nothing)).await, "ImportSession");
}

#[tokio::test]
async fn calls_of_a_later_version_say_so_over_http() {
    let server = Server::start().await;
    for (method, path, what) in [
        (Method::GET, "/v1/sessions/ball/export", "ExportSession"),
        (Method::POST, "/v1/imports", "ImportSession"),
    ] {
        check(accepted(server.http().request(method, path)).await, what);
    }
}

#[tokio::test]
async fn wishes_of_a_later_version_are_refused_and_not_ignored() {
    let server = Server::start().await;
    server.grpc().begin("ball").await;
    let glb = v1::GetMeshRequest {
        session_id: "ball".into(),
        format: v1::MeshFormat::Glb.into(),
        ..Default::default()
    };
    check(server.grpc().mesh(glb).await, "GLB");
    check(accepted(server.http().get("/v1/sessions/ball/mesh?format=glb")).await, "GLB");
    assert_eq!(server.grpc().get("ball").await.unwrap().revision, 2);
}
