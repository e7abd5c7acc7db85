//! What a page in a browser needs: gRPC-Web, and leave to call from another origin only where it was given.
//!
//! A real browser decides; `.ci/run` installs one, and without it these tests fail and say so.

use std::path::PathBuf;
use std::process::Stdio;

use palpate_proto::v1;
use palpate_server::ServeOptions;
use prost::Message;
use reqwest::Method;
use reqwest::header::HeaderValue;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::process::Command;

use crate::harness::{Server, creation, header, send, soon};

#[tokio::test]
async fn a_page_can_call_over_grpc_web() {
    let server = Server::start().await;
    let created = server.grpc().create(creation("ball")).await.unwrap();
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
    let ask_for = |server: &Server, origin: &str, path: &str| {
        server
            .http()
            .request(Method::OPTIONS, path)
            .header("origin", origin)
            .header("access-control-request-method", "POST")
            .header("access-control-request-headers", "content-type,x-grpc-web")
    };
    let leave = async |request| {
        let answer = send(request).await;
        answer.headers().get("access-control-allow-origin").map(|origin| origin.to_str().unwrap().to_owned())
    };
    for path in ["/v1/sessions", "/palpate.v1.SessionService/GetSession"] {
        assert_eq!(leave(ask_for(&open, LAB, path)).await.as_deref(), Some(LAB), "{path}");
        assert_eq!(leave(ask_for(&open, "https://elsewhere.example", path)).await, None, "{path}");
        assert_eq!(leave(ask_for(&closed, LAB, path)).await, None, "{path}");
    }
}

#[tokio::test]
async fn what_every_page_could_send_is_no_origin() {
    for (origin, advice) in
        [("*", "name the page's origin"), ("null", "serve the page"), ("lab", "write http://lab")]
    {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let allowed_origins = vec![HeaderValue::from_static(origin)];
        let options = ServeOptions { allowed_origins, ..ServeOptions::default() };
        let stop = tokio_util::sync::CancellationToken::new();
        let refused = palpate_server::serve(listener, options, stop).await.unwrap_err().to_string();
        assert!(refused.contains(advice), "{refused}");
    }
}

#[tokio::test]
async fn the_documentation_is_shown_by_a_real_browser_within_its_policy() {
    let server = Server::start().await;
    let document = open_in_browser(&format!("{}/docs/", server.url())).await;
    for shown in ["/v1/sessions/{session_id}/contacts", "opblock-summary", "<title>Palpate"] {
        assert!(document.contains(shown), "{shown}: {document}");
    }
}

#[tokio::test]
async fn a_page_of_an_allowed_origin_calls_from_a_real_browser_and_any_other_page_is_blocked() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let origin = format!("http://{}", listener.local_addr().unwrap());
    tokio::spawn(serve_page(listener));
    let shown = async |allowed: &str| {
        let allowed_origins = vec![allowed.parse().unwrap()];
        let server = Server::with_options(ServeOptions { allowed_origins, ..ServeOptions::default() }).await;
        let named =
            v1::CreateSessionRequest { display_name: "a ball for browsers".into(), ..creation("ball") };
        server.grpc().create(named).await.unwrap();
        let document = open_in_browser(&format!("{origin}/?server={}", server.url())).await;
        let (_, rest) = document.split_once("<pre id=\"result\">").unwrap_or_else(|| panic!("{document}"));
        rest.split("</pre>").next().unwrap().lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let allowed = shown(&origin).await;
    let refusal = "grpc-web refusal: 5, there%20is%20no%20session%20%22nowhere%22, true";
    assert_eq!(allowed, ["grpc-web: read", refusal, "http: 201, true", "events: 1"]);
    let blocked = shown("http://127.0.0.1:9").await;
    let expected =
        ["grpc-web", "grpc-web refusal", "http"].map(|what| format!("{what}: blocked (TypeError)"));
    assert_eq!(blocked[..3], expected);
    assert_eq!(blocked[3], "events: blocked (Error)");
}

/// Answers every request with the page.
async fn serve_page(listener: TcpListener) {
    const PAGE: &str = include_str!("browsers/page.html");
    while let Ok((mut connection, _)) = listener.accept().await {
        tokio::spawn(async move {
            // One read is enough: a browser's request for a page is short.
            let _ = connection.read(&mut [0; 4096]).await;
            let length = PAGE.len();
            let head = format!(
                "HTTP/1.1 200 OK\r\ncontent-type: text/html\r\ncontent-length: {length}\r\nconnection: close\r\n\r\n"
            );
            let _ = connection.write_all(format!("{head}{PAGE}").as_bytes()).await;
        });
    }
}

/// Opens `url` in Chromium and gives the document as it is when nothing more happens.
async fn open_in_browser(url: &str) -> String {
    let profile = tempfile::tempdir().unwrap();
    let browser = Command::new(chromium())
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .args(["--disable-dev-shm-usage", "--virtual-time-budget=20000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(url)
        .stderr(Stdio::null())
        .kill_on_drop(true)
        .output();
    String::from_utf8(soon("the browser's document", browser).await.unwrap().stdout).unwrap()
}

fn chromium() -> PathBuf {
    let folders: Vec<PathBuf> =
        std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()).collect();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let mut paths = names.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    paths
        .find(|path| path.is_file())
        .unwrap_or_else(|| panic!("this test needs a browser: apt-get install chromium, as .ci/run does"))
}
