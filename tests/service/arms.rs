//! Hands with several pads, a table that is declared once, and what an arm refuses to do.

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;

use crate::harness::{Caller, Server, Transport, creation, prior, question, report, result, touch};

const UPRIGHT: v1::Quaternion = v1::Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };

fn sensor(id: &str, position: [f64; 3], orientation: v1::Quaternion) -> v1::Sensor {
    let [x, y, z] = position;
    let pose = v1::Pose { position: Some(v1::Vector3 { x, y, z }), orientation: Some(orientation) };
    v1::Sensor {
        id: id.into(),
        tool_from_sensor: Some(pose),
        pad_half_side_m: 0.009,
        ..v1::Sensor::default()
    }
}

/// One pad at the tool's end, looking along its z axis, and one at its side, looking along its x axis.
fn end_and_side() -> Vec<v1::Sensor> {
    let quarter = std::f64::consts::FRAC_1_SQRT_2;
    let along_x = v1::Quaternion { x: 0.0, y: quarter, z: 0.0, w: quarter };
    vec![sensor("end", [0.0, 0.0, 0.02], UPRIGHT), sensor("side", [0.01, 0.0, 0.0], along_x)]
}

async fn begin_with(caller: &Caller, session_id: &str, config: v1::SessionConfig) -> v1::Candidate {
    caller.create(v1::CreateSessionRequest { config: Some(config), ..creation(session_id) }).await.unwrap();
    caller.add_prior(prior(session_id)).await.unwrap().candidates.remove(0)
}

fn rotated(q: &v1::Quaternion, [x, y, z]: [f64; 3]) -> [f64; 3] {
    // v + 2 w (q x v) + 2 q x (q x v)
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let axis = [q.x, q.y, q.z];
    let once = cross(axis, [x, y, z]);
    let twice = cross(axis, once);
    [0, 1, 2].map(|i| [x, y, z][i] + 2.0 * (q.w * once[i] + twice[i]))
}

/// Where the chosen pad of a candidate is, and where it looks, when the tool is as it says.
fn pad_of(candidate: &v1::Candidate, sensors: &[v1::Sensor]) -> ([f64; 3], [f64; 3]) {
    let sensor = sensors.iter().find(|sensor| sensor.id == candidate.sensor_id).unwrap();
    let tool_from_sensor = sensor.tool_from_sensor.unwrap();
    let (tool, turn) = (candidate.tool_pose.unwrap(), candidate.tool_pose.unwrap().orientation.unwrap());
    let offset = tool_from_sensor.position.unwrap();
    let (at, moved) = (tool.position.unwrap(), rotated(&turn, [offset.x, offset.y, offset.z]));
    let looks = rotated(&turn, rotated(&tool_from_sensor.orientation.unwrap(), [0.0, 0.0, 1.0]));
    ([at.x + moved[0], at.y + moved[1], at.z + moved[2]], looks)
}

#[tokio::test]
async fn each_candidate_is_touched_with_the_pad_that_suits_its_normal() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let strategy = v1::Strategy::Random.into();
        let config = v1::SessionConfig { sensors: end_and_side(), strategy, ..Default::default() };
        begin_with(&caller, name, config).await;
        let proposal = caller.propose(question(name, 64)).await.unwrap();
        let mut chosen = [0, 0];
        for candidate in &proposal.candidates {
            let (start, normal) = (candidate.probe_start.unwrap(), candidate.normal.unwrap());
            let (at, looks) = pad_of(candidate, &end_and_side());
            for (got, wanted) in at.iter().zip([start.x, start.y, start.z]) {
                assert!((got - wanted).abs() < 1e-9);
            }
            for (got, wanted) in looks.iter().zip([normal.x, normal.y, normal.z]) {
                assert!((got + wanted).abs() < 1e-6);
            }
            // With the tool hanging, its end looks down and its side about.
            let expected = if normal.z > 0.5_f64.sqrt() { "end" } else { "side" };
            if (normal.z - 0.5_f64.sqrt()).abs() > 1e-6 {
                assert_eq!(candidate.sensor_id, expected, "{normal:?}");
            }
            chosen[usize::from(candidate.sensor_id == "side")] += 1;
        }
        assert!(chosen[0] > 3 && chosen[1] > 3, "{chosen:?}");
        // With the tool lying along x, its end looks that way.
        let quarter = std::f64::consts::FRAC_1_SQRT_2;
        let lying = v1::Quaternion { x: 0.0, y: quarter, z: 0.0, w: quarter };
        let tool_pose = Some(v1::Pose {
            position: Some(v1::Vector3 { x: -0.3, y: 0.0, z: 0.3 }),
            orientation: Some(lying),
        });
        let robot = Some(v1::RobotContext { tool_pose, ..Default::default() });
        let lying = v1::ProposeContactsRequest { robot, ..question(name, 64) };
        for candidate in caller.propose(lying).await.unwrap().candidates {
            let normal = candidate.normal.unwrap();
            // Of -x for the end and z for the side, the nearer one.
            if (normal.x.abs() - normal.z.abs()).abs() > 1e-6 {
                let end = -normal.x > normal.z;
                assert_eq!(candidate.sensor_id, if end { "end" } else { "side" }, "{normal:?}");
            }
        }
    }
}

#[tokio::test]
async fn two_fingers_that_close_at_once_are_one_attempt_with_two_contacts() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let sensors = vec![sensor("left", [0.0; 3], UPRIGHT), sensor("right", [0.0, 0.05, 0.0], UPRIGHT)];
        let config = v1::SessionConfig { sensors, ..Default::default() };
        let next = begin_with(&caller, name, config).await;
        assert_eq!(next.sensor_id, "left", "of equal pads the first");
        let Some(ContactOutcome::Contact(aimed)) = touch(&next, 0.001).outcome else { panic!("a contact") };
        // The other one meets the ball on its far side.
        let at = aimed.sensor_pose.unwrap().position.unwrap();
        let across = v1::Vector3 { x: -at.x, y: -at.y, z: 0.6 - at.z };
        let facing = v1::Quaternion { x: 1.0, y: 0.0, z: 0.0, w: 0.0 };
        let other = v1::Contact {
            sensor_pose: Some(v1::Pose { position: Some(across), orientation: Some(facing) }),
            sensor_id: "right".into(),
            swept_from: None,
            uncertainty: Some(0.15),
            ..aimed.clone()
        };
        let aimed = v1::Contact { sensor_id: "left".into(), ..aimed };
        let both = |contacts| result(&next, ContactOutcome::Contacts(v1::Contacts { contacts }));
        let twice = report(name, both(vec![aimed.clone(), aimed.clone()]), "twice");
        let refused = caller.report(twice).await.unwrap_err();
        assert_eq!(refused.fields, ["result.contacts.contacts[1].sensor_id"]);

        let request = report(name, both(vec![aimed.clone(), other]), "both");
        let reply = caller.report(request.clone()).await.unwrap();
        let stats = reply.session.as_ref().unwrap().stats.clone().unwrap();
        assert_eq!((reply.seq, stats.attempts, stats.contacts, stats.failures), (3, 1, 1, 0));
        for (touched, centre) in reply.touched_points.iter().zip([at, across]) {
            let apart = (touched.x - centre.x).hypot(touched.y - centre.y).hypot(touched.z - centre.z);
            assert!(apart < 0.013, "on the pad: {touched:?} {centre:?}");
        }
        assert_eq!(reply.touched_points.len(), 2);
        assert_eq!(reply.touched_point(), v1::TouchedPoint::CenterOfPressure);
        assert!(reply.contact_uncertainty > 0.0 && reply.contact_uncertainty != 0.15, "that of the first");
        assert_eq!(
            caller.report(request).await.unwrap(),
            v1::ReportContactResponse { duplicate: true, ..reply.clone() }
        );
        let log = caller.log(name).await;
        let Some(v1::event::Kind::ContactResult(logged)) = &log[2].kind else { panic!("{:?}", log[2]) };
        assert!(matches!(&logged.outcome, Some(ContactOutcome::Contacts(both)) if both.contacts.len() == 2));
    }
    // The log gives the same again.
    let before = server.grpc().log("grpc").await;
    let server = server.restart().await;
    let caller = server.grpc();
    assert_eq!(caller.log("grpc").await, before);
    assert_eq!(caller.propose(question("grpc", 1)).await.unwrap().revision, 3);
}

#[tokio::test]
async fn a_support_keeps_approaches_and_pads_above_it() {
    let server = Server::start().await;
    let plane = v1::HalfSpace { normal: Some(v1::Vector3 { x: 0.0, y: 0.0, z: 1.0 }), offset_m: 0.29 };
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let supported = format!("{name}-support");
        let config = v1::SessionConfig { support: Some(plane), ..Default::default() };
        begin_with(&caller, &supported, config).await;
        assert_eq!(caller.get(&supported).await.unwrap().config.unwrap().support, Some(plane));
        let proposal = caller.propose(question(&supported, 64)).await.unwrap();
        let excluded = proposal.excluded.unwrap();
        assert!(excluded.keep_out > 100 && proposal.warnings.is_empty(), "{:?}", proposal.warnings);
        for candidate in &proposal.candidates {
            let (from, to) = (candidate.probe_start.unwrap(), candidate.probe_end.unwrap());
            let rim_m = 0.009 * (1.0 - candidate.normal.unwrap().z.powi(2)).max(0.0).sqrt();
            assert!(from.z.min(to.z) - rim_m >= 0.29, "{candidate:?}");
        }
    }
}

fn distance_m(a: &v1::Candidate, b: &v1::Candidate) -> f64 {
    let (a, b) = (a.point.unwrap(), b.point.unwrap());
    (a.x - b.x).hypot(a.y - b.y).hypot(a.z - b.z)
}

#[tokio::test]
async fn a_rejected_place_is_left_alone_for_as_long_as_its_reason_holds() {
    use v1::RejectReason::{Collision, NoIk, Operator, SafetyStop, Timeout, Unspecified};
    let server = Server::start().await;
    // Radius in metres, and after how many further attempts it is free again: within five, or not.
    let reasons = [
        (Unspecified, 0.010, true),
        (NoIk, 0.015, false),
        (Collision, 0.025, false),
        (SafetyStop, 0.025, false),
        (Timeout, 0.010, true),
        (Operator, 0.030, false),
    ];
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        for (reason, radius_m, is_forgotten) in reasons {
            for strategy in [v1::Strategy::Proactive, v1::Strategy::MinUncertainty] {
                let name = format!("{}-{}-{}", transport.name(), reason as i32, strategy as i32);
                let config = v1::SessionConfig { strategy: strategy.into(), ..Default::default() };
                let first = begin_with(&caller, &name, config).await;
                let said = v1::Rejected { reason: reason.into(), detail: String::new() };
                let rejected = result(&first, ContactOutcome::Rejected(said));
                let reply = caller.report(report(&name, rejected, "rejected")).await.unwrap();
                let mut next = reply.candidates[0].clone();
                assert!(distance_m(&first, &next) >= radius_m, "{name}: the next one comes at once");
                for step in 0..5 {
                    let excluded = caller.propose(question(&name, 1)).await.unwrap().excluded.unwrap();
                    assert_eq!(excluded.unreachable > 0, !is_forgotten || step < 3, "{name} {step}");
                    let said = report(&name, touch(&next, 0.0), &format!("touch-{step}"));
                    next = caller.report(said).await.unwrap().candidates.remove(0);
                }
            }
        }
    }
}
