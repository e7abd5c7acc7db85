//! Every outcome of an approach is counted as what it is, and a failure is data, not an error.

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;

use crate::harness::{Caller, Server, Transport, miss, question, report, result, touch};

/// Reports `said` of the next candidate of a fresh session, and gives the reply with the candidate.
async fn say(
    caller: &Caller,
    session_id: &str,
    said: impl FnOnce(&v1::Candidate) -> v1::ContactResult,
) -> (v1::Candidate, v1::ReportContactResponse) {
    let candidate = caller.begin(session_id).await;
    let reply = caller.report(report(session_id, said(&candidate), "first")).await.unwrap();
    assert_eq!((reply.seq, reply.duplicate), (3, false));
    let session = reply.session.clone().unwrap();
    assert_eq!((session.revision, session.state()), (3, v1::SessionState::Active));
    assert_eq!(caller.get(session_id).await.unwrap(), session);
    (candidate, reply)
}

/// contacts, no_contacts, rejected, early_contacts, invalid_contacts, failures, attempts, consecutive_failures
fn counts(session: Option<&v1::Session>) -> [u32; 8] {
    let stats = session.unwrap().stats.as_ref().unwrap();
    assert_eq!(stats.attempts, stats.contacts + stats.failures);
    let kinds = stats.early_contacts + stats.no_contacts + stats.rejected + stats.invalid_contacts;
    assert_eq!(stats.failures, kinds);
    [
        stats.contacts,
        stats.no_contacts,
        stats.rejected,
        stats.early_contacts,
        stats.invalid_contacts,
        stats.failures,
        stats.attempts,
        stats.consecutive_failures,
    ]
}

fn distance_m(a: &v1::Candidate, b: &v1::Candidate) -> f64 {
    let (a, b) = (a.point.unwrap(), b.point.unwrap());
    (a.x - b.x).hypot(a.y - b.y).hypot(a.z - b.z)
}

#[tokio::test]
async fn a_contact_moves_the_surface_to_where_it_touched() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let name = transport.name();
        let (candidate, reply) = say(&server.caller(transport), name, |next| touch(next, 0.002)).await;
        assert_eq!(counts(reply.session.as_ref()), [1, 0, 0, 0, 0, 0, 1, 0]);
        // Eq. (1): the offset of 2 mm on a pad of 9 mm half side is well inside.
        assert!(reply.contact_uncertainty > 0.0 && reply.contact_uncertainty < 0.2, "{reply:?}");
        assert!(reply.max_vertex_move_m > 0.0005 && reply.max_vertex_move_m < 0.02, "{reply:?}");
        assert_eq!(reply.warnings, [""; 0]);
        assert!(distance_m(&candidate, &reply.candidates[0]) > 0.005, "the next candidate is elsewhere");
    }
}

#[tokio::test]
async fn a_contact_far_from_its_candidate_is_a_failure_with_a_warning() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let name = transport.name();
        let (candidate, reply) = say(&server.caller(transport), name, |next| touch(next, 0.02)).await;
        assert_eq!(counts(reply.session.as_ref()), [0, 0, 0, 1, 0, 1, 1, 1]);
        assert!(reply.warnings.iter().any(|text| text.contains("20.0 mm")), "{:?}", reply.warnings);
        assert!(distance_m(&candidate, &reply.candidates[0]) > 0.005, "it is not proposed again at once");
    }
}

#[tokio::test]
async fn a_miss_moves_the_surface_and_is_not_proposed_again_at_once() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let name = transport.name();
        let caller = server.caller(transport);
        let (candidate, reply) = say(&caller, name, miss).await;
        assert_eq!(counts(reply.session.as_ref()), [0, 1, 0, 0, 0, 1, 1, 1]);
        assert_eq!(reply.contact_uncertainty, 0.0);
        assert!(reply.max_vertex_move_m > 0.0, "what was swept freely is evidence");
        assert!(distance_m(&candidate, &reply.candidates[0]) > 0.005, "it is not proposed again at once");
        let proposal = caller.propose(question(name, 64)).await.unwrap();
        assert!(proposal.candidates.iter().all(|other| other.candidate_id != candidate.candidate_id));
    }
}

#[tokio::test]
async fn a_rejected_candidate_counts_as_a_failed_attempt_and_makes_room_for_another() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let name = transport.name();
        let caller = server.caller(transport);
        let rejected =
            v1::Rejected { reason: v1::RejectReason::NoIk.into(), detail: "elbow at its limit".into() };
        let said = ContactOutcome::Rejected(rejected.clone());
        let (candidate, reply) = say(&caller, name, |next| result(next, said)).await;
        assert_eq!(counts(reply.session.as_ref()), [0, 0, 1, 0, 0, 1, 1, 1]);
        assert!(distance_m(&candidate, &reply.candidates[0]) > 0.005);
        let proposal = caller.propose(question(name, 1)).await.unwrap();
        assert!(
            proposal.excluded.unwrap().unreachable > 0 && proposal.excluded.unwrap().recently_failed == 0,
            "the surface is still there, and the reply says so"
        );

        let log = caller.log(name).await;
        let Some(v1::event::Kind::ContactResult(logged)) = &log[2].kind else { panic!("{:?}", log[2]) };
        assert_eq!(logged.outcome, Some(ContactOutcome::Rejected(rejected)), "what the robot said is kept");
        let nothing = v1::ContactResult { candidate_id: String::new(), ..logged.clone() };
        let refused = caller.report(report(name, nothing, "of nothing")).await.unwrap_err();
        assert_eq!(refused.fields, ["result.candidate_id"]);
    }
}

#[tokio::test]
async fn a_touch_outside_the_pad_is_counted_and_is_no_attractor() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let name = transport.name();
        let said = |next: &v1::Candidate| {
            let invalid =
                v1::InvalidContact { sensor_pose: next.tool_pose, detail: "the wrist touched".into() };
            result(next, ContactOutcome::InvalidContact(invalid))
        };
        let (_, reply) = say(&server.caller(transport), name, said).await;
        assert_eq!(counts(reply.session.as_ref()), [0, 0, 0, 0, 1, 1, 1, 1]);
        assert_eq!(reply.max_vertex_move_m, 0.0);
    }
}

#[tokio::test]
async fn a_run_of_failures_ends_with_the_next_success() {
    let server = Server::start().await;
    let caller = server.grpc();
    let mut reply =
        v1::ReportContactResponse { candidates: vec![caller.begin("ball").await], ..Default::default() };
    for (step, fails) in [true, true, false].into_iter().enumerate() {
        let next = &reply.candidates[0];
        let said = if fails { miss(next) } else { touch(next, 0.0) };
        reply = caller.report(report("ball", said, &format!("step-{step}"))).await.unwrap();
    }
    assert_eq!(counts(reply.session.as_ref()), [1, 2, 0, 0, 0, 2, 3, 0]);
}

#[tokio::test]
async fn a_wrench_that_looks_wrong_is_accepted_with_a_warning() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("ball").await;
    let mut pulling = touch(&next, 0.0);
    let Some(ContactOutcome::Contact(contact)) = &mut pulling.outcome else { panic!("a contact") };
    contact.wrench.as_mut().unwrap().force.as_mut().unwrap().z = 2.0;
    let reply = caller.report(report("ball", pulling, "pulling")).await.unwrap();
    assert_eq!(reply.warnings.len(), 1, "{:?}", reply.warnings);

    let mut twisting = touch(&reply.candidates[0], 0.0);
    let Some(ContactOutcome::Contact(contact)) = &mut twisting.outcome else { panic!("a contact") };
    contact.wrench.as_mut().unwrap().torque.as_mut().unwrap().x = 0.5;
    let reply = caller.report(report("ball", twisting, "twisting")).await.unwrap();
    assert_eq!(reply.warnings.len(), 1, "{:?}", reply.warnings);
    assert_eq!(counts(reply.session.as_ref())[0], 2, "both are contacts all the same");
}

#[tokio::test]
async fn a_normal_that_points_into_the_object_is_ignored_with_a_warning() {
    let server = Server::start().await;
    let caller = server.grpc();
    let mut next = caller.begin("ball").await;
    for (sign, warnings) in [(1.0, 0), (-1.0, 1)] {
        let mut measured = touch(&next, 0.0);
        let Some(ContactOutcome::Contact(contact)) = &mut measured.outcome else { panic!("a contact") };
        let outwards = next.normal.unwrap();
        contact.normal =
            Some(v1::Vector3 { x: sign * outwards.x, y: sign * outwards.y, z: sign * outwards.z });
        let mut reply = caller.report(report("ball", measured, &format!("{sign}"))).await.unwrap();
        assert_eq!(reply.warnings.len(), warnings, "{:?}", reply.warnings);
        next = reply.candidates.remove(0);
    }
}

#[tokio::test]
async fn a_contact_of_the_robots_own_choice_needs_no_candidate() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let name = transport.name();
        let said =
            |next: &v1::Candidate| v1::ContactResult { candidate_id: String::new(), ..touch(next, 0.03) };
        let (_, reply) = say(&server.caller(transport), name, said).await;
        assert_eq!(counts(reply.session.as_ref()), [1, 0, 0, 0, 0, 0, 1, 0], "nothing to be early for");
    }
}
