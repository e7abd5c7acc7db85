//! Contacts with the faults that sensors, frames and programs have: each is named with its numbers, and refused by none.

use palpate_proto::v1;
use palpate_proto::v1::WarningCode;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;

use crate::harness::ball::{
    CENTRE, contact_at, directions, distance_m, dot, kinds, met, plausible, pushed, rotated, vector,
    with_contact, xyz,
};
use crate::harness::{Server, Transport, question, touch};

fn said(reply: &v1::ReportContactResponse) -> Vec<WarningCode> {
    kinds(&reply.warnings, &reply.warning_details)
}

fn zero() -> v1::Wrench {
    pushed([0.0; 3], [0.0; 3])
}

/// A wrench, what it showed at rest, and the warning that it asks for with its numbers.
type Fault = (v1::Wrench, Option<v1::Wrench>, WarningCode, Vec<(&'static str, f64)>);

fn faults() -> Vec<Fault> {
    let middle = [0.0; 3];
    let wrong_units =
        v1::Wrench { torque: Some(vector([40.0, 0.0, 0.0])), ..pushed([0.0, 0.0, -5.0], middle) };
    let at_rest = pushed([0.5, 0.0, 0.0], middle);
    vec![
        (zero(), None, WarningCode::ZeroWrench, vec![]),
        (pushed([0.0, 0.0, 5.0], middle), None, WarningCode::PullingForce, vec![("force_z_n", 5.0)]),
        (pushed([0.0, 0.0, -0.1], middle), None, WarningCode::WeakContact, vec![("force_z_n", -0.1)]),
        (pushed([5.0, 0.0, -0.5], middle), None, WarningCode::WrenchFrame, vec![("angle_deg", 84.289)]),
        (wrong_units, None, WarningCode::TorqueTooLarge, vec![("torque_nm", 40.0)]),
        (
            pushed([0.0, 0.0, -5.0], [0.02, 0.0, 0.0]),
            None,
            WarningCode::TouchedByHousing,
            vec![("lever_m", 0.02)],
        ),
        (
            pushed([0.5, 0.0, -5.0], middle),
            Some(at_rest),
            WarningCode::TareDrift,
            vec![("force_n", 0.5), ("torque_nm", 0.0)],
        ),
    ]
}

#[tokio::test]
async fn each_fault_of_a_wrench_is_named_with_its_numbers_and_the_contact_counts() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let mut next = caller.begin_coarse(name, v1::SessionConfig::default()).await;
        let mut contacts = 0;
        for (number, (wrench, rest_wrench, kind, numbers)) in faults().into_iter().enumerate() {
            let sound = met(&next, CENTRE, wrench);
            contacts += u32::from(matches!(sound.outcome, Some(ContactOutcome::Contact(_))));
            let faulty = with_contact(sound, |contact| contact.rest_wrench = rest_wrench);
            let mut reply = caller.tell(name, faulty, &format!("fault-{number}")).await;
            assert_eq!(said(&reply), [kind], "{:?}", reply.warnings);
            let told = &reply.warning_details[0].parameters;
            assert_eq!(told.len(), numbers.len(), "{told:?}");
            for (parameter, value) in numbers {
                assert!((told[parameter] - value).abs() < 1e-3, "{kind:?} {told:?}");
            }
            next = reply.candidates.remove(0);
        }
        assert_eq!(caller.get(name).await.unwrap().stats.unwrap().contacts, contacts);
        assert_eq!(contacts as usize, faults().len());
    }
}

#[tokio::test]
async fn a_clean_exploration_is_warned_of_nothing() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let mut next = caller.begin_coarse(name, v1::SessionConfig::default()).await;
        for number in 0..14 {
            let mut reply =
                caller.tell(name, met(&next, CENTRE, plausible(number)), &format!("touch-{number}")).await;
            // A touch may come early while little is known: that is no fault of a sensor.
            let faults = said(&reply).into_iter().filter(|code| *code != WarningCode::EarlyContact);
            assert_eq!(faults.collect::<Vec<_>>(), [], "{:?}", reply.warnings);
            next = reply.candidates.remove(0);
        }
        let stats = caller.get(name).await.unwrap().stats.unwrap();
        assert_eq!((stats.doubted_seqs, stats.motion), (Vec::new(), None));
        assert!(stats.contacts >= 12, "or nothing could have drifted");
    }
}

#[tokio::test]
async fn a_quaternion_with_w_first_is_named() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.begin_coarse(name, v1::SessionConfig::default()).await;
        let w_first = |q: v1::Quaternion| v1::Quaternion { x: q.w, y: q.x, z: q.y, w: q.z };
        let off = |candidate: &v1::Candidate| {
            let sent = w_first(candidate.tool_pose.unwrap().orientation.unwrap());
            dot(rotated(&sent, [0.0, 0.0, 1.0]), xyz(candidate.normal.unwrap()))
        };
        let candidates = caller.propose(question(name, 32)).await.unwrap().candidates;
        let worst = candidates.iter().max_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
        assert!(off(worst) > 0.5, "the pad looks out of the object");
        let wrong = with_contact(touch(worst, 0.0), |contact| {
            let pose = contact.sensor_pose.as_mut().unwrap();
            pose.orientation = Some(w_first(pose.orientation.unwrap()));
        });
        let reply = caller.tell(name, wrong, "wrong").await;
        assert_eq!(said(&reply), [WarningCode::QuaternionOrder], "{:?}", reply.warnings);
        let expected_deg = 180.0 - off(worst).acos().to_degrees();
        let told_deg = reply.warning_details[0].parameters["angle_deg"];
        assert!((told_deg - expected_deg).abs() < 1e-6, "{told_deg} {expected_deg}");
        assert!(reply.warnings[0].contains("x, y, z, w"), "{:?}", reply.warnings);
    }
}

#[tokio::test]
async fn a_candidate_of_another_session_aims_at_nothing_and_the_contact_counts() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let foreign = caller.begin_coarse(&format!("{name}-other"), v1::SessionConfig::default()).await;
        caller.begin_coarse(name, v1::SessionConfig::default()).await;
        // So far from the candidate that it would be early for it.
        let reply = caller.tell(name, touch(&foreign, 0.025), "foreign").await;
        assert_eq!(said(&reply), [WarningCode::CandidateOfAnotherSession], "{:?}", reply.warnings);
        let stats = reply.session.unwrap().stats.unwrap();
        assert_eq!((stats.contacts, stats.early_contacts, stats.attempts), (1, 0, 1));
        let own = caller.tell(&format!("{name}-other"), touch(&foreign, 0.025), "own").await;
        assert_eq!(own.session.unwrap().stats.unwrap().early_contacts, 1);
    }
}

#[tokio::test]
async fn a_contact_far_from_everything_is_told_and_moves_nothing() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let mut next = caller.begin_coarse(name, v1::SessionConfig::default()).await;
        for (number, direction) in directions(16).into_iter().enumerate() {
            let said = contact_at(direction, 0.0, plausible(number));
            next = caller.tell(name, said, &format!("touch-{number}")).await.candidates.remove(0);
        }
        let before = caller.vertices(name).await.1;
        let scaled = |scale: f64| {
            with_contact(met(&next, CENTRE, plausible(0)), |contact| {
                let position = contact.sensor_pose.as_mut().unwrap().position.as_mut().unwrap();
                *position = vector(xyz(*position).map(|x| scale * x));
            })
        };
        let kilometre = contact_at([0.6, 0.0, 0.8], 1000.0, plausible(1));
        let both = vec![WarningCode::FarContact, WarningCode::EarlyContact];
        for (request_id, far, expected) in [
            ("kilometre", kilometre, vec![WarningCode::FarContact]),
            ("outwards", touch(&next, 1000.0), both.clone()),
            ("millimetres", scaled(1000.0), both),
        ] {
            let Some(ContactOutcome::Contact(contact)) = &far.outcome else { panic!("{far:?}") };
            let distance_m = distance_m(xyz(contact.sensor_pose.unwrap().position.unwrap()), CENTRE);
            let reply = caller.tell(name, far, request_id).await;
            assert_eq!(said(&reply), expected, "{:?}", reply.warnings);
            let told_m = reply.warning_details[0].parameters["distance_m"];
            assert!((told_m - distance_m).abs() < 0.1, "{told_m} {distance_m}");
            assert!(reply.max_vertex_move_m < 1e-4, "{request_id}: {}", reply.max_vertex_move_m);
        }
        let after = caller.vertices(name).await.1;
        let moved_m = before.iter().zip(&after).map(|(a, b)| distance_m(*a, *b)).fold(0.0, f64::max);
        assert!(moved_m < 2e-4, "{moved_m}");
        let stats = caller.get(name).await.unwrap().stats.unwrap();
        assert!(stats.doubted_seqs.is_empty() && stats.motion.is_none(), "{stats:?}");
    }
}

#[tokio::test]
async fn a_wrench_that_twelve_contacts_share_is_a_sensor_that_has_drifted() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.begin_coarse(name, v1::SessionConfig::default()).await;
        for (number, direction) in directions(12).into_iter().enumerate() {
            let mut wrench = plausible(number);
            wrench.force.as_mut().unwrap().x += 1.5;
            let reply =
                caller.tell(name, contact_at(direction, 0.0, wrench), &format!("touch-{number}")).await;
            let expected = if number == 11 { vec![WarningCode::TareDrift] } else { Vec::new() };
            assert_eq!(said(&reply), expected, "{number}: {:?}", reply.warnings);
            if number == 11 {
                let told_n = reply.warning_details[0].parameters["force_n"];
                assert!((told_n - 1.5).abs() < 0.1, "{told_n}");
            }
        }
    }
}
