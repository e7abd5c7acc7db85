//! An object that was moved, and a robot that says so: all that was known of it is taken along.

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;

use crate::harness::ball::{CENTRE, RADIUS_M, distance_m, kinds, met, plausible, vector};
use crate::harness::{Caller, Server, Transport, creation, report, without_timing};

const TOUCHES: usize = 10;

fn moved(by: [f64; 3], std_m: f64) -> v1::ContactResult {
    let upright = v1::Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };
    let pose = v1::Pose { position: Some(vector(by)), orientation: Some(upright) };
    let said = v1::ObjectMoved { new_from_old: Some(pose), std_m, detail: "pushed by hand".into() };
    v1::ContactResult { outcome: Some(ContactOutcome::ObjectMoved(said)), ..Default::default() }
}

fn mean(vertices: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|k| vertices.iter().map(|vertex| vertex[k]).sum::<f64>() / vertices.len() as f64)
}

/// The ball with some touches.
async fn explored(caller: &Caller, name: &str) {
    let mut next = caller.begin_coarse(name, v1::SessionConfig::default()).await;
    for number in 0..TOUCHES {
        let said = met(&next, CENTRE, plausible(number));
        next = caller.tell(name, said, &format!("touch-{number}")).await.candidates.remove(0);
    }
}

#[tokio::test]
async fn a_motion_that_is_told_moves_the_surface_and_is_no_attempt() {
    let server = Server::start().await;
    let by = [0.018, -0.024, 0.0];
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        explored(&caller, name).await;
        let (before, vertices) =
            (caller.get(name).await.unwrap().stats.unwrap(), caller.vertices(name).await.1);
        let request = report(name, moved(by, 0.0), "moved");
        let reply = caller.report(request.clone()).await.unwrap();
        assert_eq!(reply.touched_points, []);
        assert_eq!(reply.touched_point(), v1::TouchedPoint::Unspecified);
        let stats = reply.session.as_ref().unwrap().stats.clone().unwrap();
        assert_eq!(
            (stats.attempts, stats.contacts, stats.failures, stats.consecutive_failures),
            (before.attempts, before.contacts, before.failures, before.consecutive_failures)
        );
        let motion = stats.motion.unwrap();
        assert_eq!((motion.followed, motion.since_seq), (true, reply.seq));
        let told = motion.translation_m.unwrap();
        assert!(distance_m([told.x, told.y, told.z], by) < 1e-6, "{motion:?}");

        let (old, now) = (mean(&vertices), mean(&caller.vertices(name).await.1));
        let went = [0, 1, 2].map(|k| now[k] - old[k]);
        assert!(distance_m(went, by) < 1e-3, "{went:?}");
        assert!((reply.max_vertex_move_m - 0.03).abs() < 0.003, "{}", reply.max_vertex_move_m);

        // The same again is the same event.
        let again = caller.report(request).await.unwrap();
        assert_eq!(again, v1::ReportContactResponse { duplicate: true, ..reply.clone() });
        assert_eq!(caller.get(name).await.unwrap().revision, reply.seq);

        // In the new place the ball is met where it is expected.
        let centre = [0, 1, 2].map(|k| CENTRE[k] + by[k]);
        let mut next = reply.candidates[0].clone();
        for number in 0..3 {
            let said = met(&next, centre, plausible(number));
            let mut reply = caller.tell(name, said, &format!("after-{number}")).await;
            assert_eq!(kinds(&reply.warnings, &reply.warning_details), [], "{:?}", reply.warnings);
            assert_eq!(reply.session.unwrap().stats.unwrap().contacts, before.contacts + 1 + number as u32);
            next = reply.candidates.remove(0);
        }
        let vertices = caller.vertices(name).await.1;
        let off_m: f64 = vertices.iter().map(|vertex| (distance_m(*vertex, centre) - RADIUS_M).abs()).sum();
        assert!(off_m / (vertices.len() as f64) < 1e-3, "{off_m}");
    }
}

#[tokio::test]
async fn a_motion_that_nobody_told_of_is_followed_or_ends_in_the_advice_to_stop() {
    let server = Server::start().await;
    let by = [0.012, -0.016, 0.0];
    let centre = [0, 1, 2].map(|k| CENTRE[k] + by[k]);
    for (on_motion, transport) in
        [(v1::OnMotion::Follow, Transport::Grpc), (v1::OnMotion::Warn, Transport::Http)]
    {
        let (caller, name) = (server.caller(transport), transport.name());
        let config = v1::SessionConfig { on_motion: on_motion.into(), ..Default::default() };
        let mut next = caller.begin_coarse(name, config).await;
        let mut found = None;
        for number in 0..45 {
            let stands = if number < 18 { CENTRE } else { centre };
            let said = met(&next, stands, plausible(number));
            let mut reply = caller.tell(name, said, &format!("touch-{number}")).await;
            if kinds(&reply.warnings, &reply.warning_details).contains(&v1::WarningCode::ObjectMoved) {
                assert!(number >= 18, "{:?}", reply.warnings);
                found = Some(reply);
                break;
            }
            next = reply.candidates.remove(0);
        }
        let reply = found.expect("the motion is found within 27 attempts");
        let motion = reply.session.as_ref().unwrap().stats.as_ref().unwrap().motion.unwrap();
        assert_eq!(motion.followed, on_motion == v1::OnMotion::Follow);
        let shift = motion.translation_m.unwrap();
        assert!(distance_m([shift.x, shift.y, shift.z], by) < 0.008, "{shift:?}");
        let advice = reply.should_stop();
        assert_eq!(advice == v1::StopReason::Moved, on_motion == v1::OnMotion::Warn, "{advice:?}");
    }
}

#[tokio::test]
async fn a_motion_that_was_told_survives_a_restart() {
    let server = Server::start().await;
    let caller = server.grpc();
    explored(&caller, "ball").await;
    let next = caller.tell("ball", moved([0.0, 0.03, 0.0], 0.002), "moved").await.candidates.remove(0);
    let said = met(&next, [0.0, 0.03, 0.3], plausible(0));
    caller.tell("ball", said, "after").await;
    let before = (
        caller.log("ball").await,
        without_timing(caller.get("ball").await.unwrap()),
        caller.vertices("ball").await.0,
    );
    let server = server.restart().await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let after = (
            caller.log("ball").await,
            without_timing(caller.get("ball").await.unwrap()),
            caller.vertices("ball").await.0,
        );
        assert_eq!(after, before);
        // Asked again after the restart it is known still.
        let again = caller.report(report("ball", moved([0.0, 0.03, 0.0], 0.002), "moved")).await.unwrap();
        assert!(again.duplicate);
    }
}

#[tokio::test]
async fn a_motion_is_refused_before_anything_was_seen_and_with_numbers_that_are_none() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let early = caller.report(report(name, moved([0.0, 0.03, 0.0], 0.0), "early")).await;
        assert_eq!(early.unwrap_err().reason, "NO_VISUAL_PRIOR");
        let seen = crate::harness::prior(name);
        caller.add_prior(seen).await.unwrap();
        let negative = caller.report(report(name, moved([0.0, 0.03, 0.0], -0.1), "negative")).await;
        assert_eq!(negative.unwrap_err().fields, ["result.object_moved.std_m"]);
        let nowhere = v1::ObjectMoved::default();
        let nowhere =
            v1::ContactResult { outcome: Some(ContactOutcome::ObjectMoved(nowhere)), ..Default::default() };
        let nowhere = caller.report(report(name, nowhere, "nowhere")).await;
        assert_eq!(nowhere.unwrap_err().fields, ["result.object_moved.new_from_old"]);
        assert_eq!(caller.get(name).await.unwrap().revision, 2);
    }
}
