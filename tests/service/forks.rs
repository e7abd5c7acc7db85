//! Forks: the same touches in another session, under the same configuration or another one.

use palpate_proto::FieldMask;
use palpate_proto::v1;
use palpate_proto::v1::event::Kind;

use crate::harness::{Caller, Server, Transport, creation, prior, report, touch};

fn fork(session_id: &str, new_session_id: &str, revision: i64) -> v1::ForkSessionRequest {
    v1::ForkSessionRequest {
        session_id: session_id.into(),
        new_session_id: new_session_id.into(),
        revision,
        request_id: format!("fork-{new_session_id}"),
        ..Default::default()
    }
}

fn changed(
    request: v1::ForkSessionRequest,
    config: v1::SessionConfig,
    paths: &[&str],
) -> v1::ForkSessionRequest {
    let paths = paths.iter().map(|&path| path.to_owned()).collect();
    v1::ForkSessionRequest { config: Some(config), config_mask: Some(FieldMask { paths }), ..request }
}

async fn raw(caller: &Caller, session_id: &str, revision: i64) -> v1::mesh::Body {
    let request = v1::GetMeshRequest { session_id: session_id.into(), revision, ..Default::default() };
    caller.mesh(request).await.unwrap().body.unwrap()
}

fn hashes(log: &[v1::Event]) -> Vec<&str> {
    log.iter().map(|event| event.state_hash.as_str()).collect()
}

#[tokio::test]
async fn a_fork_at_a_revision_is_its_parent_at_that_revision_and_goes_on_alone() {
    let mut server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let next = caller.begin(name).await;
        let next = caller.go_on(name, next, 4).await;
        let log = caller.log(name).await;
        let copy = format!("{name}-copy");
        let forked = caller.fork(fork(name, &copy, 4)).await.unwrap();
        assert_eq!((forked.session_id.as_str(), forked.revision), (copy.as_str(), 4));
        assert_eq!((forked.forked_from.as_str(), forked.forked_at_revision), (name, 4));
        assert_eq!(forked.state(), v1::SessionState::Active);
        assert_eq!(caller.fork(fork(name, &copy, 4)).await.unwrap(), forked, "a retry is answered as before");
        let other = v1::ForkSessionRequest { request_id: "another".into(), ..fork(name, &copy, 3) };
        assert_eq!(caller.fork(other).await.unwrap_err().reason, "SESSION_EXISTS");

        let copied = caller.log(&copy).await;
        assert_eq!(hashes(&copied), hashes(&log[..4]));
        assert!(
            matches!(&copied[0].kind, Some(Kind::Forked(forked)) if forked.ancestors[0].session_id == name)
        );
        let times = |log: &[v1::Event]| log[1..4].iter().map(|event| event.append_time).collect::<Vec<_>>();
        assert_eq!(times(&copied), times(&log), "events keep the times at which they happened");
        assert_eq!(raw(&caller, &copy, 4).await, raw(&caller, name, 4).await);

        server = server.restart().await;
        let caller = server.caller(transport);
        assert_eq!(raw(&caller, &copy, 4).await, raw(&caller, name, 4).await);
        // A candidate of the parent from after the fork is none of the fork's; an own one is.
        let own =
            caller.propose(v1::ProposeContactsRequest { session_id: copy.clone(), ..Default::default() });
        let own = own.await.unwrap().candidates.remove(0);
        let foreign = caller.report(report(&copy, touch(&next, 0.001), "foreign")).await.unwrap();
        let code = v1::WarningCode::CandidateOfAnotherSession;
        assert!(foreign.warning_details.iter().any(|warning| warning.code() == code));
        caller.report(report(&copy, touch(&own, 0.001), "own")).await.unwrap();
        assert_eq!(caller.get(&copy).await.unwrap().revision, 6);
        assert_eq!(caller.get(name).await.unwrap().revision, 6, "the parent is as it was");
    }
}

#[tokio::test]
async fn a_fork_under_another_method_is_what_that_method_makes_of_the_same_touches() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let next = caller.begin(name).await;
        caller.go_on(name, next, 3).await;
        let paper = v1::SessionConfig { method: v1::Method::Paper.into(), ..Default::default() };
        let copy = format!("{name}-paper");
        let request = v1::ForkSessionRequest {
            labels: [("strategy".to_owned(), "paper".to_owned())].into(),
            ..changed(fork(name, &copy, 0), paper.clone(), &["method"])
        };
        let forked = caller.fork(request).await.unwrap();
        assert_eq!(forked.config.as_ref().unwrap().method(), v1::Method::Paper);
        assert_eq!(forked.labels["strategy"], "paper");
        assert_eq!(forked.stats.as_ref().unwrap().template, "ellipsoid");

        // The same events sent to a new session with that configuration.
        let direct = format!("{name}-direct");
        let request = v1::CreateSessionRequest { config: Some(paper), ..creation(&direct) };
        caller.create(request).await.unwrap();
        caller.add_prior(prior(&direct)).await.unwrap();
        for event in &caller.log(name).await[2..] {
            let Some(Kind::ContactResult(mut result)) = event.kind.clone() else { panic!("{event:?}") };
            // The same aim under an id of the new session.
            let (aim, _) = result.candidate_id.split_once('.').unwrap();
            result.candidate_id = aim.to_owned();
            caller.report(report(&direct, result, &event.request_id)).await.unwrap();
        }
        assert_eq!(hashes(&caller.log(&copy).await), hashes(&caller.log(&direct).await));

        let seed = v1::SessionConfig { alpha_travel: Some(-1.0), ..Default::default() };
        let refused =
            caller.fork(changed(fork(name, "bad-one", 0), seed, &["alpha_travel"])).await.unwrap_err();
        assert_eq!(refused.fields, ["config.alpha_travel"]);
        let refused = caller.fork(changed(fork(name, "bad-one", 0), Default::default(), &["methods"])).await;
        assert_eq!(refused.unwrap_err().fields, ["config_mask"]);
        assert_eq!(caller.fork(fork(name, "bad-one", 99)).await.unwrap_err().fields, ["revision"]);
        assert_eq!(caller.fork(fork(name, "Bad One", 0)).await.unwrap_err().fields, ["new_session_id"]);
        assert_eq!(caller.fork(fork("nobody", "bad-one", 0)).await.unwrap_err().reason, "SESSION_NOT_FOUND");
        assert_eq!(caller.get("bad-one").await.unwrap_err().reason, "SESSION_NOT_FOUND");
    }
}

#[tokio::test]
async fn a_fork_of_a_fork_of_a_finished_session_with_a_retraction_knows_where_it_comes_from() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("first").await;
    let next = caller.go_on("first", next, 2).await;
    let retraction = v1::RetractEventRequest { session_id: "first".into(), seq: 3, ..Default::default() };
    caller.retract(retraction).await.unwrap();
    let done = v1::FinishSessionRequest { session_id: "first".into(), ..Default::default() };
    assert_eq!(caller.finish(done).await.unwrap().revision, 6);
    let second = caller.fork(fork("first", "second", 0)).await.unwrap();
    assert_eq!((second.revision, second.forked_at_revision), (5, 5), "that it was finished is not copied");
    assert_eq!(second.retracted_seqs, [3]);
    // What the ancestor proposed before the fork is a candidate of the fork, and of the fork's fork.
    let third = caller.fork(fork("second", "third", 0)).await.unwrap();
    assert_eq!((third.forked_from.as_str(), third.forked_at_revision), ("second", 5));
    let reported = caller.report(report("third", touch(&next, 0.001), "t")).await.unwrap();
    assert!(reported.warnings.iter().all(|warning| !warning.contains("another session")));
    let log = caller.log("third").await;
    let Some(Kind::Forked(forked)) = &log[0].kind else { panic!("{log:?}") };
    let names: Vec<&str> = forked.ancestors.iter().map(|ancestor| ancestor.session_id.as_str()).collect();
    assert_eq!(names, ["second", "first"]);
    let request = v1::ReplaySessionRequest { session_id: "third".into(), verify: true, ..Default::default() };
    assert!(caller.replay(request).await.unwrap().iter().all(|step| step.hash_matches));
    // Also between an event and its retraction each revision is what it was.
    let parent = caller.log("first").await;
    assert_eq!(hashes(&log[..5]), hashes(&parent[..5]));
}

#[tokio::test]
async fn what_other_strategies_would_touch_is_kept_beside_each_event() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let shadow = vec![v1::Strategy::MinUncertainty.into(), v1::Strategy::Random.into()];
        let config = v1::SessionConfig { shadow, ..Default::default() };
        let alone = caller.begin(&format!("{name}-alone")).await;
        let created = v1::CreateSessionRequest { config: Some(config.clone()), ..creation(name) };
        assert_eq!(caller.create(created).await.unwrap().config.unwrap().shadow, config.shadow);
        let first = caller.add_prior(prior(name)).await.unwrap();
        let own = &first.candidates[0];
        assert_eq!(own.point, alone.point, "asking others changes nothing");
        let strategies: Vec<v1::Strategy> =
            first.shadow_choices.iter().map(v1::ShadowChoice::strategy).collect();
        assert_eq!(strategies, [v1::Strategy::Proactive, v1::Strategy::MinUncertainty, v1::Strategy::Random]);
        assert_eq!(first.shadow_choices[0].candidate.as_ref().unwrap().point, own.point);
        caller.report(report(name, touch(own, 0.001), "a")).await.unwrap();
        let log = caller.log(name).await;
        assert_eq!(log[1].shadow_choices, first.shadow_choices);
        assert_eq!(log[2].shadow_choices.len(), 3);
        for (shadow, field) in [
            (vec![v1::Strategy::Proactive], "config.shadow[0]"),
            (vec![v1::Strategy::Random, v1::Strategy::Random], "config.shadow[1]"),
        ] {
            let config = v1::SessionConfig {
                shadow: shadow.into_iter().map(Into::into).collect(),
                ..Default::default()
            };
            let refused =
                caller.create(v1::CreateSessionRequest { config: Some(config), ..creation("odd") }).await;
            assert_eq!(refused.unwrap_err().fields, [field]);
        }
        let gpis = v1::SessionConfig {
            method: v1::Method::Gpis.into(),
            shadow: vec![v1::Strategy::ExpectedGain.into()],
            ..Default::default()
        };
        let refused = caller.create(v1::CreateSessionRequest { config: Some(gpis), ..creation("odd") }).await;
        assert_eq!(refused.unwrap_err().fields, ["config.shadow[0]"]);
    }
}
