//! What must hold when things go wrong: eviction, races, damage, panics and impatience.

use std::sync::Arc;
use std::time::Duration;

use palpate_proto::v1;
use tempfile::TempDir;

use super::*;
use crate::compute::Work;
use crate::session::Snapshot;
use crate::sessions::Change;
use crate::store::SessionRow;

/// Whoever calls a server that asks nobody.
fn somebody() -> Call {
    Call { deadline: None, caller: Caller::anyone(None), peer: None, at_least: None }
}

async fn service(folder: &TempDir, limits: Limits) -> Api {
    let store = Store::open_beside(&folder.path().join("log.db"), &limits).await.unwrap();
    Api::new(store, limits, CancellationToken::new())
}

async fn create(api: &Api, session_id: &str) -> v1::Session {
    let request = v1::CreateSessionRequest { session_id: session_id.into(), ..Default::default() };
    api.create_session(request, somebody()).await.unwrap()
}

async fn get(api: &Api, session_id: &str) -> v1::Session {
    let request = v1::GetSessionRequest { session_id: session_id.into() };
    api.get_session(request, somebody()).await.unwrap()
}

/// Twenty points on a bowl; `shift_m` makes each cloud another.
fn view(session_id: &str, request_id: &str, shift_m: f32) -> v1::AddVisualPriorRequest {
    let points = (0..20).flat_map(|i| {
        let (x, y) = (0.01 * (i % 5) as f32, 0.01 * (i / 5) as f32);
        [x + shift_m, y, 2.0 * (x * x + y * y)]
    });
    let prior = v1::VisualPrior {
        encoding: v1::PointEncoding::XyzF32Le.into(),
        points: points.flat_map(f32::to_le_bytes).collect::<Vec<u8>>().into(),
        viewpoint: Some(v1::Vector3 { x: 0.0, y: 0.0, z: 1.0 }),
        ..Default::default()
    };
    v1::AddVisualPriorRequest {
        session_id: session_id.into(),
        prior: Some(prior),
        request_id: request_id.into(),
        ..Default::default()
    }
}

async fn newest_hash(api: &Api, session_id: &str) -> String {
    let deadline = Instant::now() + Duration::from_secs(20);
    api.sessions.newest(session_id, deadline).await.unwrap().state_hash()
}

#[tokio::test]
async fn an_evicted_session_comes_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let api = service(&folder, Limits { live_sessions: 1, ..Limits::default() }).await;
    create(&api, "one").await;
    api.add_visual_prior(view("one", "a", 0.0), somebody()).await.unwrap();
    api.add_visual_prior(view("one", "b", 0.001), somebody()).await.unwrap();
    let before = newest_hash(&api, "one").await;
    create(&api, "two").await;
    api.add_visual_prior(view("two", "a", 0.0), somebody()).await.unwrap();
    assert!(api.sessions.loaded("one").is_none(), "there is room for one session");
    assert_eq!(newest_hash(&api, "one").await, before);
}

#[tokio::test]
async fn two_processes_on_one_log_take_turns_and_agree() {
    let folder = tempfile::tempdir().unwrap();
    let (one, other) = (service(&folder, Limits::default()).await, service(&folder, Limits::default()).await);
    create(&one, "shared").await;
    for round in 0..3 {
        let shift_m = 0.001 * round as f32;
        let (first, second) = tokio::join!(
            one.add_visual_prior(view("shared", &format!("one-{round}"), shift_m), somebody()),
            other.add_visual_prior(view("shared", &format!("other-{round}"), -shift_m), somebody()),
        );
        let revisions = [first, second].map(|reply| reply.unwrap().session.unwrap().revision);
        assert_ne!(revisions[0], revisions[1]);
    }
    let retried = other.add_visual_prior(view("shared", "one-0", 0.0), somebody()).await.unwrap();
    assert!(retried.session.unwrap().revision <= 3, "a retry at the other process is answered as before");
    // A new process folds the same state that both have in memory by now.
    let third = service(&folder, Limits::default()).await;
    let newest = newest_hash(&third, "shared").await;
    assert!([newest_hash(&one, "shared").await, newest_hash(&other, "shared").await].contains(&newest));
}

#[tokio::test]
async fn an_event_that_cannot_be_replayed_quarantines_its_session_alone() {
    let folder = tempfile::tempdir().unwrap();
    let api = service(&folder, Limits::default()).await;
    create(&api, "whole").await;
    create(&api, "broken").await;
    api.add_visual_prior(view("broken", "a", 0.0), somebody()).await.unwrap();
    let deadline = Instant::now() + Duration::from_secs(20);
    let damage = Change {
        session_id: "broken".into(),
        request: RequestKey { id: String::new(), digest: Vec::new() },
        expected_revision: None,
        actor: String::new(),
        work: Work::Edit,
        compute: Arc::new(|before: &Snapshot| {
            let after = Snapshot { revision: before.revision + 1, ..before.clone() };
            Ok(appended(("visual_prior", vec![255; 9]), after, &v1::AddVisualPriorResponse::default()))
        }),
    };
    api.sessions.change(damage, deadline).await.unwrap();

    let api = service(&folder, Limits::default()).await;
    let refused = api.add_visual_prior(view("broken", "b", 0.0), somebody()).await.unwrap_err();
    assert_eq!(refused.reason(), "SESSION_QUARANTINED");
    let broken = get(&api, "broken").await;
    assert_eq!((broken.state(), broken.revision), (v1::SessionState::Quarantined, 2));
    let quarantine = broken.quarantine.unwrap();
    assert_eq!((quarantine.sound_revision, quarantine.head), (2, 3));
    assert!(quarantine.reason.contains("event 3"), "{quarantine:?}");
    let readable = v1::GetMeshRequest { session_id: "broken".into(), revision: 2, ..Default::default() };
    assert!(api.get_mesh(readable, somebody()).await.is_ok());
    assert!(api.add_visual_prior(view("whole", "a", 0.0), somebody()).await.is_ok());
    let gone = v1::DeleteSessionRequest { session_id: "broken".into(), ..Default::default() };
    assert!(api.delete_session(gone, somebody()).await.is_ok());
}

#[tokio::test]
async fn a_panic_is_internal_for_its_call_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let api = service(&folder, Limits::default()).await;
    let created = create(&api, "calm").await;
    let deadline = Instant::now() + Duration::from_secs(20);
    let panicking = Change {
        session_id: "calm".into(),
        request: RequestKey { id: "p".into(), digest: Vec::new() },
        expected_revision: None,
        actor: String::new(),
        work: Work::Edit,
        compute: Arc::new(|before: &Snapshot| {
            assert_eq!(before.revision, 0, "on purpose");
            Err(Error::NoVisualPrior)
        }),
    };
    let failed = api.sessions.change(panicking, deadline).await.unwrap_err();
    assert_eq!(failed.reason(), "INTERNAL");
    assert_eq!(get(&api, "calm").await, created);
    assert!(api.add_visual_prior(view("calm", "p", 0.0), somebody()).await.is_ok());
}

#[tokio::test]
async fn a_caller_who_leaves_breaks_nothing_and_a_retry_finds_the_reply() {
    let folder = tempfile::tempdir().unwrap();
    let api = service(&folder, Limits::default()).await;
    create(&api, "left").await;
    {
        let leaving = api.add_visual_prior(view("left", "a", 0.0), somebody());
        // Polled for a moment, so that the change has begun, and then dropped.
        let _ = tokio::time::timeout(Duration::from_micros(300), leaving).await;
    }
    let reply = api.add_visual_prior(view("left", "a", 0.0), somebody()).await.unwrap();
    assert_eq!(reply.session.unwrap().revision, 2);
    assert_eq!(get(&api, "left").await.stats.unwrap().visual_points, 20);
}

#[tokio::test]
async fn limits_are_answered_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let api = service(&folder, Limits { sessions: 1, ..Limits::default() }).await;
    create(&api, "full").await;
    let request = v1::CreateSessionRequest::default();
    let refused = api.create_session(request, somebody()).await.unwrap_err();
    assert_eq!(refused.reason(), "QUOTA");
    api.add_visual_prior(view("full", "a", 0.0), somebody()).await.unwrap();
    assert_eq!(get(&api, "full").await.revision, 2);
}

#[tokio::test]
async fn a_creation_without_id_is_retried_safely() {
    let folder = tempfile::tempdir().unwrap();
    let api = service(&folder, Limits::default()).await;
    let request = v1::CreateSessionRequest { request_id: "new".into(), ..Default::default() };
    let (first, second) = tokio::join!(
        api.create_session(request.clone(), somebody()),
        api.create_session(request.clone(), somebody())
    );
    let first = first.unwrap();
    assert_eq!(first, second.unwrap());
    let other = v1::CreateSessionRequest { experiment: "other".into(), ..request.clone() };
    assert_eq!(api.create_session(other, somebody()).await.unwrap_err().reason(), "REQUEST_ID_REUSED");
    let gone = v1::DeleteSessionRequest { session_id: first.session_id, ..Default::default() };
    api.delete_session(gone, somebody()).await.unwrap();
    let late = api.create_session(request, somebody()).await.unwrap_err();
    assert_eq!(late.reason(), "SESSION_NOT_FOUND", "a late retry brings nothing back");
}

#[tokio::test]
async fn a_list_ends_where_the_log_does_whatever_the_head_says() {
    let folder = tempfile::tempdir().unwrap();
    let api = service(&folder, Limits { read_bytes: 1, ..Limits::default() }).await;
    create(&api, "short").await;
    api.add_visual_prior(view("short", "a", 0.0), somebody()).await.unwrap();
    let found = api.sessions.store.session("short").await.unwrap().unwrap();
    let wrong = SessionRow { head: 7, ..found.clone() };
    let list = tokio::time::timeout(Duration::from_secs(20), api.events_after(wrong, 0, 50, false));
    let page = list.await.expect("it ends").unwrap();
    assert_eq!((page.events.len(), page.next_page_token.as_str()), (2, ""));

    let earlier = SessionRow { created_us: found.created_us - 1, head: 7, ..found };
    let another = api.events_after(earlier, 0, 50, false).await.unwrap_err();
    assert_eq!(another.reason(), "SESSION_NOT_FOUND", "these events are those of a new session of this name");
}

#[tokio::test]
async fn large_events_are_read_one_by_one_and_small_ones_together() {
    let folder = tempfile::tempdir().unwrap();
    let api = service(&folder, Limits::default()).await;
    create(&api, "views").await;
    for request_id in ["a", "b", "c"] {
        api.add_visual_prior(view("views", request_id, 0.0), somebody()).await.unwrap();
    }
    let store = &api.sessions.store;
    let rows = store.events("views", 0, 16).await.unwrap();
    let size = |row: &crate::store::Event| row.payload.len() + row.reply.len();
    let first_two = size(&rows[0]) + size(&rows[1]);
    for (after, count, bytes, expected) in [
        (0, 16, 0, 1..=1),
        (0, 16, first_two - 1, 1..=1),
        (0, 16, first_two, 1..=2),
        (0, 16, usize::MAX, 1..=4),
        (0, 3, usize::MAX, 1..=3),
        (2, 16, 1, 3..=3),
        (3, 16, usize::MAX, 4..=4),
    ] {
        let read = store.events_within("views", after, count, bytes).await.unwrap();
        let seqs: Vec<i64> = read.iter().map(|row| row.seq).collect();
        assert_eq!(seqs, expected.collect::<Vec<_>>(), "after {after}, {count} events, {bytes} bytes");
    }
    assert!(store.events_within("views", 4, 16, usize::MAX).await.unwrap().is_empty());
    assert!(store.events_within("nowhere", 0, 16, usize::MAX).await.unwrap().is_empty());
}

#[test]
fn a_duration_is_logged_with_three_significant_digits() {
    assert_eq!(super::three_digits(30.818_792_000_000_002), 30.8);
    assert_eq!(super::three_digits(0.071_234), 0.0712);
    assert_eq!(super::three_digits(12_345.0), 12_300.0);
}
