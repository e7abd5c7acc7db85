//! A session's history: renamed, finished, a touch taken back, all of it shown again.

use palpate_proto::FieldMask;
use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use palpate_proto::v1::watch_session_response::Update;
use tokio_stream::StreamExt;

use crate::harness::{Caller, Server, Transport, creation, miss, prior, report, soon, touch};

fn update(session: &v1::Session, paths: &[&str]) -> v1::UpdateSessionRequest {
    let paths = paths.iter().map(|&path| path.to_owned()).collect();
    v1::UpdateSessionRequest {
        session: Some(session.clone()),
        update_mask: Some(FieldMask { paths }),
        request_id: String::new(),
    }
}

fn finish(session_id: &str) -> v1::FinishSessionRequest {
    v1::FinishSessionRequest { session_id: session_id.into(), ..Default::default() }
}

fn retract(session_id: &str, seq: i64) -> v1::RetractEventRequest {
    v1::RetractEventRequest {
        session_id: session_id.into(),
        seq,
        reason: "the cable touched".into(),
        request_id: format!("retract-{seq}"),
    }
}

fn replay(session_id: &str) -> v1::ReplaySessionRequest {
    v1::ReplaySessionRequest { session_id: session_id.into(), verify: true, ..Default::default() }
}

fn last_hash(log: &[v1::Event]) -> &str {
    &log.last().unwrap().state_hash
}

async fn labelled(caller: &Caller, name: &str, value: &str) -> Vec<String> {
    let labels = [(name.to_owned(), value.to_owned())].into();
    let page = caller.list(v1::ListSessionsRequest { labels, ..Default::default() }).await.unwrap();
    page.sessions.into_iter().map(|session| session.session_id).collect()
}

#[tokio::test]
async fn names_and_labels_change_under_the_right_etag_only_and_lists_follow() {
    let mut server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let labels = [("object".to_owned(), "mug".to_owned())].into();
        let created = caller.create(v1::CreateSessionRequest { labels, ..creation(name) }).await.unwrap();
        let mut wanted = created.clone();
        wanted.display_name = "A mug".into();
        wanted.labels = [("object".to_owned(), "cup".to_owned())].into();

        let unread = v1::Session { etag: String::new(), ..wanted.clone() };
        assert_eq!(caller.update(update(&unread, &["labels"])).await.unwrap_err().reason, "ETAG_MISSING");
        let stale = v1::Session { etag: "9-9".into(), ..wanted.clone() };
        assert_eq!(caller.update(update(&stale, &["labels"])).await.unwrap_err().reason, "ETAG_MISMATCH");
        let refused = caller.update(update(&wanted, &["frame_id"])).await.unwrap_err();
        assert_eq!((refused.reason.as_str(), refused.fields[0].as_str()), ("FIELD_INVALID", "update_mask"));
        assert_eq!(caller.get(name).await.unwrap(), created, "what was refused changed nothing");

        let request =
            v1::UpdateSessionRequest { request_id: "rename".into(), ..update(&wanted, &["display_name"]) };
        let renamed = caller.update(request.clone()).await.unwrap();
        assert_eq!((renamed.display_name.as_str(), renamed.revision), ("A mug", 2));
        assert_eq!(renamed.labels, created.labels, "the mask names the display_name only");
        assert_eq!(caller.update(request).await.unwrap(), renamed, "a retry is answered as before");
        wanted.etag = renamed.etag;
        caller.update(update(&wanted, &["labels"])).await.unwrap();
        assert!(labelled(&caller, "object", "cup").await.contains(&name.to_owned()));
        assert!(!labelled(&caller, "object", "mug").await.contains(&name.to_owned()));
        let log = caller.log(name).await;
        assert!(matches!(&log[2].kind, Some(Kind::Updated(updated)) if updated.labels["object"] == "cup"));
        server = server.restart().await;
        let session = server.caller(transport).get(name).await.unwrap();
        assert_eq!((session.display_name.as_str(), session.labels["object"].as_str()), ("A mug", "cup"));
    }
}

#[tokio::test]
async fn a_finished_session_is_read_only_and_says_why() {
    let mut server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let next = caller.begin(name).await;
        let stale = v1::FinishSessionRequest { etag: "9-9".into(), ..finish(name) };
        assert_eq!(caller.finish(stale).await.unwrap_err().reason, "ETAG_MISMATCH");
        let request =
            v1::FinishSessionRequest { note: "good enough".into(), request_id: "end".into(), ..finish(name) };
        let finished = caller.finish(request.clone()).await.unwrap();
        assert_eq!((finished.state(), finished.revision), (v1::SessionState::Finished, 3));
        assert_eq!(finished.finish_note, "good enough");
        assert_eq!(caller.finish(request).await.unwrap(), finished, "a retry is answered as before");

        let session = v1::Session { display_name: "late".into(), ..finished.clone() };
        let question = v1::ProposeContactsRequest { session_id: name.into(), ..Default::default() };
        for reason in [
            caller.report(report(name, touch(&next, 0.0), "late")).await.unwrap_err().reason,
            caller
                .add_prior(v1::AddVisualPriorRequest { request_id: "late".into(), ..prior(name) })
                .await
                .unwrap_err()
                .reason,
            caller.propose(question).await.unwrap_err().reason,
            caller.finish(finish(name)).await.unwrap_err().reason,
            caller.update(update(&session, &["display_name"])).await.unwrap_err().reason,
            caller.retract(retract(name, 2)).await.unwrap_err().reason,
        ] {
            assert_eq!(reason, "SESSION_FINISHED");
        }
        server = server.restart().await;
        let caller = server.caller(transport);
        assert_eq!(caller.get(name).await.unwrap().state(), v1::SessionState::Finished);
        let state = v1::SessionState::Finished.into();
        let listed = caller.list(v1::ListSessionsRequest { state, ..Default::default() }).await.unwrap();
        assert!(listed.sessions.iter().any(|session| session.session_id == name));
        let late = caller.report(report(name, touch(&next, 0.0), "late")).await.unwrap_err();
        assert!(late.message.contains("fork"), "{}", late.message);
    }
}

#[tokio::test]
async fn a_touch_that_was_taken_back_and_reported_right_was_never_wrong() {
    let mut server = Server::start().await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let (right, wrong) = (format!("right-{}", transport.name()), format!("wrong-{}", transport.name()));
        let (first, _) = (caller.begin(&right).await, caller.begin(&wrong).await);
        let good = caller.report(report(&right, touch(&first, 0.001), "a")).await.unwrap();
        let second = good.candidates[0].clone();
        caller.report(report(&right, touch(&second, -0.001), "b")).await.unwrap();

        // Candidate ids name the session, so the other one reports places of its own.
        let bad = caller
            .report(report(&wrong, touch(&caller.propose_one(&wrong).await, 0.012), "bad"))
            .await
            .unwrap();
        let after_bad = caller.log(&wrong).await;
        let taken_back = caller.retract(retract(&wrong, 3)).await.unwrap();
        assert_eq!((taken_back.revision, taken_back.retracted_seqs.as_slice()), (4, &[3][..]));
        assert_eq!(taken_back.stats.as_ref().unwrap().attempts, 0);
        assert_eq!(
            caller.retract(retract(&wrong, 3)).await.unwrap(),
            taken_back,
            "a retry is answered as before"
        );
        let log = caller.log(&wrong).await;
        assert_eq!(last_hash(&log), log[1].state_hash, "the estimate is that of the log without the event");
        assert_ne!(log[2].state_hash, log[1].state_hash);
        assert_eq!(log[2].state_hash, after_bad[2].state_hash, "what was recorded stays");
        assert_eq!((log[2].retracted_by_seq, log[3].retraction_reason.as_str()), (4, "the cable touched"));
        drop(bad);

        let again = caller.propose_one(&wrong).await;
        assert_eq!(again.point, first.point);
        let next = caller.report(report(&wrong, touch(&again, 0.001), "c")).await.unwrap();
        assert_eq!(next.candidates[0].point, second.point);
        caller.report(report(&wrong, touch(&next.candidates[0], -0.001), "d")).await.unwrap();
        assert_eq!(last_hash(&caller.log(&wrong).await), last_hash(&caller.log(&right).await));

        // After a restart the fold leaves the event out, and every revision is what it was.
        let meshes = caller.meshes_of(&wrong, 6).await;
        server = server.restart().await;
        let caller = server.caller(transport);
        assert_eq!(caller.meshes_of(&wrong, 6).await, meshes);
        assert_eq!(caller.get(&wrong).await.unwrap().retracted_seqs, [3]);
        let steps = caller.replay(replay(&wrong)).await.unwrap();
        assert!(steps.iter().all(|step| step.hash_matches), "{steps:?}");
        assert_eq!(steps.len(), 6);
    }
}

#[tokio::test]
async fn only_evidence_that_counts_and_that_nothing_needs_can_be_taken_back() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let next = caller.begin(name).await;
        caller.report(report(name, miss(&next), "miss")).await.unwrap();
        let before = caller.log(name).await;
        for (seq, word) in [(1, "no evidence"), (2, "needed"), (9, "no event"), (-1, "no event")] {
            let refused = caller.retract(retract(name, seq)).await.unwrap_err();
            assert_eq!(refused.fields, ["seq"], "{seq}");
            assert!(refused.message.contains(word), "{}", refused.message);
        }
        assert_eq!(caller.log(name).await, before, "what was refused changed nothing");
        caller.retract(retract(name, 3)).await.unwrap();
        let twice = v1::RetractEventRequest { request_id: "twice".into(), ..retract(name, 3) };
        let twice = caller.retract(twice).await.unwrap_err();
        assert!(twice.message.contains("already"), "{}", twice.message);
        // Now that nothing needs the view, it can go too, and another one can come.
        let empty = caller.retract(retract(name, 2)).await.unwrap();
        assert_eq!(empty.state(), v1::SessionState::AwaitingPrior);
        let view = v1::AddVisualPriorRequest { request_id: "again".into(), ..prior(name) };
        let active = caller.add_prior(view).await.unwrap().session.unwrap();
        assert_eq!((active.state(), active.revision), (v1::SessionState::Active, 6));
    }
}

#[tokio::test]
async fn a_watcher_sees_what_was_taken_back() {
    let server = Server::start().await;
    let (caller, client) = (server.grpc(), server.client().await);
    let next = caller.begin("ball").await;
    caller.report(report("ball", touch(&next, 0.001), "a")).await.unwrap();
    let request = v1::WatchSessionRequest {
        session_id: "ball".into(),
        after_revision: 3,
        include_mesh: true,
        ..Default::default()
    };
    drop(client);
    let mut updates =
        soon("a watch", caller.reconstruction().watch_session(request)).await.unwrap().into_inner();
    caller.retract(retract("ball", 3)).await.unwrap();
    let mut seen = Vec::new();
    while seen.len() < 2 {
        let update = soon("an update", updates.next()).await.unwrap().unwrap();
        if !matches!(update.update, Some(Update::Heartbeat(_))) {
            seen.push(update);
        }
    }
    assert!(
        matches!(&seen[0].update, Some(Update::Event(event)) if event.kind == Some(Kind::RetractedSeq(3)))
    );
    assert_eq!(seen[0].session.as_ref().unwrap().stats.as_ref().unwrap().contacts, 0);
    assert!(matches!(&seen[1].update, Some(Update::Mesh(mesh)) if mesh.revision == 4));
}

#[tokio::test]
async fn a_replay_shows_the_steps_that_are_wanted_and_says_what_is_not_there() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let next = caller.begin(name).await;
        caller.go_on(name, next, 2).await;
        let some =
            v1::ReplaySessionRequest { from_revision: 2, to_revision: 3, include_mesh: true, ..replay(name) };
        let steps = caller.replay(some).await.unwrap();
        let shown: Vec<String> = steps
            .iter()
            .map(|step| match step.update.as_ref().unwrap() {
                Update::Event(event) => format!("event {}", event.seq),
                Update::Mesh(mesh) => format!("mesh {}", mesh.revision),
                Update::Heartbeat(_) => "heartbeat".into(),
            })
            .collect();
        assert_eq!(shown, ["event 2", "mesh 2", "event 3", "mesh 3"]);
        let plain = v1::ReplaySessionRequest { verify: false, ..replay(name) };
        let plain = caller.replay(plain).await.unwrap();
        assert_eq!(plain.len(), 4);
        assert!(plain.iter().all(|step| !step.hash_matches && step.session.is_some()));
        for (from_revision, to_revision, field) in
            [(9, 0, "from_revision"), (0, 9, "to_revision"), (3, 2, "to_revision")]
        {
            let request = v1::ReplaySessionRequest { from_revision, to_revision, ..replay(name) };
            assert_eq!(caller.replay(request).await.unwrap_err().fields, [field]);
        }
        assert_eq!(caller.replay(replay("nobody")).await.unwrap_err().reason, "SESSION_NOT_FOUND");
    }
}

impl Caller {
    async fn propose_one(&self, session_id: &str) -> v1::Candidate {
        let question =
            v1::ProposeContactsRequest { session_id: session_id.into(), top_k: 1, ..Default::default() };
        self.propose(question).await.unwrap().candidates.remove(0)
    }

    async fn meshes_of(&self, session_id: &str, head: i64) -> Vec<v1::Mesh> {
        let mut meshes = Vec::new();
        for revision in 2..=head {
            let request =
                v1::GetMeshRequest { session_id: session_id.into(), revision, ..Default::default() };
            meshes.push(self.mesh(request).await.unwrap());
        }
        meshes
    }
}
