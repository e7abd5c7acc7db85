//! What can go wrong over HTTP before a message of the contract is there.

use reqwest::{Method, RequestBuilder};
use serde_json::json;

use crate::harness::{Refused, Server, accepted, header, send};

async fn refused(request: RequestBuilder) -> Refused {
    accepted(request).await.unwrap_err()
}

#[tokio::test]
async fn a_body_that_is_no_json_is_told_apart_from_one_that_says_something_wrong() {
    let server = Server::start().await;
    let http = server.http();
    let body = |media_type: &str, body: &'static str| {
        http.request(Method::POST, "/v1/sessions").header("content-type", media_type).body(body)
    };
    assert_eq!(refused(body("application/json", "{\"session_id\":")).await.reason, "UNPARSABLE");
    assert_eq!(refused(body("application/json", "")).await.reason, "UNPARSABLE");
    assert_eq!(refused(body("text/plain", "{}")).await.reason, "UNSUPPORTED_MEDIA_TYPE");
    let misspelt = refused(http.post("/v1/sessions", &json!({"config": {"sed": 1}}))).await;
    assert_eq!(misspelt.fields, ["config.sed"]);
    assert!(misspelt.message.contains("seed"), "it says what there is: {}", misspelt.message);
    let wrong = refused(http.post("/v1/sessions", &json!({"config": {"seed": "many"}}))).await;
    assert_eq!(wrong.fields, ["config.seed"]);
    let negative = refused(http.post("/v1/sessions", &json!({"config": {"seed": -1}}))).await;
    assert_eq!(negative.fields, ["config.seed"]);
    let other = refused(http.post("/v1/sessions/ball/contacts", &json!({"session_id": "mug"}))).await;
    assert_eq!(other.fields, ["session_id"], "path and body disagree");
}

#[tokio::test]
async fn numbers_in_json_are_checked_like_packed_ones() {
    let server = Server::start().await;
    let http = server.http();
    accepted(http.post("/v1/sessions", &json!({"session_id": "ball"}))).await.unwrap();
    let add = |points: serde_json::Value| {
        http.post("/v1/sessions/ball/priors", &json!({"prior": {"points": points}}))
    };
    let short = refused(add(json!([[0, 0, 0], [1, 2]]))).await;
    assert_eq!(short.fields, ["prior.points[1]"]);
    let text = refused(add(json!([[0, 0, 0], [1, "2", 3]]))).await;
    assert_eq!(text.fields, ["prior.points[1]"]);
    let far = refused(add(json!([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1e5, 0, 0]]))).await;
    assert_eq!((far.reason.as_str(), far.fields), ("NON_FINITE", vec!["prior.points".to_owned()]));
    let image = http.request(Method::POST, "/v1/sessions/ball/priors").header("content-type", "image/jpeg");
    assert_eq!(refused(image.body("x")).await.reason, "UNSUPPORTED_MEDIA_TYPE");
    let file = |query: &str| {
        let path = format!("/v1/sessions/ball/priors?{query}");
        http.request(Method::POST, &path).header("content-type", "application/octet-stream").body("x")
    };
    assert_eq!(refused(file("viewpoint=1,2")).await.fields, ["viewpoint"]);
    assert_eq!(refused(file("uncertainty=much")).await.fields, ["uncertainty"]);
    assert_eq!(refused(file("voxel=1")).await.fields, ["voxel"]);
    assert_eq!(refused(file("fx=600")).await.fields, ["fx"], "that is for depth images");
    assert_eq!(refused(file("point_step=16")).await.fields, ["prior.packed.x_offset"]);
}

#[tokio::test]
async fn unknown_paths_methods_and_parameters_are_problems() {
    let server = Server::start().await;
    let http = server.http();
    for path in ["/v2/sessions", "/v1/session", "/v1/sessions/ball/touches", "/favicon.txt"] {
        let nowhere = refused(http.get(path)).await;
        assert_eq!(nowhere.reason, "NO_SUCH_PATH");
        assert!(nowhere.message.contains(path) && nowhere.message.contains("/docs"), "{}", nowhere.message);
    }
    let put = || http.request(Method::PUT, "/v1/sessions");
    assert_eq!(refused(put()).await.reason, "METHOD_NOT_ALLOWED");
    assert!(header(&send(put()).await, "allow").contains("POST"));
    assert_eq!(refused(http.get("/v1/sessions?pagesize=3")).await.fields, ["pagesize"]);
    assert_eq!(refused(http.get("/v1/sessions?page_size=x")).await.fields, ["page_size"]);
    assert_eq!(refused(http.get("/v1/sessions?state=asleep")).await.fields, ["state"]);
    assert_eq!(refused(http.get("/v1/sessions?labels=object")).await.fields, ["labels"]);
}

#[tokio::test]
async fn every_answer_carries_the_id_of_its_request() {
    let server = Server::start().await;
    let given = send(server.http().get("/v1/nowhere").header("x-request-id", "mine-7")).await;
    assert_eq!(header(&given, "x-request-id"), "mine-7");
    let made = send(server.http().get("/healthz")).await;
    assert_eq!(header(&made, "x-request-id").len(), 36);
}
