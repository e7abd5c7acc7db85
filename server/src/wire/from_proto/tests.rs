//! Mistakes of callers, and the field that each refusal names.

use std::sync::Arc;

use palpate_core::evidence::Evidence;
use palpate_core::warning::WarningKind;
use palpate_proto::v1;

use super::*;
use crate::limits::Limits;
use crate::session::{Definition, Snapshot};

fn new_session(config: v1::SessionConfig) -> Result<Definition, Error> {
    let request = v1::CreateSessionRequest {
        session_id: "mug".into(),
        config: Some(config),
        ..v1::CreateSessionRequest::default()
    };
    definition(&request, 1, &Limits::default())
}

fn origin() -> v1::Vector3 {
    v1::Vector3 { x: 0.0, y: 0.0, z: 0.0 }
}

fn pose(w: f64) -> v1::Pose {
    let orientation = v1::Quaternion { x: 0.0, y: 0.0, z: 0.0, w };
    v1::Pose { position: Some(origin()), orientation: Some(orientation) }
}

fn contact() -> v1::Contact {
    let wrench = v1::Wrench { force: Some(origin()), torque: Some(origin()) };
    v1::Contact { sensor_pose: Some(pose(1.0)), wrench: Some(wrench), ..v1::Contact::default() }
}

/// What is reported of an attempt, on a session at revision 3.
fn attempt(
    result: &v1::ContactResult,
    definition: &Definition,
) -> Result<palpate_core::evidence::Attempt, Error> {
    match reported(result, definition, 3, &Limits::default())?.evidence {
        Evidence::Attempt(attempt) => Ok(attempt),
        other => panic!("an attempt, and not {other:?}"),
    }
}

fn report(outcome: v1::contact_result::Outcome) -> Result<palpate_core::evidence::Attempt, Error> {
    let definition = new_session(v1::SessionConfig::default()).unwrap();
    let result = v1::ContactResult { outcome: Some(outcome), ..v1::ContactResult::default() };
    attempt(&result, &definition)
}

fn report_contact(contact: v1::Contact) -> Result<palpate_core::evidence::Attempt, Error> {
    report(v1::contact_result::Outcome::Contact(contact))
}

#[track_caller]
fn assert_names<T: std::fmt::Debug>(outcome: Result<T, Error>, field: &str, reason: &str) {
    let error = outcome.unwrap_err();
    let named: Vec<&str> = error.fields().iter().map(|violation| violation.field.as_str()).collect();
    assert_eq!((named, error.reason()), (vec![field], reason), "{error}");
}

#[test]
fn an_empty_configuration_is_the_default_and_survives_being_written_out() {
    let definition = new_session(v1::SessionConfig::default()).unwrap();
    assert_eq!(definition.config, palpate_core::config::Config::default());
    assert_eq!(definition.frame_id, "base");
    let written = crate::wire::to_proto::session_config(&definition);
    assert_eq!(new_session(written).unwrap(), definition);
}

#[test]
fn what_is_a_methods_own_is_filled_in_and_survives_being_written_out() {
    let gpis = v1::SessionConfig { method: v1::Method::Gpis.into(), ..Default::default() };
    let askew = v1::SessionConfig {
        method: v1::Method::Paper.into(),
        template_axes: v1::TemplateAxes::Free.into(),
        ..Default::default()
    };
    for config in [gpis.clone(), askew.clone()] {
        let definition = new_session(config).unwrap();
        let written = crate::wire::to_proto::session_config(&definition);
        assert_eq!(new_session(written).unwrap(), definition);
    }
    let own = new_session(gpis).unwrap().config;
    assert_eq!(own.strategy, palpate_core::config::Strategy::MinUncertainty);
    assert_eq!((own.stop.max_attempts, own.stop.mean_uncertainty_below), (Some(50), None));
    assert_eq!(new_session(askew).unwrap().config.template_axes, palpate_core::config::Axes::Free);
}

#[test]
fn a_bad_configuration_names_its_field() {
    let axes = v1::SessionConfig { template_axes: v1::TemplateAxes::Free.into(), ..Default::default() };
    assert_names(new_session(axes), "config.template_axes", "FIELD_INVALID");
    let axes = v1::SessionConfig { template_axes: 9, ..Default::default() };
    assert_names(new_session(axes), "config.template_axes", "FIELD_INVALID");
    let config = v1::SessionConfig { confident_max: Some(f64::NAN), ..Default::default() };
    assert_names(new_session(config), "config.confident_max", "NON_FINITE");
    let sizes = v1::PlausibleSize { min_m: Some(f64::NAN), ..Default::default() };
    let config = v1::SessionConfig { plausible_size: Some(sizes), ..Default::default() };
    assert_names(new_session(config), "config.plausible_size.min_m", "NON_FINITE");
    let config = v1::SessionConfig { method: 77, ..Default::default() };
    assert_names(new_session(config), "config.method", "FIELD_INVALID");
    let symmetry = v1::Symmetry::Mirror.into();
    assert_names(
        new_session(v1::SessionConfig { method: v1::Method::Paper.into(), symmetry, ..Default::default() }),
        "config.symmetry",
        "FIELD_INVALID",
    );
    let (method, strategy) = (v1::Method::Paper.into(), v1::Strategy::ExpectedGain.into());
    let config = v1::SessionConfig { method, strategy, ..Default::default() };
    assert_names(new_session(config), "config.strategy", "FIELD_INVALID");
    let strategy = v1::Strategy::Random.into();
    let config = v1::SessionConfig { strategy, alpha_travel: Some(0.5), ..Default::default() };
    assert_names(new_session(config), "config.alpha_travel", "FIELD_INVALID");
    let sensor = v1::Sensor { id: "tip".into(), tool_from_sensor: Some(pose(0.5)), ..Default::default() };
    let config = v1::SessionConfig { sensors: vec![sensor], ..Default::default() };
    assert_names(new_session(config), "config.sensors[0].tool_from_sensor.orientation", "FIELD_INVALID");
}

fn pads(ids: &[&str]) -> v1::SessionConfig {
    let pad = |id: &&str| v1::Sensor {
        id: (*id).to_owned(),
        tool_from_sensor: Some(pose(1.0)),
        ..v1::Sensor::default()
    };
    v1::SessionConfig { sensors: ids.iter().map(pad).collect(), ..Default::default() }
}

#[test]
fn up_to_eight_pads_have_names_of_their_own() {
    let eight = ["a", "b", "c", "d", "e", "f", "g", "h"];
    let definition = new_session(pads(&eight)).unwrap();
    let written = crate::wire::to_proto::session_config(&definition);
    assert_eq!(new_session(written).unwrap(), definition);
    let nine = [&eight[..], &["i"]].concat();
    assert_names(new_session(pads(&nine)), "config.sensors", "FIELD_INVALID");
    assert_names(new_session(pads(&["a", "b", "a"])), "config.sensors[2].id", "FIELD_INVALID");
    assert_names(new_session(pads(&["a", ""])), "config.sensors[1].id", "FIELD_INVALID");
}

#[test]
fn a_support_is_a_plane_with_a_unit_normal_and_survives_being_written_out() {
    let support = |z, offset_m| v1::SessionConfig {
        support: Some(v1::HalfSpace { normal: Some(v1::Vector3 { z, ..origin() }), offset_m }),
        ..Default::default()
    };
    let definition = new_session(support(1.0, 0.06)).unwrap();
    let written = crate::wire::to_proto::session_config(&definition);
    assert_eq!(written.support, support(1.0, 0.06).support);
    assert_eq!(new_session(written).unwrap(), definition);
    assert_names(new_session(support(2.0, 0.06)), "config.support.normal", "FIELD_INVALID");
    assert_names(new_session(support(1.0, f64::NAN)), "config.support.offset_m", "NON_FINITE");
    let nowhere = v1::SessionConfig { support: Some(v1::HalfSpace::default()), ..Default::default() };
    assert_names(new_session(nowhere), "config.support.normal", "FIELD_INVALID");
}

#[test]
fn several_contacts_name_a_pad_each_and_are_refused_one_by_one() {
    let definition = new_session(pads(&["left", "right"])).unwrap();
    let of = |id: &str| v1::Contact { sensor_id: id.to_owned(), ..contact() };
    let report = |contacts: Vec<v1::Contact>| {
        let outcome = Some(v1::contact_result::Outcome::Contacts(v1::Contacts { contacts }));
        let result = v1::ContactResult { outcome, ..v1::ContactResult::default() };
        attempt(&result, &definition)
    };
    assert_eq!(report(vec![of("left"), of("right")]).unwrap().contacts().count(), 2);
    assert_eq!(report(vec![of("right")]).unwrap().contacts().count(), 1);
    let list = "result.contacts.contacts";
    assert_names(report(Vec::new()), list, "FIELD_INVALID");
    assert_names(report(vec![of("left"); 9]), list, "FIELD_INVALID");
    let twice = report(vec![of("left"), of("left")]);
    assert_names(twice, &format!("{list}[1].sensor_id"), "FIELD_INVALID");
    assert_names(report(vec![of("left"), of("")]), &format!("{list}[1].sensor_id"), "FIELD_INVALID");
    let nowhere = v1::Contact { sensor_pose: None, ..of("right") };
    let refused = report(vec![of("left"), nowhere]);
    assert_names(refused, &format!("{list}[1].sensor_pose"), "FIELD_INVALID");
}

#[test]
fn a_lease_has_a_length_and_is_for_a_robot_with_a_name() {
    let limits = Limits::default();
    let ask = |seconds, nanos, name: &str| {
        let robot = v1::RobotContext { robot_id: name.to_owned(), ..Default::default() };
        let question = exploration_request("top_k", 1, "robot", Some(&robot), &limits).unwrap();
        lease_duration("lease", palpate_proto::Duration { seconds, nanos }, "robot", &question, &limits)
    };
    assert_eq!(ask(600, 0, "left"), Ok(std::time::Duration::from_secs(600)));
    for (seconds, nanos) in [(0, 0), (-1, 0), (600, 1), (i64::MAX, 0)] {
        assert_names(ask(seconds, nanos, "left"), "lease", "FIELD_INVALID");
    }
    assert_names(ask(5, 0, ""), "robot.robot_id", "FIELD_INVALID");
}

#[test]
fn session_ids_are_short_lower_case_names() {
    for good in ["mug", "a-1", "x".repeat(63).as_str()] {
        assert_eq!(check_session_id(good), Ok(()), "{good}");
    }
    for bad in ["ab", "Mug", "1st", "-ab", "a_b", "mug ", "möwe", "x".repeat(64).as_str()] {
        assert_names(check_session_id(bad), "session_id", "FIELD_INVALID");
    }
}

#[test]
fn quaternions_are_normalised_within_a_thousandth_and_refused_beyond() {
    let nearly = v1::Contact { sensor_pose: Some(pose(1.0009)), ..contact() };
    assert!(report_contact(nearly).is_ok());
    for length in [0.0, 0.998, 1.002] {
        let contact = v1::Contact { sensor_pose: Some(pose(length)), ..contact() };
        assert_names(report_contact(contact), "result.contact.sensor_pose.orientation", "FIELD_INVALID");
    }
    let contact = v1::Contact { sensor_pose: Some(pose(f64::INFINITY)), ..contact() };
    assert_names(report_contact(contact), "result.contact.sensor_pose.orientation", "NON_FINITE");
}

#[test]
fn missing_and_bad_parts_of_a_contact_are_named() {
    let without_pose = v1::Contact { sensor_pose: None, ..contact() };
    assert_names(report_contact(without_pose), "result.contact.sensor_pose", "FIELD_INVALID");
    let without_wrench = v1::Contact { wrench: None, ..contact() };
    assert_names(report_contact(without_wrench.clone()), "result.contact.wrench", "FIELD_INVALID");
    assert!(report_contact(v1::Contact { uncertainty: Some(0.1), ..without_wrench }).is_ok());
    let far = v1::Contact { swept_from: Some(v1::Vector3 { x: 2e4, ..origin() }), ..contact() };
    assert_names(report_contact(far), "result.contact.swept_from", "NON_FINITE");
    let unsure = v1::Contact { uncertainty: Some(1.5), ..contact() };
    assert_names(report_contact(unsure), "result.contact.uncertainty", "FIELD_INVALID");
    let elsewhere = v1::Contact { sensor_id: "left".into(), ..contact() };
    assert_names(report_contact(elsewhere), "result.contact.sensor_id", "FIELD_INVALID");
}

#[test]
fn only_a_candidate_can_be_rejected_and_only_one_that_was_proposed() {
    let rejected = || v1::contact_result::Outcome::Rejected(v1::Rejected::default());
    assert_names(report(rejected()), "result.candidate_id", "FIELD_INVALID");
    let normal = palpate_core::geometry::Vector::z();
    let target = palpate_core::evidence::Target::new([0.1, 0.2, 0.3].into(), normal).unwrap();
    let id = |revision| {
        crate::wire::candidate_id::encode(&crate::wire::candidate_id::CandidateId {
            revision,
            vertex: 5,
            target,
            session: None,
        })
    };
    let definition = new_session(v1::SessionConfig::default()).unwrap();
    let result = |candidate_id| v1::ContactResult {
        candidate_id,
        outcome: Some(rejected()),
        ..v1::ContactResult::default()
    };
    let accepted = attempt(&result(id(3)), &definition).unwrap();
    assert_eq!(accepted.target.map(|target| *target.point()), Some([0.1, 0.2, 0.3].into()));
    for id in [id(4), "417".to_owned()] {
        let refused = attempt(&result(id), &definition);
        assert_names(refused, "result.candidate_id", "FIELD_INVALID");
    }
}

#[test]
fn a_candidate_of_another_session_aims_at_nothing_and_is_warned_about() {
    let definition = new_session(v1::SessionConfig::default()).unwrap();
    let normal = palpate_core::geometry::Vector::z();
    let target = palpate_core::evidence::Target::new([0.1, 0.2, 0.3].into(), normal).unwrap();
    let id = |session| {
        let id = crate::wire::candidate_id::CandidateId { revision: 2, vertex: 5, target, session };
        crate::wire::candidate_id::encode(&id)
    };
    let of = |session| {
        let outcome = Some(v1::contact_result::Outcome::Contact(contact()));
        let result = v1::ContactResult { candidate_id: id(session), outcome, ..v1::ContactResult::default() };
        reported(&result, &definition, 3, &Limits::default()).unwrap()
    };
    for own in [None, Some(definition.tag())] {
        assert_eq!(of(own).warnings, []);
    }
    let strange = of(Some(!definition.tag()));
    assert_eq!(strange.warnings[0].kind, WarningKind::CandidateOfAnotherSession);
    let Evidence::Attempt(attempt) = strange.evidence else { panic!("an attempt") };
    assert_eq!(attempt.target, None);
}

#[test]
fn a_motion_of_the_object_is_no_attempt_and_its_numbers_are_checked() {
    let moved = |std_m, w| {
        let motion = v1::ObjectMoved { new_from_old: Some(pose(w)), std_m, detail: String::new() };
        let outcome = Some(v1::contact_result::Outcome::ObjectMoved(motion));
        let result = v1::ContactResult { outcome, ..v1::ContactResult::default() };
        let definition = new_session(v1::SessionConfig::default()).unwrap();
        reported(&result, &definition, 3, &Limits::default())
    };
    assert!(matches!(moved(0.001, 1.0).unwrap().evidence, Evidence::Moved(_)));
    assert_names(moved(-1.0, 1.0), "result.object_moved.std_m", "FIELD_INVALID");
    assert_names(moved(0.0, 2.0), "result.object_moved.new_from_old.orientation", "FIELD_INVALID");
}

#[test]
fn clouds_are_thinned_counted_and_checked_point_by_point() {
    let encode =
        |points: &[[f32; 3]]| points.iter().flatten().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let square = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.1, 0.1, 0.0], [0.1, 0.1, 0.0]];
    let prior = |points: &[[f32; 3]]| v1::VisualPrior {
        encoding: v1::PointEncoding::XyzF32Le.into(),
        points: encode(points).into(),
        ..v1::VisualPrior::default()
    };
    let read = visual_prior("prior", &prior(&square)).unwrap();
    assert_eq!((read.evidence.points().len(), read.finite, read.non_finite, read.repeated), (4, 4, 0, 1));
    assert_eq!(read.warnings, []);

    let coarse = v1::VisualPrior { voxel_m: Some(0.5), ..prior(&square) };
    assert_names(visual_prior("prior", &coarse), "prior.points", "FIELD_INVALID");
    let mut bad = square;
    bad[4][1] = f32::NAN;
    let read = visual_prior("prior", &prior(&bad)).unwrap();
    assert_eq!((read.finite, read.non_finite), (4, 1));
    assert_eq!(read.warnings[0].message, "1 of 5 points are NaN or infinite and were dropped");
    bad[3][1] = f32::INFINITY;
    let error = visual_prior("prior", &prior(&bad)).unwrap_err();
    assert!(error.to_string().contains("3 of 5 points") && error.reason() == "NON_FINITE", "{error}");
    bad[3][1] = -2e4;
    let error = visual_prior("prior", &prior(&bad)).unwrap_err();
    assert!(error.to_string().contains("point 3") && error.reason() == "NON_FINITE", "{error}");
    let truncated = v1::VisualPrior { points: vec![0; 25].into(), ..prior(&square) };
    assert_names(visual_prior("visual_prior", &truncated), "visual_prior.points", "FIELD_INVALID");
    let unspecified = v1::VisualPrior { encoding: 0, ..prior(&square) };
    assert_names(visual_prior("prior", &unspecified), "prior.encoding", "FIELD_INVALID");
    let depth = v1::VisualPrior { depth: Some(v1::DepthImage::default()), ..prior(&square) };
    assert_names(visual_prior("prior", &depth), "prior.depth", "FIELD_INVALID");
    let packed = v1::VisualPrior { packed: Some(v1::PackedPoints::default()), ..prior(&square) };
    assert_names(visual_prior("prior", &packed), "prior.packed", "FIELD_INVALID");
    let bare = v1::VisualPrior { encoding: v1::PointEncoding::Packed.into(), ..prior(&square) };
    assert_names(visual_prior("prior", &bare), "prior.packed", "FIELD_INVALID");

    let spiral = (0..96_u8).map(f32::from).map(|i| [0.01 * i.cos(), 0.01 * i.sin(), 0.001 * i]);
    let mut many: Vec<[f32; 3]> = spiral.collect();
    many.extend([[0.0; 3]; 5]);
    assert_eq!(visual_prior("prior", &prior(&many)).unwrap().warnings, [], "4 of 101 are hardly a habit");
    many.extend([[0.0; 3]; 2]);
    let read = visual_prior("prior", &prior(&many)).unwrap();
    assert_eq!((read.finite, read.repeated), (97, 6));
    assert!(read.warnings[0].message.starts_with("6 of 103 points repeat"), "{:?}", read.warnings);
}

fn depth_prior(image: v1::DepthImage) -> v1::VisualPrior {
    let encoding = v1::PointEncoding::DepthU16.into();
    v1::VisualPrior { encoding, points: vec![1; 18].into(), depth: Some(image), ..Default::default() }
}

#[test]
fn each_part_of_a_depth_image_is_refused_by_its_name() {
    let fine = || v1::DepthImage {
        width: 3,
        height: 3,
        fx: 600.0,
        fy: 600.0,
        cx: 1.0,
        cy: 1.0,
        depth_scale_m: 0.001,
        base_from_camera: Some(pose(1.0)),
        ..Default::default()
    };
    let read = visual_prior("prior", &depth_prior(fine())).unwrap();
    assert_eq!((read.finite, read.flying, read.evidence.viewpoint().copied()), (9, 0, Some([0.0; 3].into())));
    let elsewhere =
        v1::VisualPrior { viewpoint: Some(v1::Vector3 { x: 1.0, ..origin() }), ..depth_prior(fine()) };
    let read = visual_prior("prior", &elsewhere).unwrap();
    assert_eq!(read.evidence.viewpoint().copied(), Some([1.0, 0.0, 0.0].into()), "the caller knows better");
    type Spoil = fn(&mut v1::DepthImage);
    let cases: [(&str, &str, Spoil); 14] = [
        ("width", "FIELD_INVALID", |image| image.width = 0),
        ("height", "FIELD_INVALID", |image| image.height = 0),
        ("width", "FIELD_INVALID", |image| image.width = 1 << 30),
        ("fx", "FIELD_INVALID", |image| image.fx = 0.0),
        ("fy", "FIELD_INVALID", |image| image.fy = -600.0),
        ("cx", "FIELD_INVALID", |image| image.cx = 0.0),
        ("cx", "NON_FINITE", |image| image.cx = f64::NAN),
        ("cy", "FIELD_INVALID", |image| image.cy = 1e9),
        ("depth_scale_m", "FIELD_INVALID", |image| image.depth_scale_m = 0.0),
        ("depth_scale_m", "FIELD_INVALID", |image| image.depth_scale_m = 1000.0),
        ("base_from_camera", "FIELD_INVALID", |image| image.base_from_camera = None),
        ("mask_u8", "FIELD_INVALID", |image| image.mask_u8 = vec![1; 8].into()),
        ("min_depth_m", "FIELD_INVALID", |image| image.min_depth_m = -0.1),
        ("max_depth_m", "FIELD_INVALID", |image| (image.min_depth_m, image.max_depth_m) = (0.5, 0.4)),
    ];
    for (name, reason, spoil) in cases {
        let mut image = fine();
        spoil(&mut image);
        assert_names(visual_prior("prior", &depth_prior(image)), &format!("prior.depth.{name}"), reason);
    }
    let short = v1::VisualPrior { points: vec![1; 17].into(), ..depth_prior(fine()) };
    assert_names(visual_prior("prior", &short), "prior.points", "FIELD_INVALID");
    let bare = v1::VisualPrior { depth: None, ..depth_prior(fine()) };
    assert_names(visual_prior("prior", &bare), "prior.depth", "FIELD_INVALID");
}

#[test]
fn regions_to_keep_out_of_need_a_shape_and_a_unit_normal() {
    let ask = |shape| {
        let robot = v1::RobotContext { keep_out: vec![v1::KeepOut { shape }], ..Default::default() };
        exploration_request("top_k", 3, "robot", Some(&robot), &Limits::default())
    };
    assert_names(ask(None), "robot.keep_out[0].shape", "FIELD_INVALID");
    let half_space = |z| {
        let normal = Some(v1::Vector3 { z, ..origin() });
        Some(v1::keep_out::Shape::HalfSpace(v1::HalfSpace { normal, offset_m: 0.1 }))
    };
    assert!(ask(half_space(1.0)).is_ok());
    for length in [0.0, 2.0] {
        assert_names(ask(half_space(length)), "robot.keep_out[0].half_space.normal", "FIELD_INVALID");
    }
    let ball = v1::Ball { center: Some(origin()), radius_m: -1.0 };
    assert_names(
        ask(Some(v1::keep_out::Shape::Ball(ball))),
        "robot.keep_out[0].ball.radius_m",
        "FIELD_INVALID",
    );
    let greedy = exploration_request("propose", 65, "robot", None, &Limits::default());
    assert_names(greedy, "propose", "FIELD_INVALID");
}

#[test]
fn a_fresh_session_awaits_its_prior() {
    let definition = new_session(v1::SessionConfig::default()).unwrap();
    let session = crate::wire::to_proto::session(&Snapshot::created(Arc::new(definition)));
    assert_eq!(session.state(), v1::SessionState::AwaitingPrior);
    assert_eq!((session.revision, session.etag.as_str()), (1, "1-1"));
}

#[test]
fn what_an_earlier_version_took_for_a_name_is_replayed_and_refused_when_it_is_sent_again() {
    let hidden = || "mug\n\u{1b}[31m\u{202e}".to_owned();
    let request = v1::CreateSessionRequest {
        session_id: "mug".into(),
        experiment: hidden(),
        labels: [(hidden(), hidden())].into(),
        config: Some(v1::SessionConfig {
            sensors: vec![v1::Sensor {
                id: hidden(),
                tool_from_sensor: Some(pose(1.0)),
                ..v1::Sensor::default()
            }],
            ..v1::SessionConfig::default()
        }),
        ..v1::CreateSessionRequest::default()
    };
    let replayed = definition(&request, 1, &crate::wire::event::replay_limits()).unwrap();
    assert_eq!(replayed.experiment, hidden());
    let contact = v1::Contact { sensor_id: hidden(), ..contact() };
    let outcome = v1::contact_result::Outcome::Contact(contact);
    let result =
        v1::ContactResult { robot_id: hidden(), outcome: Some(outcome), ..v1::ContactResult::default() };
    assert!(reported(&result, &replayed, 3, &crate::wire::event::replay_limits()).is_ok());
    let refused = |outcome: Result<(), Error>| outcome.unwrap_err().fields()[0].field.clone();
    assert_eq!(refused(definition(&request, 1, &Limits::default()).map(drop)), "experiment");
    assert_eq!(refused(reported(&result, &replayed, 3, &Limits::default()).map(drop)), "result.robot_id");
}

#[test]
fn what_cannot_be_the_id_of_a_session_is_refused_before_it_is_looked_for() {
    for id in ["mug", "0197-a", "nobody", "Mug_1.x", &"x".repeat(63)] {
        assert_eq!(check_session_named("session_id", id), Ok(()), "{id}");
    }
    for id in ["", "a b", "a/../b", "mug\n", "müg", &"x".repeat(64), &"\u{202e}".repeat(5 << 20)] {
        let refused = check_session_named("open.session_id", id).unwrap_err();
        assert_eq!(refused.fields()[0].field, "open.session_id");
        assert!(refused.to_string().len() < 700, "{refused}");
    }
}
