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
    let mut reconstruction = caller.reconstruction();
    let evaluation = reconstruction.evaluate_session(v1::EvaluateSessionRequest::default());
    check(reply(evaluation).await, "EvaluateSession");
}

#[tokio::test]
async fn calls_of_a_later_version_say_so_over_http() {
    let server = Server::start().await;
    for (method, path, what) in [
        (Method::POST, "/v1/sessions/ball/evaluate", "EvaluateSession"),
        (Method::GET, "/v1/sessions/ball/series", "series"),
        (Method::GET, "/v1/experiments", "experiments"),
        (Method::GET, "/v1/experiments/mine/summary", "summary"),
    ] {
        check(accepted(server.http().request(method, path)).await, what);
    }
}
