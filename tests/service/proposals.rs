//! What a robot learns when it asks where to touch.

use palpate_proto::v1;
use palpate_proto::v1::keep_out::Shape;

use crate::harness::{Server, Transport, creation, miss, prior, question, report};

#[tokio::test]
async fn candidates_come_best_first_and_say_what_their_score_is_made_of() {
    let server = Server::start().await;
    let caller = server.grpc();
    let first = caller.begin("ball").await;
    caller.go_on("ball", first, 2).await;
    for transport in Transport::BOTH {
        let proposal = server.caller(transport).propose(question("ball", 5)).await.unwrap();
        assert_eq!((proposal.revision, proposal.candidates.len()), (4, 5));
        assert!(proposal.candidates.is_sorted_by(|a, b| a.score >= b.score));
        for candidate in &proposal.candidates {
            let sum: f64 = candidate.terms.iter().map(|term| term.weight * term.value).sum();
            assert!((sum - candidate.score).abs() < 1e-9, "{candidate:?}");
            assert!(candidate.terms.iter().all(|term| !term.term.is_empty()));
            assert!(candidate.why.len() > 10, "{candidate:?}");
            assert!((0.0..=1.0).contains(&candidate.uncertainty));
            assert!(candidate.mean_geodesic_m > 0.0 && candidate.mean_geodesic_m < 0.5);
            check_approach(candidate);
        }
        let excluded = proposal.excluded.unwrap();
        assert!(excluded.already_certain > 0 && excluded.no_confident_neighbour > 0, "{excluded:?}");
        assert_eq!(excluded.keep_out, 0);
        let alone = server.caller(transport).propose(question("ball", 0)).await.unwrap();
        assert_eq!(alone.candidates, proposal.candidates[..1], "no number means one, the best");
    }
}

/// The approach goes through the point along the normal, and the tool faces the surface.
fn check_approach(candidate: &v1::Candidate) {
    let v = |vector: Option<v1::Vector3>| vector.map(|v| [v.x, v.y, v.z]).unwrap();
    let (point, normal) = (v(candidate.point), v(candidate.normal));
    assert!((normal.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-9);
    for axis in 0..3 {
        assert!((v(candidate.probe_start)[axis] - point[axis] - 0.015 * normal[axis]).abs() < 1e-12);
        assert!((v(candidate.probe_end)[axis] - point[axis] + 0.015 * normal[axis]).abs() < 1e-12);
    }
    let pose = candidate.tool_pose.unwrap();
    let v1::Quaternion { x, y, z, w } = pose.orientation.unwrap();
    let facing = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
    for axis in 0..3 {
        assert!((v(pose.position)[axis] - v(candidate.probe_start)[axis]).abs() < 1e-12);
        assert!((facing[axis] + normal[axis]).abs() < 1e-9, "{facing:?} {normal:?}");
    }
}

#[tokio::test]
async fn the_score_of_any_vertex_is_told_with_what_rules_it_out() {
    let server = Server::start().await;
    let caller = server.grpc();
    let first = caller.begin("ball").await;
    caller.go_on("ball", first, 2).await;
    let table = v1::HalfSpace { normal: Some(v1::Vector3 { x: 0.0, y: 0.0, z: 1.0 }), offset_m: 0.29 };
    let keep_out = vec![v1::KeepOut { shape: Some(Shape::HalfSpace(table)) }];
    let robot = Some(v1::RobotContext { keep_out, ..Default::default() });
    let asking = |explain_vertices: Vec<u32>| v1::ProposeContactsRequest {
        explain_vertices,
        robot: robot.clone(),
        ..question("ball", 1)
    };
    let best = caller.propose(asking(Vec::new())).await.unwrap().candidates.remove(0);
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        // The icosphere's vertices lie all over the object.
        let asked: Vec<u32> = (0..63).chain([best.vertex]).collect();
        let reply = caller.propose(asking(asked.clone())).await.unwrap();
        assert_eq!(reply.candidates, std::slice::from_ref(&best), "it changes no proposal");
        assert!(reply.explained.iter().map(|one| one.vertex).eq(asked));
        let of_best = reply.explained.last().unwrap();
        assert_eq!((&of_best.terms, of_best.score), (&best.terms, best.score));
        assert_eq!((of_best.std_m, of_best.failure_risk), (best.std_m, best.failure_risk));
        assert_eq!(of_best.excluded(), v1::Exclusion::Unspecified);
        for reason in [v1::Exclusion::AlreadyCertain, v1::Exclusion::KeepOut] {
            assert!(reply.explained.iter().any(|one| one.excluded() == reason), "{reason:?}");
        }

        for (asked, field) in [(vec![0, 2562], "explain_vertices[1]"), (vec![0; 65], "explain_vertices")] {
            let refused = caller.propose(asking(asked.clone())).await.unwrap_err();
            assert_eq!((refused.reason.as_str(), refused.fields[0].as_str()), ("FIELD_INVALID", field));
            let lease = Some(palpate_proto::Duration { seconds: 1, nanos: 0 });
            let robot = Some(v1::RobotContext { robot_id: "arm".into(), ..Default::default() });
            let request = v1::ProposeContactsRequest { lease, robot, ..asking(asked) };
            assert_eq!(caller.propose(request).await.unwrap_err().fields[0], field, "with a lease as well");
        }
    }
}

#[tokio::test]
async fn asking_changes_nothing() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.begin("ball").await;
    let before = caller.get("ball").await.unwrap();
    let answers = [
        caller.propose(question("ball", 8)).await.unwrap(),
        caller.propose(question("ball", 8)).await.unwrap(),
        server.caller(Transport::Http).propose(question("ball", 8)).await.unwrap(),
    ];
    assert!(answers.iter().all(|answer| *answer == answers[0]), "the same state gives the same answer");
    assert_eq!(caller.get("ball").await.unwrap(), before);
    assert_eq!(caller.log("ball").await.len(), 2);
}

#[tokio::test]
async fn nothing_is_proposed_before_anything_was_seen() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let refused = caller.propose(question(name, 1)).await.unwrap_err();
        assert_eq!(refused.reason, "NO_VISUAL_PRIOR");
    }
}

#[tokio::test]
async fn no_approach_enters_a_region_to_keep_out_of() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.begin("ball").await;
    let table = v1::HalfSpace { normal: Some(v1::Vector3 { x: 0.0, y: 0.0, z: 1.0 }), offset_m: 0.29 };
    let keep_out = |shape| v1::ProposeContactsRequest {
        robot: Some(v1::RobotContext {
            keep_out: vec![v1::KeepOut { shape: Some(shape) }],
            ..Default::default()
        }),
        ..question("ball", 64)
    };
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let above = caller.propose(keep_out(Shape::HalfSpace(table))).await.unwrap();
        assert!(!above.candidates.is_empty() && above.excluded.unwrap().keep_out > 100);
        for candidate in &above.candidates {
            let lowest = candidate.probe_start.unwrap().z.min(candidate.probe_end.unwrap().z);
            assert!(lowest >= 0.29, "{lowest}");
        }
        let all = v1::Ball { center: Some(v1::Vector3 { x: 0.0, y: 0.0, z: 0.3 }), radius_m: 1.0 };
        let nowhere = caller.propose(keep_out(Shape::Ball(all))).await.unwrap();
        assert_eq!(nowhere.candidates, [], "that nothing is left is an answer, not an error");
        assert_eq!(nowhere.should_stop(), v1::StopReason::NoAdmissibleCandidate);
        assert_eq!(nowhere.excluded.unwrap().keep_out, 2562);
    }
}

#[tokio::test]
async fn a_report_brings_candidates_that_keep_out_of_the_same_regions() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("ball").await;
    let table = v1::HalfSpace { normal: Some(v1::Vector3 { x: 0.0, y: 0.0, z: 1.0 }), offset_m: 0.3 };
    let robot = v1::RobotContext {
        keep_out: vec![v1::KeepOut { shape: Some(Shape::HalfSpace(table)) }],
        ..Default::default()
    };
    let request =
        v1::ReportContactRequest { propose: 8, robot: Some(robot), ..report("ball", miss(&next), "miss") };
    let reply = caller.report(request).await.unwrap();
    assert!(!reply.candidates.is_empty());
    assert!(reply.candidates.iter().all(|candidate| candidate.probe_end.unwrap().z >= 0.3));
}

#[tokio::test]
async fn the_server_advises_to_stop_by_the_rules_of_the_session_and_refuses_nothing_for_it() {
    let server = Server::start().await;
    let rules = [
        (v1::StopRule { max_attempts: Some(2), ..Default::default() }, v1::StopReason::Budget),
        (v1::StopRule { max_consecutive_failures: Some(2), ..Default::default() }, v1::StopReason::Stalled),
        (v1::StopRule { mean_uncertainty_below: Some(1.0), ..Default::default() }, v1::StopReason::Coverage),
    ];
    for (rule, expected) in rules {
        for transport in Transport::BOTH {
            let caller = server.caller(transport);
            let name = format!("{expected:?}-{transport:?}").to_lowercase();
            let config = v1::SessionConfig { stop: Some(rule), ..Default::default() };
            caller
                .create(v1::CreateSessionRequest { config: Some(config), ..creation(&name) })
                .await
                .unwrap();
            let next = caller.add_prior(prior(&name)).await.unwrap().candidates.remove(0);
            for step in 1..=3 {
                let reply = caller.report(report(&name, miss(&next), &format!("{step}"))).await.unwrap();
                let said = reply.session.unwrap().should_stop();
                let due = step >= 2 || expected == v1::StopReason::Coverage;
                assert_eq!(said, if due { expected } else { v1::StopReason::Unspecified }, "{name} {step}");
            }
            assert_eq!(caller.propose(question(&name, 1)).await.unwrap().should_stop(), expected);
        }
    }
}
