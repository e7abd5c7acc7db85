//! Who is let in: whoever calls this server by its own name, and no page of a site that may not call.

use palpate_proto::v1;
use palpate_proto::v1::session_service_client::SessionServiceClient;
use palpate_server::ServeOptions;
use reqwest::Method;
use reqwest::header::{HeaderMap, HeaderValue};
use tonic::codegen::Service;
use tonic::codegen::http::Request;
use tonic::transport::{Channel, Endpoint};

use crate::harness::{
    Outcome, Refused, Server, Transport, accepted, creation, header, reply, say_raw, send, soon,
};

/// A connection over HTTP/2 to a server that is called by this name.
fn called(server: &Server, name: &str) -> Channel {
    let endpoint = Endpoint::from_shared(server.url()).unwrap();
    endpoint.origin(format!("http://{name}").parse().unwrap()).connect_lazy()
}

async fn list_over_grpc(channel: Channel) -> Outcome<v1::ListSessionsResponse> {
    reply(SessionServiceClient::new(channel).list_sessions(v1::ListSessionsRequest::default())).await
}

/// `GET` over HTTP/2.
async fn status_over_http2(mut channel: Channel, path: &str) -> u16 {
    let request = Request::get(path).body(tonic::body::Body::empty()).unwrap();
    soon("a connection", std::future::poll_fn(|context| channel.poll_ready(context))).await.unwrap();
    soon("an answer", channel.call(request)).await.unwrap().status().as_u16()
}

/// A request over HTTP/1.1 with these headers, after which the connection ends.
async fn over_http1(server: &Server, request: &str, headers: &str) -> Outcome<String> {
    say_raw(server.address, format!("{request} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n")).await
}

#[tokio::test]
async fn a_name_that_a_page_has_bound_to_the_loopback_is_refused_over_every_protocol() {
    let server = Server::start().await;
    let created = server.grpc().create(creation("ball")).await.unwrap();
    for host in ["evil.example", "evil.example:7257", "localhost.evil.example", "evil%20", "\u{e9}"] {
        for request in
            ["GET /v1/sessions", "DELETE /v1/sessions/ball", "GET /healthz", "GET /docs/", "GET /no"]
        {
            let refused = over_http1(&server, request, &format!("Host: {host}\r\n")).await.unwrap_err();
            assert_eq!(refused.reason, "HOST_REFUSED", "{request} {host}");
            assert!(refused.message.contains("--allow-host"), "{}", refused.message);
        }
    }
    let target = "GET http://evil.example/v1/sessions";
    assert_eq!(over_http1(&server, target, "Host: localhost\r\n").await.unwrap_err().reason, "HOST_REFUSED");
    assert_eq!(status_over_http2(called(&server, "evil.example"), "/v1/sessions").await, 403);
    let refused = list_over_grpc(called(&server, "evil.example:50051")).await.unwrap_err();
    assert_eq!(refused.reason, "HOST_REFUSED");
    assert!(refused.message.contains("localhost"), "it says what would be right: {}", refused.message);
    assert_eq!(server.grpc().get("ball").await.unwrap(), created);
}

#[tokio::test]
async fn the_loopback_is_called_by_any_of_its_names() {
    let server = Server::start().await;
    for name in
        ["localhost", "LocalHost:50051", "127.0.0.1:50051", "[::1]:50051", "[::1]", "robot.localhost:1"]
    {
        over_http1(&server, "GET /v1/sessions", &format!("Host: {name}\r\n")).await.unwrap();
        assert_eq!(status_over_http2(called(&server, name), "/v1/sessions").await, 200, "{name}");
        list_over_grpc(called(&server, name)).await.unwrap();
    }
    let old = say_raw(server.address, "GET /healthz HTTP/1.0\r\n\r\n").await.unwrap();
    assert!(old.contains(" 200 "), "a probe over HTTP/1.0 names nobody: {old}");
}

#[tokio::test]
async fn a_name_that_the_server_was_given_is_its_own() {
    let allowed_hosts = vec!["Palpate.lan".to_owned()];
    let server = Server::with_options(ServeOptions { allowed_hosts, ..ServeOptions::default() }).await;
    for name in ["palpate.lan", "palpate.lan:443", "localhost"] {
        over_http1(&server, "GET /v1/sessions", &format!("Host: {name}\r\n")).await.unwrap();
        list_over_grpc(called(&server, name)).await.unwrap();
    }
    assert!(list_over_grpc(called(&server, "other.lan")).await.is_err());
}

#[tokio::test]
async fn a_request_that_names_no_server_or_two_is_refused() {
    let server = Server::start().await;
    for headers in ["", "Host: localhost\r\nHost: localhost\r\n"] {
        let refused = over_http1(&server, "GET /v1/sessions", headers).await.unwrap_err();
        assert_eq!(refused.reason, "HOST_MISSING");
    }
}

#[tokio::test]
async fn a_page_of_another_site_neither_reads_nor_changes_anything() {
    let server = Server::start().await;
    let created = server.grpc().create(creation("ball")).await.unwrap();
    for origin in ["https://evil.example", "null", "http://localhost:5173", "http://evil.example:7257"] {
        for (method, path) in [
            (Method::GET, "/v1/sessions/ball"),
            (Method::DELETE, "/v1/sessions/ball"),
            (Method::POST, "/v1/sessions"),
            (Method::OPTIONS, "/v1/sessions"),
        ] {
            let request = server.http().request(method, path).header("origin", origin).body("{}");
            let refused = accepted(request.header("content-type", "application/json")).await.unwrap_err();
            assert_eq!(refused.reason, "ORIGIN_REFUSED", "{path} {origin}");
            assert!(refused.message.contains("--allow-origin"), "{}", refused.message);
        }
        let request = server
            .http()
            .request(Method::POST, "/palpate.v1.SessionService/DeleteSession")
            .header("origin", origin)
            .header("content-type", "application/grpc-web+proto");
        let answer = send(request).await;
        assert_eq!(header(&answer, "content-type"), "application/grpc-web+proto");
        assert_eq!(header(&answer, "grpc-status"), (tonic::Code::PermissionDenied as i32).to_string());
    }
    // Without an origin, but by a browser for another page, as an `<img>` is.
    let picture = server.http().get("/v1/sessions/ball/mesh?format=ply");
    let picture = picture.header("sec-fetch-site", "cross-site").header("sec-fetch-mode", "no-cors");
    assert_eq!(accepted(picture).await.unwrap_err().reason, "ORIGIN_REFUSED");
    assert_eq!(server.grpc().get("ball").await.unwrap(), created);
}

#[tokio::test]
async fn a_page_of_this_server_calls_it_by_whichever_name_it_was_opened() {
    let server = Server::start().await;
    let port = server.address.port();
    for (host, origin) in [("localhost", "http://localhost"), ("127.0.0.1", "http://127.0.0.1")] {
        let request = server.http().post("/v1/sessions", &serde_json::json!({}));
        let request =
            request.header("host", format!("{host}:{port}")).header("origin", format!("{origin}:{port}"));
        assert_eq!(accepted(request).await.unwrap().status(), 201);
    }
}

/// What guards an answer in a browser.
fn guards(headers: &HeaderMap) -> Vec<&str> {
    ["x-content-type-options", "x-frame-options", "referrer-policy", "cross-origin-resource-policy"]
        .map(|name| headers.get(name).map_or("none", |value| value.to_str().unwrap()))
        .to_vec()
}

#[tokio::test]
async fn every_answer_tells_a_browser_not_to_guess_frame_or_share_it() {
    const LAB: &str = "https://lab.example";
    let allowed_origins = vec![HeaderValue::from_static(LAB)];
    let server = Server::with_options(ServeOptions { allowed_origins, ..ServeOptions::default() }).await;
    server.caller(Transport::Http).begin("ball").await;
    for path in [
        "/docs/",
        "/docs/swagger-ui-bundle.js",
        "/openapi.json",
        "/healthz",
        "/v1/sessions",
        "/v1/sessions/ball/mesh?format=ply",
        "/v1/sessions/nowhere",
        "/nothing",
    ] {
        let answer = send(server.http().get(path)).await;
        assert_eq!(guards(answer.headers()), ["nosniff", "DENY", "no-referrer", "same-origin"], "{path}");
        let policy = header(&answer, "content-security-policy");
        assert!(policy.starts_with("default-src 'none'"), "{path}: {policy}");
        assert!(policy.contains("frame-ancestors 'none'"), "{path}: {policy}");
        assert_eq!(policy.contains("script-src"), path.starts_with("/docs"), "{path}: {policy}");
    }
    let refused = send(server.http().get("/").header("origin", "null")).await;
    assert_eq!(guards(refused.headers()), ["nosniff", "DENY", "no-referrer", "same-origin"]);
    let shared = send(server.http().get("/v1/sessions").header("origin", LAB)).await;
    assert_eq!(guards(shared.headers()).last(), Some(&"cross-origin"), "for whom it is");
    assert_eq!(header(&shared, "access-control-allow-origin"), LAB);
}

#[tokio::test]
async fn headers_over_the_limit_are_refused_over_http1_too() {
    let server = Server::start().await;
    for bytes in [17 << 10, 100_000, 1 << 20] {
        let headers = format!("Host: localhost\r\nX-Padding: {}\r\n", "x".repeat(bytes));
        let mut raw = crate::harness::Raw::open(server.address).await;
        // The server may hang up before it has heard all.
        let text = format!("GET /healthz HTTP/1.1\r\n{headers}Connection: close\r\n\r\n");
        raw.try_say(&text).await;
        let answer = raw.hear_to_the_end().await;
        assert!(
            answer.starts_with("HTTP/1.1 431") || bytes > 100_000 && answer.is_empty(),
            "{bytes}: {answer}"
        );
        if bytes <= 100_000 {
            let refused: Refused = crate::harness::outcome(answer).unwrap_err();
            assert_eq!(refused.reason, "HEADER_TOO_LARGE");
            assert!(refused.message.contains("16384"), "{}", refused.message);
        }
    }
}
