//! A connection costs something, so there are no more than the server can bear, and none stays that does nothing.

use std::io::Write;
use std::pin::Pin;
use std::process::Stdio;
use std::task::{Context, Poll};
use std::time::Duration;

use flate2::Compression;
use flate2::write::GzEncoder;
use hyper::body::{Body, Bytes, Frame};
use palpate_client::proto::v1::explore_request::Message;
use palpate_proto::v1;
use palpate_server::Limits;
use reqwest::Method;
use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::process::Command;
use tokio_stream::StreamExt;
use tonic::codegen::Service;
use tonic::codegen::http::Request;

use crate::harness::{
    Raw, Refused, Server, Transport, accepted, cap, creation, outcome, prior, reply, say_raw, soon,
};

/// The head of a request that changes something, whose body is `length` bytes long.
fn head(length: usize) -> String {
    format!(
        "POST /v1/sessions/ball/priors HTTP/1.1\r\nHost: localhost\r\n\
         Content-Type: application/octet-stream\r\nContent-Length: {length}\r\n\r\n"
    )
}

/// The first part of a body, after which nothing comes.
struct Stalled(Option<Bytes>);

impl Body for Stalled {
    type Data = Bytes;
    type Error = std::convert::Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Self::Error>>> {
        self.0.take().map_or(Poll::Pending, |data| Poll::Ready(Some(Ok(Frame::data(data)))))
    }
}

#[tokio::test]
async fn a_body_that_does_not_arrive_is_cut_over_http() {
    let limits = Limits { body_timeout: Duration::from_millis(200), ..Limits::default() };
    let server = Server::with_limits(limits).await;
    server.grpc().create(creation("ball")).await.unwrap();
    let mut silent = Raw::open(server.address).await;
    silent.say(head(1000) + "a bit").await;
    let refused = outcome(silent.hear_to_the_end().await).unwrap_err();
    assert_eq!(refused.reason, "BODY_TIMEOUT");
    assert!(refused.message.contains("0.2 s"), "{}", refused.message);
    // A byte now and then is no better than none.
    let mut dribbling = Raw::open(server.address).await;
    dribbling.say(head(100_000)).await;
    let answer = dribbling.dribble_to_the_end().await;
    assert!(answer.starts_with("HTTP/1.1 408"), "{answer}");
    assert_eq!(server.grpc().get("ball").await.unwrap().revision, 1);
}

#[tokio::test]
async fn a_message_that_does_not_arrive_is_cut_over_grpc_and_a_stream_of_them_is_not() {
    let limits = Limits { body_timeout: Duration::from_millis(200), ..Limits::default() };
    let server = Server::with_limits(limits).await;
    let caller = server.grpc();
    caller.create(creation("ball")).await.unwrap();
    let (messages, to_server) = tokio::sync::mpsc::channel(1);
    let stream = tokio_stream::wrappers::ReceiverStream::new(to_server);
    let mut heard = reply(caller.exploration().explore(stream)).await.unwrap();

    let mut channel = server.channel();
    soon("a connection", std::future::poll_fn(|context| channel.poll_ready(context))).await.unwrap();
    let request = Request::post("/palpate.v1.SessionService/CreateSession")
        .header("content-type", "application/grpc")
        .header("te", "trailers")
        .body(tonic::body::Body::new(Stalled(Some(Bytes::from_static(&[0, 0, 0, 0, 99, 10])))))
        .unwrap();
    let answer = soon("an answer", channel.call(request)).await.unwrap();
    let status = tonic::Status::from_header_map(answer.headers()).unwrap();
    assert_eq!(Refused::from_status(&status).reason, "BODY_TIMEOUT");

    let ping = v1::ExploreRequest {
        id: 1,
        message: Some(Message::Ping(v1::Ping { nonce: 5 })),
        ..Default::default()
    };
    messages.send(ping).await.unwrap();
    assert_eq!(soon("the pong", heard.next()).await.unwrap().unwrap().in_reply_to, 1);
}

#[tokio::test]
async fn an_idle_connection_is_closed_and_one_with_an_open_stream_is_not() {
    let limits = Limits { idle: Duration::from_millis(200), ..Limits::default() };
    let server = Server::with_limits(limits).await;
    let caller = server.caller(Transport::Http);
    caller.create(creation("ball")).await.unwrap();
    let mut events = server.http().events("ball", None).await;
    assert_eq!(events.next().await.unwrap().name, "created");

    let mut silent = Raw::open(server.address).await;
    assert_eq!(silent.hear_to_the_end().await, "");
    let mut polite = Raw::open(server.address).await;
    polite.say("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").await;
    assert!(polite.hear_to_the_end().await.starts_with("HTTP/1.1 200"));
    // The preface of HTTP/2 with empty settings, and then not even an answer to the server's leave.
    let mut settled = Raw::open(server.address).await;
    settled.say(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0").await;
    let leave = settled.hear_to_the_end().await;
    assert!(leave.contains("\0\0\u{8}\u{7}\0"), "the server takes leave with GOAWAY: {leave:?}");

    caller.add_prior(prior("ball")).await.unwrap();
    assert_eq!(events.next().await.unwrap().name, "visual_prior");
}

#[tokio::test]
async fn a_client_gets_in_as_soon_as_another_one_leaves() {
    let server = Server::with_limits(Limits { connections: 2, ..Limits::default() }).await;
    let hello = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
    let (mut one, mut two) = (Raw::open(server.address).await, Raw::open(server.address).await);
    for taken in [&mut one, &mut two] {
        taken.say(hello).await;
        taken.hear("200 OK").await;
    }
    let refused = outcome(Raw::open(server.address).await.hear_to_the_end().await).unwrap_err();
    assert_eq!(refused.reason, "OVERLOADED");
    assert!(refused.retry_after.is_some() && refused.message.contains("connections"), "{refused:?}");
    one.say(hello).await;
    one.hear("200 OK").await;
    drop(two);
    let patient = async {
        while !{
            let mut next = Raw::open(server.address).await;
            next.try_say("GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").await;
            next.hear_to_the_end().await.starts_with("HTTP/1.1 200")
        } {}
    };
    soon("a place", patient).await;
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn more_callers_than_files_neither_stop_the_server_nor_keep_it_busy() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = Command::new("sh")
        .args(["-c", "ulimit -n 100; exec \"$0\" --log info serve --listen 127.0.0.1:0 --database log.db"])
        .arg(env!("CARGO_BIN_EXE_palpate-under-test"))
        .current_dir(folder.path())
        .stderr(Stdio::piped())
        .kill_on_drop(true)
        .spawn()
        .unwrap();
    let mut log = BufReader::new(child.stderr.take().unwrap()).lines();
    let address = loop {
        let line = soon("the log", log.next_line()).await.unwrap().unwrap();
        if let Some((_, rest)) = line.split_once("api=") {
            let address = rest.split_whitespace().next().unwrap().trim_matches('"');
            break address.strip_prefix("http://").unwrap().parse().unwrap();
        }
    };
    let line = soon("how many it takes", log.next_line()).await.unwrap().unwrap();
    assert!(line.contains("capacity=50"), "{line}");
    let mut crowd = Vec::new();
    for _ in 0..200 {
        crowd.push(Raw::open(address).await);
    }
    let line = soon("a line about it", log.next_line()).await.unwrap().unwrap();
    assert!(line.contains("WARN") && line.contains("connections are taken"), "{line}");
    let before = cpu_ticks(child.id().unwrap());
    tokio::time::sleep(Duration::from_secs(2)).await;
    let spent = cpu_ticks(child.id().unwrap()) - before;
    assert!(spent < 50, "{spent} of 200 hundredths of a second");
    drop(crowd);
    let hello = "GET /v1/sessions HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    let patient = async {
        loop {
            let mut next = Raw::open(address).await;
            next.try_say(hello).await;
            if next.hear_to_the_end().await.starts_with("HTTP/1.1 200") {
                break;
            }
        }
    };
    soon("a place", patient).await;
    child.kill().await.unwrap();
    let mut lines = 0;
    while let Some(line) = log.next_line().await.unwrap() {
        lines += usize::from(line.contains("connections are taken"));
    }
    assert!(lines <= 1, "it says so once and not {lines} times more");
}

/// Time on the processor, in hundredths of a second.
#[cfg(target_os = "linux")]
fn cpu_ticks(process: u32) -> u64 {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
    let (_, fields) = stat.rsplit_once(") ").unwrap();
    let fields: Vec<&str> = fields.split(' ').collect();
    fields[11..13].iter().map(|field| field.parse::<u64>().unwrap()).sum()
}

#[tokio::test]
async fn the_bodies_of_all_callers_together_are_bounded() {
    let server = Server::with_limits(Limits { body_bytes: 64 << 10, ..Limits::default() }).await;
    let caller = server.grpc();
    caller.create(creation("ball")).await.unwrap();
    let large = vec![0; 40 << 10];
    let mut first = Raw::open(server.address).await;
    first.say(head(50 << 10)).await;
    first.say(&large).await;

    // Whatever came of the first one's body, it takes a while until all of it counts.
    let crowded = async {
        loop {
            let mut second = head(40 << 10).replace("\r\n\r\n", "\r\nConnection: close\r\n\r\n").into_bytes();
            second.extend(&large);
            match say_raw(server.address, second).await.unwrap_err() {
                refused if refused.reason == "OVERLOADED" => return refused,
                _ => continue,
            }
        }
    };
    let refused = soon("a refusal", crowded).await;
    assert!(refused.retry_after.is_some() && refused.message.contains("65536"), "{refused:?}");
    let huge = v1::VisualPrior { points: vec![0; 40 << 10].into(), ..cap() };
    let request = v1::AddVisualPriorRequest { prior: Some(huge), ..prior("ball") };
    let refused = caller.add_prior(request).await.unwrap_err();
    assert_eq!(refused.reason, "OVERLOADED");
    assert!(refused.retry_after.is_some(), "{refused:?}");
    // What is small still gets in, and what was held is free when its sender leaves.
    caller.add_prior(prior("ball")).await.unwrap();
    drop(first);
    let free = async {
        let mut alone = head(40 << 10).replace("\r\n\r\n", "\r\nConnection: close\r\n\r\n").into_bytes();
        alone.extend(&large);
        while say_raw(server.address, &alone)
            .await
            .err()
            .is_some_and(|refused| refused.reason == "OVERLOADED")
        {}
    };
    soon("room", free).await;
}

#[tokio::test]
async fn a_compressed_body_counts_by_what_it_becomes() {
    let server = Server::with_limits(Limits { body_bytes: 64 << 10, ..Limits::default() }).await;
    server.grpc().create(creation("ball")).await.unwrap();
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(&vec![0; 1 << 20]).unwrap();
    let packed = packed.finish().unwrap();
    assert!(packed.len() < 8 << 10);
    let request = server
        .http()
        .request(Method::POST, "/v1/sessions/ball/priors")
        .header("content-type", "application/octet-stream")
        .header("content-encoding", "gzip")
        .body(packed);
    assert_eq!(accepted(request).await.unwrap_err().reason, "OVERLOADED");
}

#[tokio::test]
async fn a_long_stream_of_messages_counts_by_the_one_that_arrives() {
    let server = Server::with_limits(Limits { body_bytes: 64 << 10, ..Limits::default() }).await;
    let (messages, to_server) = tokio::sync::mpsc::channel(1);
    let stream = tokio_stream::wrappers::ReceiverStream::new(to_server);
    let mut heard = reply(server.grpc().exploration().explore(stream)).await.unwrap();
    let say = async |id: u64, length: usize| {
        let ping = Message::Ping(v1::Ping { nonce: id });
        let request_id = "x".repeat(length);
        messages.send(v1::ExploreRequest { id, request_id, message: Some(ping) }).await.unwrap();
    };
    for id in 1..=10 {
        say(id, 20 << 10).await;
        let answer = soon("an answer", heard.next()).await.unwrap().unwrap();
        assert_eq!(answer.in_reply_to, id, "{answer:?}");
    }
    say(11, 70 << 10).await;
    let refused = loop {
        match soon("an end", heard.next()).await.unwrap() {
            Ok(_) => continue,
            Err(status) => break Refused::from_status(&status),
        }
    };
    assert_eq!(refused.reason, "OVERLOADED");
}
