//! Everything from the network has a bound, and whoever reaches one is told which and what to do.

use std::time::Duration;

use palpate_proto::v1;
use palpate_server::Limits;
use tokio::task::JoinSet;

use crate::harness::{
    Refused, Server, Transport, accepted, cap, creation, miss, prior, question, reply, report, send, soon,
};

#[tokio::test]
async fn too_large_a_message_is_refused_with_the_limit() {
    let limits = Limits { message_bytes: 64 << 10, json_bytes: 32 << 10, ..Limits::default() };
    let server = Server::with_limits(limits).await;
    let caller = server.grpc();
    assert_eq!(caller.server_info().await.unwrap().max_message_bytes, 64 << 10);
    caller.create(creation("ball")).await.unwrap();
    let huge = v1::VisualPrior { points: vec![0; 65 << 10].into(), ..cap() };
    let request = v1::AddVisualPriorRequest { prior: Some(huge.clone()), ..prior("ball") };
    let over_grpc = caller.add_prior(request.clone()).await.unwrap_err();
    assert_eq!(over_grpc.reason, "TOO_LARGE");
    assert!(over_grpc.message.contains("65536"), "{}", over_grpc.message);

    let json = server.caller(Transport::Http).add_prior(request).await.unwrap_err();
    assert_eq!(json.reason, "TOO_LARGE");
    assert!(json.message.contains("32768"), "{}", json.message);
    let file = server
        .http()
        .request(reqwest::Method::POST, "/v1/sessions/ball/priors")
        .header("content-type", "application/octet-stream")
        .body(huge.points);
    let file = accepted(file).await.unwrap_err();
    assert_eq!(file.reason, "TOO_LARGE");
    assert!(file.message.contains("65536"), "{}", file.message);

    assert_eq!(caller.get("ball").await.unwrap().revision, 1);
    caller.add_prior(prior("ball")).await.unwrap();
}

#[tokio::test]
async fn a_session_takes_a_limited_number_of_results() {
    let server = Server::with_limits(Limits { contacts: 2, ..Limits::default() }).await;
    let caller = server.grpc();
    let next = caller.begin("ball").await;
    for step in ["one", "two"] {
        caller.report(report("ball", miss(&next), step)).await.unwrap();
    }
    for transport in Transport::BOTH {
        let refused =
            server.caller(transport).report(report("ball", miss(&next), "three")).await.unwrap_err();
        assert_eq!(refused.reason, "SESSION_FULL", "trying again never helps");
        assert!(refused.message.contains("new session"), "{}", refused.message);
    }
    assert_eq!(caller.get("ball").await.unwrap().revision, 4);
}

#[tokio::test]
async fn texts_labels_and_wishes_are_bounded_by_name() {
    let limits =
        Limits { name_bytes: 16, text_bytes: 20, labels: 2, top_k: 3, keep_out: 1, ..Limits::default() };
    let server = Server::with_limits(limits).await;
    let next = server.grpc().begin("ball").await;
    let long = || "x".repeat(21);
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let create =
            async |request: v1::CreateSessionRequest| caller.create(request).await.unwrap_err().fields;
        let mug = || creation("mug");
        assert_eq!(
            create(v1::CreateSessionRequest { display_name: long(), ..mug() }).await,
            ["display_name"]
        );
        assert_eq!(create(v1::CreateSessionRequest { experiment: long(), ..mug() }).await, ["experiment"]);
        assert_eq!(create(v1::CreateSessionRequest { frame_id: long(), ..mug() }).await, ["frame_id"]);
        assert_eq!(create(v1::CreateSessionRequest { request_id: long(), ..mug() }).await, ["request_id"]);
        let labels = ["a", "b", "c"].map(|name| (name.to_owned(), String::new())).into();
        assert_eq!(create(v1::CreateSessionRequest { labels, ..mug() }).await, ["labels"]);

        assert_eq!(caller.propose(question("ball", 4)).await.unwrap_err().fields, ["top_k"]);
        let greedy = v1::ReportContactRequest { propose: 4, ..report("ball", miss(&next), "greedy") };
        assert_eq!(caller.report(greedy).await.unwrap_err().fields, ["propose"]);
        let robot = v1::RobotContext { keep_out: vec![v1::KeepOut::default(); 2], ..Default::default() };
        let fenced = v1::ProposeContactsRequest { robot: Some(robot), ..question("ball", 1) };
        assert_eq!(caller.propose(fenced).await.unwrap_err().fields, ["robot.keep_out"]);
        let detail = v1::Rejected { detail: long(), ..Default::default() };
        let wordy = crate::harness::result(&next, v1::contact_result::Outcome::Rejected(detail));
        let refused = caller.report(report("ball", wordy, "wordy")).await.unwrap_err();
        assert_eq!(refused.fields, ["result.rejected.detail"]);
    }
    assert_eq!(server.grpc().get("ball").await.unwrap().revision, 2);
}

#[tokio::test]
async fn a_page_is_as_large_as_asked_for_and_never_larger_than_the_limit() {
    let server = Server::with_limits(Limits { page_size: 2, page_size_max: 3, ..Limits::default() }).await;
    for name in ["one", "two", "three", "four"] {
        server.grpc().create(creation(name)).await.unwrap();
    }
    let first = server.grpc().begin("ball").await;
    server.grpc().go_on("ball", first, 2).await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        for (page_size, expected) in [(0, 2), (1, 1), (3, 3), (1000, 3)] {
            let page = v1::ListSessionsRequest { page_size, ..Default::default() };
            assert_eq!(caller.list(page).await.unwrap().sessions.len(), expected);
            let session_id = "ball".to_owned();
            let page = v1::ListEventsRequest { session_id, page_size, ..Default::default() };
            assert_eq!(caller.events(page).await.unwrap().events.len(), expected);
        }
        let negative = v1::ListSessionsRequest { page_size: -1, ..Default::default() };
        assert_eq!(caller.list(negative).await.unwrap_err().fields, ["page_size"]);
        let log: Vec<i64> = caller.log("ball").await.iter().map(|event| event.seq).collect();
        assert_eq!(log, [1, 2, 3, 4], "pages join without gap or repetition");
    }
}

#[tokio::test]
async fn only_so_many_sessions_and_streams_are_open_at_once() {
    let server = Server::with_limits(Limits { sessions: 1, streams: 1, ..Limits::default() }).await;
    let caller = server.grpc();
    caller.create(creation("ball")).await.unwrap();
    for transport in Transport::BOTH {
        let refused = server.caller(transport).create(creation("mug")).await.unwrap_err();
        assert_eq!(refused.reason, "QUOTA");
        assert!(refused.message.contains("delete sessions"), "{}", refused.message);
        server.caller(transport).create(creation("ball")).await.expect("a retry is no new session");
    }
    let watch = v1::WatchSessionRequest { session_id: "ball".into(), ..Default::default() };
    let open = async || reply(caller.reconstruction().watch_session(watch.clone())).await;
    let first = open().await.unwrap();
    assert_eq!(open().await.unwrap_err().reason, "QUOTA");
    let sse = || server.http().get("/v1/sessions/ball/events").header("accept", "text/event-stream");
    assert_eq!(accepted(sse()).await.unwrap_err().reason, "QUOTA");
    drop(first);
    soon("a free place", async { while open().await.is_err() {} }).await;
}

#[tokio::test]
async fn a_full_queue_refuses_at_once_and_says_when_to_try_again() {
    let server = Server::with_limits(Limits { session_queue: 0, ..Limits::default() }).await;
    let next = server.grpc().begin("ball").await;
    let mut accepted_reports = 0;
    for transport in Transport::BOTH {
        // Whether two reports meet is up to the scheduler, so they are sent until two have met.
        let mut refused: Vec<Refused> = Vec::new();
        for round in 0.. {
            let mut reports = JoinSet::new();
            for caller in 0..6 {
                let request = report("ball", miss(&next), &format!("{transport:?}-{round}-{caller}"));
                let caller = server.caller(transport);
                reports.spawn(async move { caller.report(request).await });
            }
            let outcomes = soon("all reports", reports.join_all()).await;
            accepted_reports += outcomes.iter().filter(|outcome| outcome.is_ok()).count();
            refused.extend(outcomes.into_iter().filter_map(Result::err));
            if !refused.is_empty() {
                break;
            }
        }
        for refusal in refused {
            assert_eq!(refusal.reason, "QUEUE_FULL");
            assert!(refusal.retry_after.is_some_and(|wait| wait > Duration::ZERO), "{refusal:?}");
        }
    }
    let stats = server.grpc().get("ball").await.unwrap().stats.unwrap();
    assert_eq!(stats.attempts as usize, accepted_reports, "what was refused was not counted");
    // A client that waits as long as it is told gets through.
    let mut patient = JoinSet::new();
    for caller in 0..6 {
        let (client, request) =
            (server.client().await, report("ball", miss(&next), &format!("patient-{caller}")));
        patient.spawn(async move { client.report_contact(request).await.unwrap() });
    }
    assert_eq!(soon("all patient reports", patient.join_all()).await.len(), 6);
}

#[tokio::test]
async fn readers_do_not_wait_for_a_change() {
    let server = Server::with_limits(Limits { session_queue: 0, ..Limits::default() }).await;
    let next = server.grpc().begin("ball").await;
    let writer = tokio::spawn({
        let caller = server.grpc();
        async move { caller.go_on("ball", next, 10).await }
    });
    let caller = server.grpc();
    let mut revision = 0;
    while !writer.is_finished() {
        let session = caller.get("ball").await.unwrap();
        assert!(session.revision >= revision, "what was seen is not taken back");
        revision = session.revision;
        let mesh = v1::GetMeshRequest { session_id: "ball".into(), ..Default::default() };
        assert!(caller.mesh(mesh).await.unwrap().revision >= revision);
    }
    writer.await.unwrap();
}

#[tokio::test]
async fn a_call_whose_deadline_has_passed_changes_nothing() {
    let server = Server::start().await;
    let caller = server.grpc();
    let created = caller.create(creation("ball")).await.unwrap();
    let mut hurried = tonic::Request::new(prior("ball"));
    hurried.set_timeout(Duration::from_micros(1));
    let late = soon("an answer", caller.exploration().add_visual_prior(hurried)).await.unwrap_err();
    assert!(matches!(late.code(), tonic::Code::DeadlineExceeded | tonic::Code::Cancelled), "{late:?}");
    assert_eq!(caller.get("ball").await.unwrap(), created);
}

#[tokio::test]
async fn http_tells_in_whole_seconds_when_to_try_again() {
    let server = Server::with_limits(Limits { sessions: 0, ..Limits::default() }).await;
    let refused = send(server.http().post("/v1/sessions", &serde_json::json!({}))).await;
    assert_eq!(refused.status(), 429);
    assert_eq!(refused.headers()["retry-after"], "1");
}
