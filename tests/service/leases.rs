//! Two arms at one object: what is promised to one is not offered to the other.

use std::time::Duration;

use palpate_client::proto::v1::explore_request::Message as RequestMessage;
use palpate_client::proto::v1::explore_response::Message as ReplyMessage;
use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use palpate_proto::v1::watch_session_response::Update;
use palpate_server::{Limits, ServeOptions};
use tokio::sync::mpsc;
use tokio_stream::StreamExt;
use tokio_stream::wrappers::ReceiverStream;

use crate::harness::{
    Caller, Process, Server, Transport, creation, miss, prior, question, reply, report, soon, touch,
    without_timing,
};

/// Two pads of 9 mm half side beside each other, whatever their turn, and 10 mm.
const RADIUS_M: f64 = 0.0354;

fn robot(name: &str) -> Option<v1::RobotContext> {
    Some(v1::RobotContext { robot_id: name.into(), ..Default::default() })
}

/// A question of a robot for candidates that it has to itself for so long.
fn wish(session_id: &str, name: &str, count: u32, ms: i32) -> v1::ProposeContactsRequest {
    let lease = palpate_proto::Duration { seconds: i64::from(ms / 1000), nanos: ms % 1000 * 1_000_000 };
    v1::ProposeContactsRequest { lease: Some(lease), robot: robot(name), ..question(session_id, count) }
}

/// The same without a lease.
fn look(session_id: &str, name: &str, count: u32) -> v1::ProposeContactsRequest {
    v1::ProposeContactsRequest { robot: robot(name), ..question(session_id, count) }
}

fn nearest_m(some: &[v1::Candidate], others: &[v1::Candidate]) -> f64 {
    let distance_m = |a: &v1::Candidate, b: &v1::Candidate| {
        let (a, b) = (a.point.unwrap(), b.point.unwrap());
        (a.x - b.x).hypot(a.y - b.y).hypot(a.z - b.z)
    };
    let pairs = some.iter().flat_map(|a| others.iter().map(move |b| distance_m(a, b)));
    pairs.fold(f64::INFINITY, f64::min)
}

async fn best(caller: &Caller, request: v1::ProposeContactsRequest) -> Vec<v1::Candidate> {
    caller.propose(request).await.unwrap().candidates
}

#[tokio::test]
async fn two_robots_that_ask_in_turn_get_places_apart_and_each_may_have_its_own_again() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let alone = caller.begin(name).await;
        let before = caller.log(name).await;
        let left = caller.propose(wish(name, "left", 2, 60_000)).await.unwrap();
        assert_eq!((left.revision, left.candidates.len()), (3, 2));
        assert_eq!(left.candidates[0].point, alone.point, "the best place goes to who asks first");
        let expiry = left.candidates[0].lease_expire_time.unwrap();
        let until_s = expiry.seconds - std::time::SystemTime::UNIX_EPOCH.elapsed().unwrap().as_secs() as i64;
        assert!((1..=60).contains(&until_s), "{until_s}");
        let right = caller.propose(wish(name, "right", 1, 60_000)).await.unwrap();
        assert!(nearest_m(&left.candidates, &right.candidates) >= RADIUS_M);
        assert!(right.excluded.unwrap().leased > 0 && right.revision == 4);

        // Each sees its own, nobody in particular sees what neither has.
        assert_eq!(nearest_m(&best(&caller, look(name, "left", 1)).await, &left.candidates), 0.0);
        let own = best(&caller, look(name, "right", 64)).await;
        assert_eq!(nearest_m(&own, &right.candidates), 0.0);
        assert!(nearest_m(&own, &left.candidates) >= RADIUS_M);
        assert!(own.iter().all(|candidate| candidate.lease_expire_time.is_none()));
        let anybody = best(&caller, question(name, 64)).await;
        let all = [left.candidates.clone(), right.candidates.clone()].concat();
        assert!(!anybody.is_empty() && nearest_m(&anybody, &all) >= RADIUS_M);

        // Promises are in the log, and the estimate knows nothing of them.
        let log = caller.log(name).await;
        let Some(Kind::Lease(lease)) = &log[2].kind else { panic!("{:?}", log[2]) };
        let ids: Vec<&String> = left.candidates.iter().map(|candidate| &candidate.candidate_id).collect();
        assert_eq!(lease.candidate_ids.iter().collect::<Vec<_>>(), ids);
        assert_eq!((lease.robot_id.as_str(), lease.expire_time), ("left", Some(expiry)));
        assert!(log[2..].iter().all(|event| event.state_hash == before[1].state_hash));
        assert_eq!(log[3].stats_after.as_ref().unwrap().attempts, 0);
    }
}

#[tokio::test]
async fn replies_to_reports_and_views_keep_to_what_is_promised_to_others() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.begin(name).await;
        let left = best(&caller, wish(name, "left", 2, 60_000)).await;
        let view = v1::AddVisualPriorRequest { propose: 4, request_id: "again".into(), ..prior(name) };
        let seen = caller.add_prior(view).await.unwrap().candidates;
        // A view may move the surface by a little.
        assert!(nearest_m(&seen, &left) >= RADIUS_M - 1e-9, "{}", nearest_m(&seen, &left));
        let said =
            |robot, id| v1::ReportContactRequest { robot, propose: 4, ..report(name, miss(&seen[0]), id) };
        let of_right = caller.report(said(robot("right"), "right")).await.unwrap().candidates;
        assert!(!of_right.is_empty() && nearest_m(&of_right, &left) >= RADIUS_M - 1e-9);
        let of_nobody = caller.report(said(None, "nobody")).await.unwrap().candidates;
        assert!(nearest_m(&of_nobody, &left) >= RADIUS_M - 1e-9);
    }
}

#[tokio::test]
async fn a_lease_ends_with_the_result_of_its_candidate_whoever_reports_it() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.begin(name).await;
        let left = best(&caller, wish(name, "left", 2, 60_000)).await;
        let held = |proposal: v1::ProposeContactsResponse| proposal.excluded.unwrap().leased;
        let both = held(caller.propose(look(name, "right", 1)).await.unwrap());
        // A touch is data, also by the wrong arm.
        let mut by_right = touch(&left[0], 0.001);
        by_right.robot_id = "right".into();
        let reply = caller.report(report(name, by_right, "right")).await.unwrap();
        assert_eq!(reply.session.unwrap().stats.unwrap().contacts, 1);
        let one = held(caller.propose(look(name, "right", 1)).await.unwrap());
        assert!(one > 0 && one < both, "{one} {both}");
        caller.report(report(name, touch(&left[1], 0.001), "left")).await.unwrap();
        assert_eq!(held(caller.propose(look(name, "right", 1)).await.unwrap()), 0);
    }
}

#[tokio::test]
async fn a_lease_expires_by_itself() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let first = caller.begin(name).await;
        let left = best(&caller, wish(name, "left", 1, 20)).await;
        soon("the end of the lease", async {
            while nearest_m(&best(&caller, look(name, "right", 1)).await, &left) > 0.0 {
                tokio::time::sleep(Duration::from_millis(2)).await;
            }
        })
        .await;
        let free = caller.propose(look(name, "right", 1)).await.unwrap();
        assert_eq!((free.excluded.unwrap().leased, free.candidates[0].point), (0, first.point));
        assert_eq!(caller.log(name).await.len(), 3, "an expiry is no event");
    }
}

#[tokio::test]
async fn a_repeated_wish_gets_the_first_reply_and_no_second_lease() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.begin(name).await;
        let request =
            v1::ProposeContactsRequest { request_id: "mine".into(), ..wish(name, "left", 1, 60_000) };
        let first = caller.propose(request.clone()).await.unwrap();
        caller.report(report(name, miss(&first.candidates[0]), "miss")).await.unwrap();
        assert_eq!(caller.propose(request.clone()).await.unwrap(), first);
        assert_eq!(caller.get(name).await.unwrap().revision, 4);
        let other = v1::ProposeContactsRequest { top_k: 2, ..request };
        assert_eq!(caller.propose(other).await.unwrap_err().reason, "REQUEST_ID_REUSED");
    }
}

#[tokio::test]
async fn a_wish_that_cannot_be_met_says_why_and_changes_nothing() {
    let limits = Limits { leased_places: 2, ..Limits::default() };
    let server = Server::with_options(ServeOptions { limits, ..ServeOptions::default() }).await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let unseen = caller.propose(wish(name, "left", 1, 1000)).await.unwrap_err();
        assert_eq!(unseen.reason, "NO_VISUAL_PRIOR");
        caller.add_prior(prior(name)).await.unwrap();
        for (request, field) in [
            (wish(name, "", 1, 1000), "robot.robot_id"),
            (v1::ProposeContactsRequest { robot: None, ..wish(name, "left", 1, 1000) }, "robot.robot_id"),
            (wish(name, "left", 1, 0), "lease"),
            (wish(name, "left", 1, 600_001), "lease"),
        ] {
            let refused = caller.propose(request).await.unwrap_err();
            assert_eq!((refused.reason.as_str(), refused.fields), ("FIELD_INVALID", vec![field.to_owned()]));
        }
        let many = caller.propose(wish(name, "left", 3, 1000)).await.unwrap_err();
        assert_eq!(many.reason, "QUOTA");
        let all = v1::Ball { center: Some(v1::Vector3 { x: 0.0, y: 0.0, z: 0.3 }), radius_m: 1.0 };
        let keep_out = vec![v1::KeepOut { shape: Some(v1::keep_out::Shape::Ball(all)) }];
        let nowhere = Some(v1::RobotContext { robot_id: "left".into(), keep_out, ..Default::default() });
        let nowhere = v1::ProposeContactsRequest { robot: nowhere, ..wish(name, "left", 1, 1000) };
        assert_eq!(caller.propose(nowhere).await.unwrap().candidates, [], "nothing to promise");
        assert_eq!(caller.log(name).await.len(), 2);
    }
}

#[tokio::test]
async fn a_robot_that_waits_for_others_is_not_told_to_stop() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.begin("ball").await;
    // Enough other arms leave nothing to this one.
    for arm in 0..40 {
        best(&caller, wish("ball", &format!("arm-{arm}"), 1, 600_000)).await;
        if best(&caller, look("ball", "right", 1)).await.is_empty() {
            break;
        }
    }
    let waiting = caller.propose(look("ball", "right", 1)).await.unwrap();
    assert!(waiting.candidates.is_empty() && waiting.excluded.unwrap().leased > 0);
    assert_eq!(waiting.should_stop(), v1::StopReason::Unspecified);
}

#[tokio::test]
async fn a_lease_survives_a_killed_server_and_every_state_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let server = Process::serve(&database).await;
    let caller = server.caller(Transport::Grpc);
    caller.begin("ball").await;
    let left = best(&caller, wish("ball", "left", 2, 600_000)).await;
    let request =
        v1::ReportContactRequest { robot: robot("right"), ..report("ball", miss(&left[0]), "miss") };
    let next = caller.report(request).await.unwrap().candidates.remove(0);
    caller.go_on("ball", next, 2).await;
    let (asked, session) = (best(&caller, look("ball", "right", 8)).await, caller.get("ball").await.unwrap());
    let log = caller.log("ball").await;
    assert_eq!((log.len(), session.revision), (6, 6));

    server.kill().await;
    let server = Process::serve(&database).await;
    let caller = server.caller(Transport::Http);
    assert_eq!(caller.log("ball").await, log);
    let free = best(&caller, look("ball", "right", 8)).await;
    assert_eq!(free, asked);
    assert!(nearest_m(&free, &left[1..]) >= RADIUS_M - 0.005, "the surface moved by a little at most");
    assert_eq!(without_timing(caller.get("ball").await.unwrap()), without_timing(session));
    // The next event is computed from a state that was replayed over the lease.
    caller.report(report("ball", touch(&free[0], 0.001), "after")).await.unwrap();
    assert!(server.terminate().await.success());
}

#[tokio::test]
async fn a_watcher_sees_leases_with_the_session_after_them() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.begin("ball").await;
    let leased = caller.propose(wish("ball", "left", 1, 60_000)).await.unwrap();
    let request =
        v1::WatchSessionRequest { session_id: "ball".into(), after_revision: 2, ..Default::default() };
    let mut updates = reply(caller.reconstruction().watch_session(request)).await.unwrap();
    let update = soon("the lease", updates.next()).await.unwrap().unwrap();
    assert_eq!(update.update, Some(Update::Event(caller.log("ball").await.remove(2))));
    assert_eq!(without_timing(update.session.unwrap()), without_timing(caller.get("ball").await.unwrap()));
    assert_eq!(update.candidates, leased.candidates);
}

#[tokio::test]
async fn a_lease_is_asked_on_a_stream_and_told_again_to_who_comes_back() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.begin("ball").await;
    let right = best(&caller, wish("ball", "right", 1, 60_000)).await;
    let open = v1::ExploreOpen { session_id: "ball".into(), robot: robot("left"), ..Default::default() };
    let mine = |request_id: &str, id| v1::ExploreRequest {
        id,
        request_id: request_id.into(),
        message: Some(RequestMessage::Propose(v1::ProposeContactsRequest {
            session_id: String::new(),
            robot: None,
            ..wish("ball", "", 1, 60_000)
        })),
    };
    let begin = |resume_after_revision| v1::ExploreRequest {
        message: Some(RequestMessage::Open(v1::ExploreOpen { resume_after_revision, ..open.clone() })),
        ..Default::default()
    };
    let mut told = Vec::new();
    for resume_after_revision in [0, 3] {
        let (to, messages) = mpsc::channel(8);
        let mut from = reply(caller.exploration().explore(ReceiverStream::new(messages))).await.unwrap();
        to.send(begin(resume_after_revision)).await.unwrap();
        to.send(mine("mine", 7)).await.unwrap();
        drop(to);
        while let Some(heard) = soon("an answer", from.next()).await {
            if let Some(ReplyMessage::Candidates(answer)) = heard.unwrap().message {
                told.push(answer);
            }
        }
    }
    // Once when it asked, once as what it may have missed, and once as the answer to the same message.
    assert_eq!(told.len(), 3);
    assert!(told.iter().all(|answer| *answer == told[0]));
    assert!(nearest_m(&told[0].candidates, &right) >= RADIUS_M);
    assert_eq!(caller.log("ball").await.len(), 4);
}

#[tokio::test]
async fn the_client_asks_for_a_lease_under_one_request_id() {
    let server = Server::start().await;
    server.grpc().begin("ball").await;
    let client = server.client().await;
    let left = client.propose_contacts(wish("ball", "left", 1, 60_000)).await.unwrap();
    let right = client.propose_contacts(wish("ball", "right", 1, 60_000)).await.unwrap();
    assert!(nearest_m(&left.candidates, &right.candidates) >= RADIUS_M);
    assert!(server.grpc().log("ball").await[2..].iter().all(|event| !event.request_id.is_empty()));
}
