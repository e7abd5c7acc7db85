//! What a page in a browser needs: gRPC-Web, and leave to call from another origin only where it was given.

use palpate_proto::v1;
use palpate_server::ServeOptions;
use prost::Message;
use reqwest::Method;
use reqwest::header::HeaderValue;

use crate::harness::{Server, header, send};

#[tokio::test]
async fn a_page_can_call_over_grpc_web() {
    let server = Server::start().await;
    let created = server.grpc().create(crate::harness::creation("ball")).await.unwrap();
    let message = v1::GetSessionRequest { session_id: "ball".into() }.encode_to_vec();
    // A frame: no compression, the length, the message.
    let frame = [&[0][..], &u32::try_from(message.len()).unwrap().to_be_bytes(), &message].concat();
    let request = server
        .http()
        .request(Method::POST, "/palpate.v1.SessionService/GetSession")
        .header("content-type", "application/grpc-web+proto")
        .body(frame);
    let answer = send(request).await;
    assert_eq!(answer.status(), 200);
    assert!(header(&answer, "content-type").starts_with("application/grpc-web"));
    let body = answer.bytes().await.unwrap();
    let length = u32::from_be_bytes(body[1..5].try_into().unwrap()) as usize;
    let (message, trailer) = body[5..].split_at(length);
    assert_eq!(v1::Session::decode(message).unwrap(), created);
    assert_eq!(trailer[0], 0x80, "the trailer is a frame of its own");
    assert!(String::from_utf8_lossy(&trailer[5..]).contains("grpc-status:0"));
}

#[tokio::test]
async fn only_pages_of_allowed_origins_may_call() {
    const LAB: &str = "https://lab.example";
    let allowed_origins = vec![HeaderValue::from_static(LAB)];
    let open = Server::with_options(ServeOptions { allowed_origins, ..ServeOptions::default() }).await;
    let closed = Server::start().await;
    let ask = |server: &Server, origin: &str| {
        server
            .http()
            .request(Method::OPTIONS, "/v1/sessions")
            .header("origin", origin)
            .header("access-control-request-method", "POST")
            .header("access-control-request-headers", "content-type")
    };
    let leave = async |request| {
        let answer = send(request).await;
        answer.headers().get("access-control-allow-origin").map(|origin| origin.to_str().unwrap().to_owned())
    };
    assert_eq!(leave(ask(&open, LAB)).await.as_deref(), Some(LAB));
    assert_eq!(leave(ask(&open, "https://elsewhere.example")).await, None);
    assert_eq!(leave(ask(&closed, LAB)).await, None);
}
