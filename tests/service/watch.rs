//! Following a session over gRPC: every event once, in order, also across broken connections.

use std::time::Duration;

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;
use palpate_proto::v1::watch_session_response::Update;
use palpate_server::Limits;
use tokio_stream::StreamExt;
use tonic::Streaming;

use crate::harness::{Caller, Proxy, Refused, Server, patient_client, reply, report, result, soon, touch};

fn watch(after_revision: i64) -> v1::WatchSessionRequest {
    v1::WatchSessionRequest { session_id: "ball".into(), after_revision, ..Default::default() }
}

async fn open(caller: &Caller, request: v1::WatchSessionRequest) -> Streaming<v1::WatchSessionResponse> {
    reply(caller.reconstruction().watch_session(request)).await.unwrap()
}

async fn next(updates: &mut Streaming<v1::WatchSessionResponse>) -> v1::WatchSessionResponse {
    soon("an update", updates.next()).await.unwrap().unwrap()
}

/// The numbers of the next `count` events.
async fn seqs(updates: &mut Streaming<v1::WatchSessionResponse>, count: usize) -> Vec<i64> {
    let mut seqs = Vec::new();
    while seqs.len() < count {
        if let Some(Update::Event(event)) = next(updates).await.update {
            seqs.push(event.seq);
        }
    }
    seqs
}

#[tokio::test]
async fn a_watcher_sees_what_was_and_what_comes_with_the_session_after_it() {
    let server = Server::start().await;
    let caller = server.grpc();
    let first = caller.begin("ball").await;
    let mut updates = open(&caller, v1::WatchSessionRequest { include_mesh: true, ..watch(0) }).await;
    assert_eq!(seqs(&mut updates, 2).await, [1, 2]);
    let Some(Update::Mesh(mesh)) = next(&mut updates).await.update else { panic!("the first mesh") };
    assert_eq!(mesh.revision, 2);

    let touched = caller.report(report("ball", touch(&first, 0.002), "touch")).await.unwrap();
    let update = next(&mut updates).await;
    assert_eq!(update.session, touched.session);
    assert_eq!(update.candidates, touched.candidates);
    assert_eq!(update.update, Some(Update::Event(caller.log("ball").await.remove(2))));
    let Some(Update::Mesh(mesh)) = next(&mut updates).await.update else { panic!("the next mesh") };
    let now = v1::GetMeshRequest { session_id: "ball".into(), ..Default::default() };
    let now = caller.mesh(now).await.unwrap();
    let (Some(v1::mesh::Body::Raw(sent)), Some(v1::mesh::Body::Raw(now))) = (mesh.body, now.body) else {
        panic!("raw meshes")
    };
    assert_eq!(
        (sent.positions_f32_le, sent.uncertainty_f32_le),
        (now.positions_f32_le, now.uncertainty_f32_le)
    );
    assert!(sent.faces_u32_le.is_empty(), "the faces came with the first mesh");

    let refuse = |next: &v1::Candidate| result(next, ContactOutcome::Rejected(v1::Rejected::default()));
    let refused = caller.report(report("ball", refuse(&touched.candidates[0]), "refused")).await.unwrap();
    assert_eq!(next(&mut updates).await.session, refused.session);
    let last = caller.report(report("ball", refuse(&refused.candidates[0]), "last")).await.unwrap();
    assert_eq!(next(&mut updates).await.session, last.session, "a refusal brings no mesh: nothing moved");
}

#[tokio::test]
async fn a_watch_that_is_opened_again_goes_on_after_the_known_revision() {
    let server = Server::start().await;
    let caller = server.grpc();
    let mut candidate = caller.begin("ball").await;
    let mut seen = Vec::new();
    for round in 1..=4 {
        let after = seen.last().copied().unwrap_or(0);
        // A part of what happened while nobody watched, then what happens now; the rest is lost with the stream.
        let mut updates = open(&caller, watch(after)).await;
        candidate = caller.go_on("ball", candidate, 2).await;
        seen.extend(seqs(&mut updates, 1 + round % 3).await);
    }
    let head = caller.get("ball").await.unwrap().revision;
    let mut updates = open(&caller, watch(*seen.last().unwrap())).await;
    let missing = head - seen.last().unwrap();
    seen.extend(seqs(&mut updates, missing as usize).await);
    assert_eq!(seen, (1..=head).collect::<Vec<_>>(), "no gap and no repetition");

    for beyond in [-1, head + 1] {
        let refused = caller.reconstruction().watch_session(watch(beyond)).await.unwrap_err();
        assert_eq!(Refused::from_status(&refused).fields, ["after_revision"]);
    }
}

#[tokio::test]
async fn the_client_follows_a_session_through_a_restart_of_the_server() {
    let mut server = Server::start().await;
    let proxy = Proxy::to(server.address).await;
    let mut candidate = server.grpc().begin("ball").await;
    let mut updates = patient_client(&proxy.url()).await.watch_session(watch(0)).await.unwrap();
    let mut seen = Vec::new();
    for _ in 0..3 {
        candidate = server.grpc().go_on("ball", candidate, 2).await;
        let head = server.grpc().get("ball").await.unwrap().revision;
        while seen.last() != Some(&head) {
            let update = soon("an update", updates.next()).await.unwrap().unwrap();
            if let Some(Update::Event(event)) = update.update {
                seen.push(event.seq);
            }
        }
        server = server.restart().await;
        proxy.switch(server.address);
    }
    assert_eq!(seen, (1..=8).collect::<Vec<_>>());
}

#[tokio::test]
async fn a_silent_watch_shows_signs_of_life() {
    let limits = Limits { heartbeat_min: Duration::from_millis(10), ..Limits::default() };
    let server = Server::with_limits(limits).await;
    let caller = server.grpc();
    caller.begin("ball").await;
    let every = |nanos| v1::WatchSessionRequest {
        heartbeat: Some(palpate_proto::Duration { seconds: 0, nanos }),
        ..watch(2)
    };
    let mut updates = open(&caller, every(20_000_000)).await;
    for nonce in 1..=3 {
        assert_eq!(next(&mut updates).await.update, Some(Update::Heartbeat(v1::Ping { nonce })));
    }
    let refused = caller.reconstruction().watch_session(every(1_000_000)).await.unwrap_err();
    assert_eq!(Refused::from_status(&refused).fields, ["heartbeat"]);
}

#[tokio::test]
async fn a_watch_ends_with_its_session() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.begin("ball").await;
    let mut updates = open(&caller, watch(2)).await;
    let deletion = v1::DeleteSessionRequest { session_id: "ball".into(), ..Default::default() };
    caller.delete(deletion).await.unwrap();
    let end = soon("the end", updates.next()).await.unwrap().unwrap_err();
    assert_eq!(Refused::from_status(&end).reason, "SESSION_NOT_FOUND");
    assert!(updates.next().await.is_none());
    let nowhere = caller.reconstruction().watch_session(watch(0)).await.unwrap_err();
    assert_eq!(Refused::from_status(&nowhere).reason, "SESSION_NOT_FOUND");
}
