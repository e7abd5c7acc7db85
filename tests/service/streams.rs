//! Open streams: how many there may be, and what becomes of those that nobody reads.

use std::time::Duration;

use palpate_proto::v1;
use palpate_proto::v1::watch_session_response::Update;
use palpate_server::Limits;
use tokio::task::JoinSet;
use tokio_stream::StreamExt;
use tonic::Streaming;

use crate::harness::{
    Caller, EventStream, Outcome, Refused, Server, accepted, creation, miss, prior, reply, report, soon,
};

type Updates = Streaming<v1::WatchSessionResponse>;

fn watch(session_id: &str) -> v1::WatchSessionRequest {
    v1::WatchSessionRequest { session_id: session_id.into(), ..Default::default() }
}

async fn open(caller: &Caller, session_id: &str) -> Outcome<Updates> {
    reply(caller.reconstruction().watch_session(watch(session_id))).await
}

async fn open_sse(server: &Server, session_id: &str) -> Outcome<EventStream> {
    let request = server.http().get(&format!("/v1/sessions/{session_id}/events"));
    accepted(request.header("accept", "text/event-stream")).await.map(EventStream::from)
}

/// A session whose updates have a megabyte each, so that no buffer on the way holds all of them.
async fn begin_large(caller: &Caller, session_id: &str, events: usize) {
    let labels = [("large".to_owned(), "x".repeat(1 << 20))].into();
    caller.create(v1::CreateSessionRequest { labels, ..creation(session_id) }).await.unwrap();
    let next = caller.add_prior(prior(session_id)).await.unwrap().candidates.remove(0);
    for step in 2..events {
        caller.report(report(session_id, miss(&next), &format!("miss-{step}"))).await.unwrap();
    }
}

/// Labels may be large here, and a reader has little time and little room.
fn impatient() -> Limits {
    Limits {
        name_bytes: 2 << 20,
        stream_stall: Duration::from_millis(200),
        stream_bytes: 64 << 10,
        ..Limits::default()
    }
}

#[tokio::test]
async fn a_session_and_a_machine_have_their_share_of_the_streams() {
    let limits = Limits { streams_per_session: 2, streams_per_peer: 3, ..Limits::default() };
    let server = Server::with_limits(limits).await;
    let caller = server.grpc();
    for session_id in ["ball", "mug"] {
        caller.create(creation(session_id)).await.unwrap();
    }
    let first = open(&caller, "ball").await.unwrap();
    let _second = open_sse(&server, "ball").await.unwrap();
    for refused in [open(&caller, "ball").await.map(drop), open_sse(&server, "ball").await.map(drop)]
        .map(Result::unwrap_err)
    {
        assert_eq!(refused.reason, "QUOTA");
        assert!(refused.message.contains("2 open streams of one session"), "{}", refused.message);
        assert!(refused.message.contains("close streams"), "{}", refused.message);
    }
    let _third = open(&caller, "mug").await.unwrap();
    let silent = || tokio_stream::pending::<v1::ExploreRequest>();
    for refused in [
        open(&caller, "mug").await.map(drop),
        open_sse(&server, "mug").await.map(drop),
        reply(caller.exploration().explore(silent())).await.map(drop),
    ]
    .map(Result::unwrap_err)
    {
        assert_eq!(refused.reason, "QUOTA");
        assert!(refused.message.contains("3 open streams from one address"), "{}", refused.message);
    }
    drop(first);
    soon("a free place", async { while open(&caller, "mug").await.is_err() {} }).await;
}

/// Only there does a machine have more than one address of the loopback.
#[cfg(target_os = "linux")]
#[tokio::test]
async fn streams_of_one_machine_do_not_shut_out_another() {
    let server = Server::with_limits(Limits { streams_per_peer: 1, ..Limits::default() }).await;
    server.grpc().create(creation("ball")).await.unwrap();
    let _first = open(&server.grpc(), "ball").await.unwrap();
    assert_eq!(open_sse(&server, "ball").await.unwrap_err().reason, "QUOTA");
    let elsewhere = [127, 0, 0, 2].into();
    let elsewhere = reqwest::Client::builder().local_address(Some(elsewhere)).build().unwrap();
    let url = format!("{}/v1/sessions/ball/events", server.url());
    let events = accepted(elsewhere.get(url).header("accept", "text/event-stream")).await.unwrap();
    assert_eq!(EventStream::from(events).next().await.unwrap().id, Some(1));
}

#[tokio::test]
async fn an_exploration_takes_its_place_in_the_session_that_it_opens() {
    let server = Server::with_limits(Limits { streams_per_session: 1, ..Limits::default() }).await;
    let caller = server.grpc();
    caller.create(creation("ball")).await.unwrap();
    let watching = open(&caller, "ball").await.unwrap();
    let (to, messages) = tokio::sync::mpsc::channel(4);
    let messages = tokio_stream::wrappers::ReceiverStream::new(messages);
    let mut replies = reply(caller.exploration().explore(messages)).await.unwrap();
    let mut try_open = async || {
        let open = v1::ExploreOpen { session_id: "ball".into(), ..Default::default() };
        let message = Some(v1::explore_request::Message::Open(open));
        to.send(v1::ExploreRequest { message, ..Default::default() }).await.unwrap();
        soon("a reply", replies.next()).await.unwrap().unwrap().message.unwrap()
    };
    let v1::explore_response::Message::Problem(problem) = try_open().await else { panic!("a problem") };
    assert_eq!(problem.reason, "QUOTA");
    drop(watching);
    let opened = async { while !matches!(try_open().await, v1::explore_response::Message::Opened(_)) {} };
    soon("a free place", opened).await;
}

#[tokio::test]
async fn a_reader_who_sleeps_loses_its_place_over_grpc() {
    let server = Server::with_limits(Limits { streams: 1, ..impatient() }).await;
    let caller = server.grpc();
    begin_large(&caller, "large", 16).await;
    caller.create(creation("ball")).await.unwrap();
    let mut asleep = open(&caller, "large").await.unwrap();
    soon("a free place", async { while open(&server.grpc(), "ball").await.is_err() {} }).await;
    let mut seen = 0;
    let end = loop {
        match soon("an update", asleep.next()).await.expect("an error comes before the end") {
            Ok(_) => seen += 1,
            Err(end) => break Refused::from_status(&end),
        }
    };
    assert!(seen < 16, "what did not fit on the way is gone");
    assert_eq!(end.reason, "QUOTA");
    assert!(end.message.contains("200 milliseconds") && end.message.contains("open it again"), "{end:?}");
}

#[tokio::test]
async fn a_reader_who_sleeps_loses_its_place_over_http() {
    let server = Server::with_limits(Limits { streams: 1, ..impatient() }).await;
    let caller = server.grpc();
    begin_large(&caller, "large", 32).await;
    caller.create(creation("ball")).await.unwrap();
    let mut asleep = open_sse(&server, "large").await.unwrap();
    soon("a free place", async { while open(&caller, "ball").await.is_err() {} }).await;
    let mut last = None;
    while let Some(event) = asleep.next().await {
        last = Some(event);
    }
    let last = last.unwrap();
    assert_eq!(last.name, "problem", "the reader who wakes up is told why");
    assert!(last.data.contains("200 milliseconds"), "{}", last.data);
}

#[tokio::test]
async fn a_reader_who_has_nothing_to_read_keeps_its_place() {
    let server = Server::with_limits(impatient()).await;
    let caller = server.grpc();
    caller.create(creation("ball")).await.unwrap();
    let mut updates = open(&caller, "ball").await.unwrap();
    tokio::time::sleep(Duration::from_millis(600)).await;
    caller.add_prior(prior("ball")).await.unwrap();
    for seq in 1..=2 {
        let update = soon("an update", updates.next()).await.unwrap().unwrap().update;
        assert!(matches!(update, Some(Update::Event(event)) if event.seq == seq));
    }
}

#[tokio::test]
async fn forty_slow_watchers_get_every_mesh_and_none_is_ended_by_a_full_queue() {
    let limits = Limits { reader_queue: 0, ..Limits::default() };
    let server = Server::with_limits(limits).await;
    let mut candidate = server.grpc().begin("ball").await;
    candidate = server.grpc().go_on("ball", candidate, 3).await;
    let mut watchers = JoinSet::new();
    for watcher in 0..40 {
        // Half of them begin in the past.
        let after_revision = if watcher % 2 == 0 { 0 } else { 5 };
        let request = v1::WatchSessionRequest { after_revision, include_mesh: true, ..watch("ball") };
        let mut updates = reply(server.grpc().reconstruction().watch_session(request)).await.unwrap();
        watchers.spawn(async move {
            let (mut events, mut meshes) = (Vec::new(), Vec::new());
            while meshes.last() != Some(&11) {
                tokio::time::sleep(Duration::from_millis(5)).await;
                match soon("an update", updates.next()).await.unwrap().unwrap().update {
                    Some(Update::Event(event)) => events.push(event.seq),
                    Some(Update::Mesh(mesh)) => meshes.push(mesh.revision),
                    Some(Update::Heartbeat(_)) | None => {}
                }
            }
            (after_revision, events, meshes)
        });
    }
    server.grpc().go_on("ball", candidate, 6).await;
    for (after, events, meshes) in soon("all watchers", watchers.join_all()).await {
        assert_eq!(events, (after + 1..=11).collect::<Vec<_>>());
        assert_eq!(meshes, (2.max(after + 1)..=11).collect::<Vec<_>>(), "each event moved the surface");
    }
}
