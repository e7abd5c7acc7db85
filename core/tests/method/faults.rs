//! What goes wrong in the field: a flat pad, torques that lie, a camera that is off, an object that moves.

use palpate_core::config::{Config, Method, Settings, Stages};
use palpate_core::evidence::{Evidence, Moved, TouchedPoint, VisualPrior};
use palpate_core::geometry::{Point, Pose, SurfaceIndex, Vector};
use palpate_core::reconstruction::{Reconstruction, StopReason};
use palpate_core::warning::WarningKind;

use crate::object::{Object, of};
use crate::robot::{Robot, contact_in_the_air, moved_along};

/// The method on a coarse mesh.
fn coarse() -> Settings {
    Settings { icosphere_subdivisions: 3, ..of(Method::Palpate) }
}

fn begin(settings: Settings) -> Robot {
    Robot::begin(Object::rotated_ellipsoid(), settings, Vector::zeros())
}

#[test]
fn a_flat_pad_told_by_its_centre_is_read_by_its_wrench() {
    let error_m = |touched| {
        let mut robot = begin(coarse());
        robot.pad = robot.pad.touching_with(touched);
        (0..24).for_each(|_| robot.touch_flat());
        (robot.error_m(), robot.touched_with())
    };
    let (open_m, how) = error_m(TouchedPoint::Open);
    assert_eq!(how, TouchedPoint::CentreOfPressure);
    let (centre_m, how) = error_m(TouchedPoint::PadCentre);
    assert_eq!(how, TouchedPoint::PadCentre);
    assert!(open_m < 0.7 * centre_m, "{open_m} {centre_m}");
}

#[test]
fn torques_that_contradict_the_touches_are_no_longer_believed() {
    let mut robot = begin(coarse());
    for number in 0..24 {
        let turn = 2.4 * f64::from(number);
        robot.touch_with_torque_at(Vector::new(turn.cos(), turn.sin(), 0.0) * 0.008);
        if number == 0 {
            assert_eq!(
                robot.touched_with(),
                TouchedPoint::CentreOfPressure,
                "until something speaks against it"
            );
        }
    }
    assert_eq!(robot.touched_with(), TouchedPoint::PadCentre);
    assert!(robot.error_m() < 1e-3, "{}", robot.error_m());
}

#[test]
fn a_view_that_is_off_is_found_out_by_the_touches() {
    let shift = Vector::new(0.005, -0.005, 0.0037);
    let explored = |offsets| {
        let settings = Settings { stages: Stages { offsets, ..Stages::default() }, ..coarse() };
        let mut robot = Robot::begin(Object::rotated_ellipsoid(), settings, shift);
        (0..30).for_each(|_| robot.touch());
        robot
    };
    let (with, without) = (explored(true), explored(false));
    let found = with.state.findings().offsets;
    assert_eq!((found.len(), found[0].at), (1, 0));
    assert!((found[0].translation_m + shift).norm() < 0.003, "{:?}", found[0]);
    assert!(with.error_m() < 0.7 * without.error_m(), "{} {}", with.error_m(), without.error_m());
    assert_eq!(without.state.findings().offsets, []);
}

#[test]
fn pixels_that_fly_behind_an_edge_are_doubted_and_the_surface_does_not_follow_them() {
    let object = Object::rotated_ellipsoid();
    let seen = object.prior();
    let camera = *seen.viewpoint().unwrap();
    // Every twentieth point, 8 to 20 mm behind the surface as the camera sees it.
    let fly = |(number, point): (usize, &Point)| match number % 20 {
        0 => point + (point - camera).normalize() * (0.008 + 0.004 * ((number / 20) % 4) as f64),
        _ => *point,
    };
    let points: Vec<Point> = seen.points().iter().enumerate().map(fly).collect();
    let flying = points.len().div_ceil(20);
    let seen = VisualPrior::new(points, None, Some(camera)).unwrap();
    let mut robot = Robot::shown(object, coarse(), seen);
    (0..16).for_each(|_| robot.touch());
    let doubted = robot.state.findings().doubted_points;
    assert!((flying / 2..=flying).contains(&doubted), "{doubted} of {flying}");
    assert!(robot.error_m() < 1.2e-3, "{}", robot.error_m());
}

#[test]
fn an_object_that_was_pushed_is_followed() {
    let push = Vector::new(0.012, 0.016, 0.0);
    let mut robot = begin(coarse());
    (0..18).for_each(|_| robot.touch());
    assert_eq!(robot.state.findings().motion, None);
    robot.object = robot.object.moved(&Pose::from_parts(push.into(), nalgebra::one()));
    (18..45).for_each(|_| robot.touch());
    let found = robot.state.findings().motion;
    let found = found.unwrap();
    assert!(found.is_followed && (17..=27).contains(&found.since), "{found:?}");
    assert!((found.translation_m - push).norm() < 0.006, "{found:?}");
    assert!(robot.error_m() < 1.5e-3, "{}", robot.error_m());
}

#[test]
fn a_motion_that_is_not_to_be_followed_is_told_with_the_advice_to_stop() {
    let push = Vector::new(0.012, 0.016, 0.0);
    let mut robot = begin(Settings { follows_motion: false, ..coarse() });
    (0..18).for_each(|_| robot.touch());
    robot.object = robot.object.moved(&Pose::from_parts(push.into(), nalgebra::one()));
    let before = robot.warned.len();
    (18..45).for_each(|_| {
        if robot.state.stop_reason() != Some(StopReason::Moved) {
            robot.touch();
        }
    });
    assert_eq!(robot.state.stop_reason(), Some(StopReason::Moved));
    let found = robot.state.findings().motion.unwrap();
    assert!(!found.is_followed && found.is_found && (17..=27).contains(&found.since), "{found:?}");
    assert!((found.translation_m - push).norm() < 0.008, "{found:?}");
    assert!(robot.warned[before..].contains(&WarningKind::ObjectMoved), "{:?}", robot.warned);
}

#[test]
fn a_motion_that_is_told_takes_all_earlier_evidence_along() {
    let motion = Pose::new(Vector::new(0.03, -0.02, 0.01), Vector::new(0.1, 0.2, -0.4));
    // An offset of the view is estimated a little better with each fit, and telling of a motion is one more; and of two
    // starts that are nearly as good, the one or the other may have been kept.
    let stages = Stages { offsets: false, extent: false, ..Stages::default() };
    let settings = || Settings { stages, ..coarse() };
    let mut told = begin(settings());
    (0..15).for_each(|_| told.touch());
    let (attempts, before_m) = (told.state.stats().attempts, told.error_m());
    told.tell(Evidence::Moved(Moved::new(motion, 0.0).unwrap()));
    assert_eq!(told.state.stats().attempts, attempts);
    let found = told.state.findings().motion.unwrap();
    assert_eq!((found.since, found.is_followed), (16, true));
    told.object = told.object.moved(&motion);
    assert!(told.error_m() < 1.2 * before_m, "{before_m} {}", told.error_m());
    // The same evidence, told in the new place from the start.
    let mut there = Reconstruction::new(Config::new(settings()).unwrap());
    for evidence in &told.log[..16] {
        there = there.absorb(&moved_along(evidence, &motion)).unwrap().0;
    }
    assert!(farthest_m(&told.state, &there) < 1e-4);
    (0..10).for_each(|_| told.touch());
    for evidence in &told.log[17..] {
        there = there.absorb(evidence).unwrap().0;
    }
    assert!(farthest_m(&told.state, &there) < 1e-4);
    assert!(told.error_m() < 1e-3, "{}", told.error_m());
}

/// The largest distance of a vertex of one surface from another, in metres.
fn farthest_m(one: &Reconstruction, other: &Reconstruction) -> f64 {
    let index = SurfaceIndex::new(&other.surface().unwrap().mesh).unwrap();
    let vertices = one.surface().unwrap().mesh.vertices;
    vertices.iter().map(|vertex| index.closest(vertex).distance_m).fold(0.0, f64::max)
}

#[test]
fn the_fold_of_a_log_with_every_fault_is_the_live_state_bit_for_bit() {
    let mut robot = Robot::begin(Object::rotated_ellipsoid(), coarse(), Vector::new(0.004, 0.0, -0.004));
    (0..12).for_each(|_| robot.touch_flat());
    robot.tell(contact_in_the_air(&robot.object, Vector::new(0.2, 0.5, -0.6), 0.012));
    (0..6).for_each(|_| robot.touch_flat());
    let push = Pose::translation(0.012, 0.016, 0.0);
    robot.object = robot.object.moved(&push);
    (0..18).for_each(|_| robot.touch_flat());
    let found = robot.state.findings().motion.unwrap();
    // The caller knows it better; what comes after a motion was found is taken for that motion.
    robot.tell(Evidence::Moved(Moved::new(push, 0.001).unwrap()));
    (0..4).for_each(|_| robot.touch_flat());
    let findings = robot.state.findings();
    let motion = findings.motion.unwrap();
    assert!(motion.since == found.since && (motion.translation_m - push.translation.vector).norm() < 0.003);
    assert!(findings.doubted.iter().any(|doubt| doubt.at == 13), "{findings:?}");
    assert!(robot.error_m() < 1.5e-3, "{}", robot.error_m());
    let folded = robot.folded();
    assert_eq!(folded.digest(), robot.state.digest());
    assert_eq!(folded.surface(), robot.state.surface());
    assert_eq!(folded.findings(), findings);
}
