//! Mistakes of callers, and the field that each refusal names.

use std::sync::Arc;

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

fn report(outcome: v1::contact_result::Outcome) -> Result<palpate_core::evidence::Attempt, Error> {
    let definition = new_session(v1::SessionConfig::default()).unwrap();
    let result = v1::ContactResult { outcome: Some(outcome), ..v1::ContactResult::default() };
    attempt(&result, &definition, 3, &Limits::default())
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

#[test]
fn what_this_version_lacks_is_said_and_not_ignored() {
    let config = v1::SessionConfig { sensors: vec![v1::Sensor::default(); 2], ..Default::default() };
    assert_eq!(new_session(config).unwrap_err().reason(), "UNIMPLEMENTED");
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
        })
    };
    let definition = new_session(v1::SessionConfig::default()).unwrap();
    let result = |candidate_id| v1::ContactResult {
        candidate_id,
        outcome: Some(rejected()),
        ..v1::ContactResult::default()
    };
    let accepted = attempt(&result(id(3)), &definition, 3, &Limits::default()).unwrap();
    assert_eq!(accepted.target.map(|target| *target.point()), Some([0.1, 0.2, 0.3].into()));
    for id in [id(4), "417".to_owned()] {
        let refused = attempt(&result(id), &definition, 3, &Limits::default());
        assert_names(refused, "result.candidate_id", "FIELD_INVALID");
    }
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
    assert_eq!((read.evidence.points().len(), read.finite, read.non_finite), (4, 5, 0));

    let coarse = v1::VisualPrior { voxel_m: Some(0.5), ..prior(&square) };
    assert_names(visual_prior("prior", &coarse), "prior.points", "FIELD_INVALID");
    let mut bad = square;
    bad[4][1] = f32::NAN;
    let read = visual_prior("prior", &prior(&bad)).unwrap();
    assert_eq!((read.finite, read.non_finite), (4, 1));
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
    assert_eq!(visual_prior("prior", &depth).unwrap_err().reason(), "UNIMPLEMENTED");
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
