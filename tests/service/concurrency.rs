//! Many callers at once: one order, no gaps, nothing lost, nothing twice.

use std::collections::BTreeSet;

use palpate_client::proto::v1::ReportContactRequest;
use palpate_proto::v1;
use tokio::task::JoinSet;

use crate::harness::{Server, Transport, miss, prior, report, soon, touch};

#[tokio::test]
async fn a_stale_expected_revision_is_refused_and_a_right_one_accepted() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let next = caller.begin(name).await;
        let at = |expected, request_id: &str| v1::ReportContactRequest {
            expected_revision: Some(expected),
            ..report(name, touch(&next, 0.001), request_id)
        };
        let before = caller.get(name).await.unwrap();
        for wrong in [0, 1, 3] {
            let refused = caller.report(at(wrong, "touch")).await.unwrap_err();
            assert_eq!(refused.reason, "REVISION_MISMATCH");
            assert!(refused.message.contains("revision 2"), "{refused:?}");
        }
        assert_eq!(caller.get(name).await.unwrap(), before);
        caller.report(at(2, "right")).await.unwrap();
        let view = v1::AddVisualPriorRequest {
            expected_revision: Some(2),
            request_id: "late".into(),
            ..prior(name)
        };
        assert_eq!(caller.add_prior(view).await.unwrap_err().reason, "REVISION_MISMATCH");
        let retry = caller.report(at(2, "right")).await.unwrap();
        assert!(retry.duplicate, "a retry is answered although the revision has moved on by it");
    }
}

#[tokio::test]
async fn of_many_reports_that_expect_the_same_revision_one_is_accepted() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("ball").await;
    let mut racers = JoinSet::new();
    for racer in 0..8 {
        let request = v1::ReportContactRequest {
            expected_revision: Some(2),
            ..report("ball", miss(&next), &format!("racer-{racer}"))
        };
        let caller = server.caller(Transport::BOTH[racer % 2]);
        racers.spawn(async move { caller.report(request).await });
    }
    let outcomes = soon("all racers", racers.join_all()).await;
    assert_eq!(outcomes.iter().filter(|outcome| outcome.is_ok()).count(), 1);
    let refusals = outcomes.iter().filter_map(|outcome| outcome.as_ref().err());
    assert!(refusals.clone().all(|refused| refused.reason == "REVISION_MISMATCH"), "{outcomes:?}");
    assert_eq!(caller.get("ball").await.unwrap().revision, 3);
}

#[tokio::test]
async fn reports_of_many_robots_at_once_are_all_counted_once_in_one_order() {
    const ROBOTS: usize = 8;
    const EACH: usize = 3;
    let server = Server::start().await;
    let next = server.grpc().begin("ball").await;
    let mut robots = JoinSet::new();
    for robot in 0..ROBOTS {
        let (client, next) = (server.client().await, next.clone());
        robots.spawn(async move {
            let mut seqs = Vec::new();
            for step in 0..EACH {
                let result = if step % 2 == 0 { miss(&next) } else { touch(&next, 0.001) };
                let request: ReportContactRequest = report("ball", result, &format!("robot-{robot}-{step}"));
                let first = client.report_contact(request.clone()).await.unwrap();
                let again = client.report_contact(request).await.unwrap();
                assert_eq!((again.duplicate, again.seq), (true, first.seq));
                seqs.push(first.seq);
            }
            assert!(seqs.is_sorted(), "each robot's own reports keep their order: {seqs:?}");
            seqs
        });
    }
    let acknowledged: BTreeSet<i64> =
        soon("all robots", robots.join_all()).await.concat().into_iter().collect();
    let expected: BTreeSet<i64> = (3..3 + (ROBOTS * EACH) as i64).collect();
    assert_eq!(acknowledged, expected, "every report has a number of its own, and there is no gap");

    let log = server.grpc().log("ball").await;
    let seqs: Vec<i64> = log.iter().map(|event| event.seq).collect();
    assert_eq!(seqs, (1..=log.len() as i64).collect::<Vec<_>>());
    let ids: BTreeSet<&str> = log.iter().map(|event| event.request_id.as_str()).collect();
    assert_eq!((log.len(), ids.len()), (2 + ROBOTS * EACH, 2 + ROBOTS * EACH));
    assert!(log.is_sorted_by_key(|event| event.append_time.map(|time| (time.seconds, time.nanos))));
    let stats = server.grpc().get("ball").await.unwrap().stats.unwrap();
    assert_eq!(stats.attempts as usize, ROBOTS * EACH);
}

#[tokio::test]
async fn the_same_report_sent_many_times_at_once_is_counted_once() {
    let server = Server::start().await;
    let next = server.grpc().begin("ball").await;
    let mut retries = JoinSet::new();
    for _ in 0..8 {
        let (client, request) = (server.client().await, report("ball", touch(&next, 0.001), "touch"));
        retries.spawn(async move { client.report_contact(request).await.unwrap() });
    }
    let replies = soon("all retries", retries.join_all()).await;
    assert_eq!(replies.iter().filter(|reply| !reply.duplicate).count(), 1);
    let first = replies.iter().find(|reply| !reply.duplicate).unwrap();
    let expected = v1::ReportContactResponse { duplicate: true, ..first.clone() };
    assert!(replies.iter().filter(|reply| reply.duplicate).all(|reply| *reply == expected));
    assert_eq!(server.grpc().log("ball").await.len(), 3);
}

#[tokio::test]
async fn sessions_do_not_disturb_each_other() {
    let server = Server::start().await;
    let mut robots = JoinSet::new();
    for robot in 0..6 {
        let caller = server.caller(Transport::BOTH[robot % 2]);
        robots.spawn(async move {
            let name = format!("robot-{robot}");
            let first = caller.begin(&name).await;
            caller.go_on(&name, first, 3).await;
            caller.log(&name).await.into_iter().map(|event| event.state_hash).collect::<Vec<_>>()
        });
    }
    let chains = soon("all robots", robots.join_all()).await;
    assert_eq!(chains[0].len(), 5);
    assert!(chains.iter().all(|chain| *chain == chains[0]), "the same evidence gives the same states");
}
