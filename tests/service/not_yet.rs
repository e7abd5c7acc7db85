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
    let (mut sessions, mut exploration, mut reconstruction) =
        (caller.sessions(), caller.exploration(), caller.reconstruction());
    check(reply(sessions.update_session(v1::UpdateSessionRequest::default())).await, "UpdateSession");
    check(reply(sessions.finish_session(v1::FinishSessionRequest::default())).await, "FinishSession");
    check(reply(sessions.fork_session(v1::ForkSessionRequest::default())).await, "ForkSession");
    check(reply(sessions.export_session(v1::ExportSessionRequest::default())).await, "ExportSession");
    let nothing = tokio_stream::empty::<v1::ImportSessionRequest>();
    check(reply(sessions.import_session(nothing)).await, "ImportSession");
    check(reply(exploration.retract_event(v1::RetractEventRequest::default())).await, "RetractEvent");
    check(reply(reconstruction.replay_session(v1::ReplaySessionRequest::default())).await, "ReplaySession");
    let evaluation = reconstruction.evaluate_session(v1::EvaluateSessionRequest::default());
    check(reply(evaluation).await, "EvaluateSession");
}

#[tokio::test]
async fn calls_of_a_later_version_say_so_over_http() {
    let server = Server::start().await;
    for (method, path, what) in [
        (Method::PATCH, "/v1/sessions/ball", "UpdateSession"),
        (Method::POST, "/v1/sessions/ball/finish", "FinishSession"),
        (Method::POST, "/v1/sessions/ball/fork", "ForkSession"),
        (Method::POST, "/v1/sessions/ball/events/2/retract", "RetractEvent"),
        (Method::POST, "/v1/sessions/ball/evaluate", "EvaluateSession"),
        (Method::GET, "/v1/sessions/ball/series", "series"),
        (Method::GET, "/v1/sessions/ball/export", "ExportSession"),
        (Method::POST, "/v1/imports", "ImportSession"),
        (Method::GET, "/v1/experiments", "experiments"),
        (Method::GET, "/v1/experiments/mine/summary", "summary"),
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
