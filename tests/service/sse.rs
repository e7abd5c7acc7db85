//! Following a session over HTTP: server-sent events, as a browser's `EventSource` reads them.

use palpate_proto::v1;
use palpate_proto::v1::watch_session_response::Update;

use crate::harness::{EventStream, Server, accepted, creation, from_json};

async fn ids(events: &mut EventStream, count: usize) -> Vec<i64> {
    let mut ids = Vec::new();
    while ids.len() < count {
        ids.extend(events.next().await.unwrap().id);
    }
    ids
}

#[tokio::test]
async fn events_are_named_by_their_kind_and_numbered_by_their_revision() {
    let server = Server::start().await;
    let caller = server.grpc();
    let first = caller.begin("ball").await;
    let mut events = server.http().events("ball", None).await;
    caller.go_on("ball", first, 1).await;
    let log = caller.log("ball").await;
    for (name, logged) in ["created", "visual_prior", "contact_result"].into_iter().zip(log) {
        let event = events.next().await.unwrap();
        assert_eq!((event.name.as_str(), event.id), (name, Some(logged.seq)));
        let update: v1::WatchSessionResponse = from_json(&event.data);
        assert_eq!(update.session.unwrap().revision, logged.seq);
        assert_eq!(update.update, Some(Update::Event(logged)), "the same as over gRPC");
    }
}

#[tokio::test]
async fn a_stream_that_is_opened_again_goes_on_after_the_last_event_id() {
    let server = Server::start().await;
    let caller = server.grpc();
    let mut candidate = caller.begin("ball").await;
    let mut seen: Vec<i64> = Vec::new();
    for round in 1..=4 {
        let mut events = server.http().events("ball", seen.last().copied()).await;
        candidate = caller.go_on("ball", candidate, 2).await;
        seen.extend(ids(&mut events, 1 + round % 3).await);
    }
    let head = caller.get("ball").await.unwrap().revision;
    let missing = head - seen.last().unwrap();
    let mut events = server.http().events("ball", seen.last().copied()).await;
    seen.extend(ids(&mut events, missing as usize).await);
    assert_eq!(seen, (1..=head).collect::<Vec<_>>(), "no gap and no repetition");
}

#[tokio::test]
async fn a_stream_may_begin_anywhere_and_bring_meshes() {
    let server = Server::start().await;
    let caller = server.grpc();
    let first = caller.begin("ball").await;
    caller.go_on("ball", first, 1).await;
    let path = "/v1/sessions/ball/events?after_revision=2&include_mesh=true";
    let request = || server.http().get(path).header("accept", "text/event-stream");
    let mut events = EventStream::from(accepted(request()).await.unwrap());
    assert_eq!(events.next().await.unwrap().id, Some(3));
    let mesh = events.next().await.unwrap();
    assert_eq!((mesh.name.as_str(), mesh.id), ("mesh", None), "a mesh is no event of the log");
    let update: v1::WatchSessionResponse = from_json(&mesh.data);
    assert!(matches!(update.update, Some(Update::Mesh(mesh)) if mesh.revision == 3));

    let wrong = accepted(request().header("last-event-id", "9")).await.unwrap_err();
    assert_eq!(wrong.fields, ["after_revision"]);
    let nonsense = accepted(request().header("last-event-id", "nine")).await.unwrap_err();
    assert_eq!(nonsense.fields, ["Last-Event-ID"]);
    let paged = server.http().get(path);
    assert_eq!(accepted(paged).await.unwrap_err().reason, "FIELD_INVALID", "these belong to the stream");
    for id in ["1", "W+@6"] {
        let resumed = server.http().get("/v1/sessions/ball/events").header("last-event-id", id);
        assert_eq!(accepted(resumed).await.unwrap_err().fields, ["Last-Event-ID"], "so does this");
    }
}

#[tokio::test]
async fn watchers_share_a_mesh_and_each_gets_the_faces_that_it_lacks() {
    let server = Server::start().await;
    let caller = server.grpc();
    let first = caller.begin("ball").await;
    caller.go_on("ball", first, 1).await;
    let mut at_three = Vec::new();
    // The third is served what was made for the first.
    for after_revision in [1, 2, 1, 2] {
        let path = format!("/v1/sessions/ball/events?after_revision={after_revision}&include_mesh=true");
        let request = server.http().get(&path).header("accept", "text/event-stream");
        let mut events = EventStream::from(accepted(request).await.unwrap());
        let mesh = loop {
            let event = events.next().await.unwrap();
            let update: v1::WatchSessionResponse = from_json(&event.data);
            match update.update {
                Some(Update::Mesh(mesh)) if mesh.revision == 3 => break mesh,
                _ => {}
            }
        };
        let Some(v1::mesh::Body::Raw(raw)) = mesh.body else { panic!("a raw mesh") };
        at_three.push(raw);
    }
    let [knows, new, knows_too, new_too] = at_three.try_into().unwrap();
    assert!(knows.faces_u32_le.is_empty(), "they came with revision 2");
    assert_eq!(new.faces_u32_le.len(), new.n_faces as usize * 12);
    assert_eq!(knows.positions_f32_le, new.positions_f32_le);
    assert_eq!((knows, new), (knows_too, new_too));
}

#[tokio::test]
async fn a_stream_tells_the_end_of_its_session() {
    let server = Server::start().await;
    server.grpc().create(creation("ball")).await.unwrap();
    let mut events = server.http().events("ball", Some(1)).await;
    let deletion = v1::DeleteSessionRequest { session_id: "ball".into(), ..Default::default() };
    server.grpc().delete(deletion).await.unwrap();
    let last = events.next().await.unwrap();
    assert_eq!(last.name, "problem");
    assert!(last.data.contains("SESSION_NOT_FOUND"), "{}", last.data);
    assert_eq!(events.next().await, None);
    let nowhere = server.http().get("/v1/sessions/ball/events").header("accept", "text/event-stream");
    assert_eq!(accepted(nowhere).await.unwrap_err().reason, "SESSION_NOT_FOUND");
}
