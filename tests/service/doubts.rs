//! A contact that was none: doubted, told, tried again, and believed once something confirms it.

use palpate_proto::v1;
use palpate_proto::v1::WarningCode;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;

use crate::harness::ball::{
    CENTRE, contact_at, directions, distance_m, dot, kinds, met, place, plausible, vector, xyz,
};
use crate::harness::{Caller, Server, Transport, result};

/// True touches, evenly over the ball.
const TOUCHES: usize = 25;
/// Between four of them, where the false one is, so far above the surface in metres.
const FALSE: [f64; 3] = [0.6, 0.0, -0.8];
const ABOVE_M: f64 = 0.012;

/// A well-explored ball and a contact in the air beside it: the reply to that.
async fn with_a_false_contact(caller: &Caller, name: &str) -> v1::ReportContactResponse {
    caller.begin_coarse(name, v1::SessionConfig::default()).await;
    for (number, direction) in directions(TOUCHES).into_iter().enumerate() {
        let reply =
            caller.tell(name, contact_at(direction, 0.0, plausible(number)), &format!("t-{number}")).await;
        assert_eq!(reply.warnings, Vec::<String>::new());
        assert_eq!(reply.session.unwrap().stats.unwrap().doubted_seqs, Vec::<i64>::new());
    }
    caller.tell(name, contact_at(FALSE, ABOVE_M, plausible(0)), "false").await
}

fn doubted(reply: &v1::ReportContactResponse) -> Vec<i64> {
    reply.session.as_ref().unwrap().stats.as_ref().unwrap().doubted_seqs.clone()
}

fn said(reply: &v1::ReportContactResponse) -> Vec<WarningCode> {
    kinds(&reply.warnings, &reply.warning_details)
}

#[tokio::test]
async fn a_contact_in_the_air_is_doubted_and_its_approach_is_proposed_again() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let reply = with_a_false_contact(&caller, name).await;
        let seq = reply.seq;
        assert_eq!(doubted(&reply), [seq]);
        assert_eq!(said(&reply), [], "nothing is told before it was tried again");
        let next = &reply.candidates[0];
        assert!(next.why.contains("doubted"), "{}", next.why);
        assert!(dot(xyz(next.normal.unwrap()), FALSE) > 0.999, "{next:?}");
        let (from, to) = (xyz(next.probe_start.unwrap()), xyz(next.probe_end.unwrap()));
        assert!(distance_m(from, CENTRE) > distance_m(place(FALSE, ABOVE_M), CENTRE));
        assert!(distance_m(to, CENTRE) < 0.05, "the approach reaches what is expected");

        let (mesh, vertices) = caller.vertices(name).await;
        assert_eq!(mesh.doubted.len(), 1);
        assert_eq!(mesh.doubted[0].seq, seq);
        assert!(mesh.doubted[0].doubt > 0.9 && mesh.doubted[0].doubt <= 1.0);
        assert!(distance_m(xyz(mesh.doubted[0].point.unwrap()), place(FALSE, ABOVE_M)) < 1e-3);
        let off_m = |vertex: &[f64; 3]| (distance_m(*vertex, CENTRE) - 0.05).abs();
        let worst_m = vertices.iter().map(off_m).fold(0.0, f64::max);
        assert!(worst_m < 2e-3, "the surface does not follow it: {worst_m}");

        let log = caller.log(name).await;
        let stats = |event: &v1::Event| event.stats_after.clone().unwrap().doubted_seqs;
        assert_eq!(stats(log.last().unwrap()), [seq]);
        assert_eq!(stats(&log[log.len() - 2]), Vec::<i64>::new());
    }
}

/// What was told of a false contact whose place was tried again without finding it.
fn assert_settled(reply: &v1::ReportContactResponse, seq: i64) {
    assert_eq!(doubted(reply), [seq]);
    assert_eq!(said(reply), [WarningCode::DoubtedContact], "{:?}", reply.warnings);
    let told = &reply.warning_details[0].parameters;
    assert!(told["doubt"] > 0.9, "{told:?}");
    assert!(!reply.candidates[0].why.contains("doubted"), "once is enough");
}

#[tokio::test]
async fn a_deeper_contact_on_the_same_approach_leaves_it_doubted_and_says_so() {
    let server = Server::start().await;
    let caller = server.caller(Transport::Grpc);
    let reply = with_a_false_contact(&caller, "ball").await;
    let deeper = met(&reply.candidates[0], CENTRE, plausible(1));
    assert!(matches!(deeper.outcome, Some(ContactOutcome::Contact(_))));
    assert_settled(&caller.tell("ball", deeper, "deeper").await, reply.seq);
}

#[tokio::test]
async fn a_sweep_through_its_place_leaves_it_doubted_and_says_so() {
    let server = Server::start().await;
    let caller = server.caller(Transport::Http);
    let reply = with_a_false_contact(&caller, "ball").await;
    let next = &reply.candidates[0];
    // A robot that gives up before it would meet the ball.
    let free = v1::NoContact {
        swept_from: next.probe_start,
        swept_to: Some(vector(place(FALSE, 0.003))),
        sweep_radius_m: 0.0,
    };
    let through = caller.tell("ball", result(next, ContactOutcome::NoContact(free)), "through").await;
    assert_settled(&through, reply.seq);
}

#[tokio::test]
async fn the_same_contact_again_is_believed() {
    let server = Server::start().await;
    let caller = server.caller(Transport::Http);
    let reply = with_a_false_contact(&caller, "ball").await;
    let again = v1::ContactResult {
        candidate_id: reply.candidates[0].candidate_id.clone(),
        ..contact_at(FALSE, ABOVE_M, plausible(1))
    };
    let again = caller.tell("ball", again, "again").await;
    assert_eq!((doubted(&again), said(&again)), (Vec::new(), Vec::new()), "{:?}", again.warnings);
    let (mesh, vertices) = caller.vertices("ball").await;
    assert_eq!(mesh.doubted, []);
    let nearest_m = vertices.iter().map(|vertex| distance_m(*vertex, place(FALSE, ABOVE_M)));
    let nearest_m = nearest_m.fold(f64::INFINITY, f64::min);
    assert!(nearest_m < 0.008, "the surface follows it now: {nearest_m}");
}
