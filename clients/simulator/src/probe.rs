//! A pad that is pushed along a line until it touches.
//!
//! ```text
//!   probe_start inside the object ... Early: touched before the window
//!   the object in the window ........ Hit
//!   the window free ................. Miss
//! ```

use nalgebra::{Rotation3, UnitQuaternion};
use palpate_core::geometry::{Direction, Point, Pose, RayHit, Vector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::body::Body;
use crate::random::{Stream, generator, standard_normal};

/// How hard the pad is pressed, in newtons.
pub const CONTACT_FORCE_N: f64 = 5.0;
/// Half the side of the square pad, in metres.
pub const PAD_HALF_SIDE_M: f64 = 0.009;
/// How far outside the object's bounding ball a guarded approach begins, in metres.
const CLEARANCE_M: f64 = 0.05;

/// What the probe measures, and how badly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeSettings {
    /// Standard deviation of the touched position along each axis, in metres.
    pub tactile_noise_m: f64,
    /// Whether the normal of the touched surface is measured.
    pub measures_normals: bool,
    /// Standard deviation of a measured normal about each of its two tangents, in radians.
    pub normal_noise_rad: f64,
}

/// Where to touch: from `start` to `end`, both in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Outside the estimated surface.
    pub start: Point,
    /// Inside the estimated surface.
    pub end: Point,
}

/// How an approach ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Touched within the window from start to end.
    Hit(Touch),
    /// Touched before the window: a failure of the estimate, but a measurement all the same.
    Early(Touch),
    /// Nothing between start and end.
    Miss,
}

/// A measured contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The pad's face: centred on the touched point, z out of the pad and into the object.
    pub base_from_sensor: Pose,
    /// What the object does to the pad, in the sensor's frame, in newtons: pressing gives z < 0.
    pub force_n: Vector,
    /// Likewise, in newton metres.
    pub torque_nm: Vector,
    /// Where the free motion that ended here began.
    pub swept_from: Point,
    /// Outward normal of the touched surface, if it is measured.
    pub normal: Option<Direction>,
}

/// A probe with its own streams of random numbers.
#[derive(Debug)]
pub struct Probe {
    settings: ProbeSettings,
    offset: ChaCha8Rng,
    tactile_noise: ChaCha8Rng,
    normal_noise: ChaCha8Rng,
}

impl Probe {
    /// A probe whose offsets and noise belong to `seed`.
    pub fn new(settings: ProbeSettings, seed: u64) -> Self {
        Self {
            settings,
            offset: generator(seed, Stream::Offset),
            tactile_noise: generator(seed, Stream::TactileNoise),
            normal_noise: generator(seed, Stream::NormalNoise),
        }
    }

    /// Pushes the pad from the approach's start to its end, or until it touches.
    pub fn touch(&mut self, body: &Body, approach: Approach) -> Outcome {
        let sweep = approach.end - approach.start;
        let Some(direction) = Direction::try_new(sweep, 0.0) else {
            return Outcome::Miss;
        };
        let surface = body.surface();
        // From an inside start the first hit would be a back face, so this is asked first.
        if surface.contains(&approach.start) {
            let outside = outside_start(body, &approach.start, &direction);
            let reach = (approach.start - outside).norm();
            return match surface.first_hit(&outside, &direction, reach) {
                Some(hit) => Outcome::Early(self.measure(body, &direction, &hit, outside)),
                None => Outcome::Miss,
            };
        }
        match surface.first_hit(&approach.start, &direction, sweep.norm()) {
            Some(hit) => Outcome::Hit(self.measure(body, &direction, &hit, approach.start)),
            None => Outcome::Miss,
        }
    }

    fn measure(&mut self, body: &Body, direction: &Direction, hit: &RayHit, swept_from: Point) -> Touch {
        let noise = Vector::from_fn(|_, _| standard_normal(&mut self.tactile_noise));
        let touched = hit.point + noise * self.settings.tactile_noise_m;
        // The offset on the pad makes torque only: the reported position is the touched point.
        let mut across = || self.offset.random_range(-PAD_HALF_SIDE_M..=PAD_HALF_SIDE_M);
        let offset = Vector::new(across(), across(), 0.0);
        let force_n = -CONTACT_FORCE_N * Vector::z();
        let normal =
            self.settings.measures_normals.then(|| self.perturbed(&body.mesh().face_normal(hit.face)));
        Touch {
            base_from_sensor: Pose::from_parts(touched.into(), facing(direction)),
            force_n,
            torque_nm: offset.cross(&force_n),
            swept_from,
            normal,
        }
    }

    /// A normal turned by a random angle about each of two tangents.
    fn perturbed(&mut self, normal: &Direction) -> Direction {
        let frame = facing(normal);
        let mut tilt = || standard_normal(&mut self.normal_noise) * self.settings.normal_noise_rad;
        let turn = Rotation3::new(Vector::new(tilt(), tilt(), 0.0));
        Direction::new_normalize(frame * (turn * Vector::z()))
    }
}

/// The point on the approach's line, before its start, that lies clear of the object.
fn outside_start(body: &Body, start: &Point, direction: &Direction) -> Point {
    let clear = body.radius_m() + CLEARANCE_M;
    let back_m = (start - body.centre()).norm() + clear;
    start - direction.into_inner() * back_m
}

/// A rotation that turns the z axis to `direction`.
fn facing(direction: &Direction) -> UnitQuaternion<f64> {
    // Any axis that is not parallel fixes the turn about z, which a square pad does not mind.
    let aside = if direction.z.abs() < 0.9 { Vector::z() } else { Vector::x() };
    UnitQuaternion::face_towards(direction, &aside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    const PUSH: Vector = Vector::new(-1.0, 0.0, 0.0);

    /// A ball of radius 64 mm about the origin, approached along the x axis towards its centre, with
    /// the candidate at `x`.
    fn at(x: f64) -> (Outcome, Body) {
        let body = shapes::generate("ball").unwrap();
        let point = Point::new(x, 0.0, 0.0);
        let approach = Approach { start: point - 0.015 * PUSH, end: point + 0.015 * PUSH };
        (Probe::new(ProbeSettings::default(), 1).touch(&body, approach), body)
    }

    #[test]
    fn a_good_estimate_is_hit_at_the_true_surface() {
        let (Outcome::Hit(touch), _) = at(0.06) else { panic!("a hit") };
        let position = touch.base_from_sensor.translation.vector;
        assert!((position.x - 0.064).abs() < 2e-4);
        assert!((touch.swept_from.x - 0.075).abs() < 1e-12);
    }

    #[test]
    fn an_estimate_far_outside_is_missed() {
        assert_eq!(at(0.08).0, Outcome::Miss);
    }

    #[test]
    fn an_estimate_far_inside_is_touched_early_more_than_fifteen_millimetres_off() {
        let (Outcome::Early(touch), body) = at(0.04) else { panic!("an early contact") };
        let position = touch.base_from_sensor.translation.vector;
        assert!((position.x - 0.064).abs() < 2e-4);
        assert!((position.x - 0.04) > 0.015);
        assert!((touch.swept_from - body.centre()).norm() > body.radius_m());
    }

    #[test]
    fn a_window_beyond_a_thin_object_is_missed() {
        let body = shapes::generate("plate").unwrap();
        let start = Point::new(0.03, 0.0, -0.01);
        let end = start - 0.03 * Vector::z();
        let outcome = Probe::new(ProbeSettings::default(), 1).touch(&body, Approach { start, end });
        assert_eq!(outcome, Outcome::Miss);
    }

    #[test]
    fn the_sensor_faces_the_object_and_the_object_presses_back() {
        let (Outcome::Hit(touch), _) = at(0.06) else { panic!("a hit") };
        let z = touch.base_from_sensor.rotation * Vector::z();
        assert!((z - PUSH).norm() < 1e-12);
        assert_eq!(touch.force_n, Vector::new(0.0, 0.0, -5.0));
        assert_eq!(touch.torque_nm.z, 0.0);
        assert!(touch.torque_nm.xy().abs().max() <= 5.0 * PAD_HALF_SIDE_M);
    }

    #[test]
    fn the_torque_tells_the_offset_on_the_pad() {
        let body = shapes::generate("ball").unwrap();
        let mut probe = Probe::new(ProbeSettings::default(), 4);
        let (start, end) = (Point::new(0.075, 0.0, 0.0), Point::new(0.045, 0.0, 0.0));
        let mut widest = 0.0_f64;
        for _ in 0..200 {
            let outcome = probe.touch(&body, Approach { start, end });
            let Outcome::Hit(touch) = outcome else { panic!("a hit") };
            // torque = offset x force, so for a force of -5 N along z the offset is (-Ty, Tx) / -5.
            let offset = Vector::new(touch.torque_nm.y, -touch.torque_nm.x, 0.0) / CONTACT_FORCE_N;
            assert!((offset.cross(&touch.force_n) - touch.torque_nm).norm() < 1e-12);
            widest = widest.max(offset.abs().max());
            let position = touch.base_from_sensor.translation.vector;
            assert!(position.yz().norm() < 1e-12, "the offset does not move the position");
        }
        assert!((0.008..=PAD_HALF_SIDE_M).contains(&widest));
    }

    #[test]
    fn every_direction_gives_a_proper_pose() {
        for direction in [Vector::x(), -Vector::y(), Vector::z(), -Vector::z(), Vector::repeat(1.0)] {
            let direction = Direction::new_normalize(direction);
            assert!((facing(&direction) * Vector::z() - direction.into_inner()).norm() < 1e-12);
        }
    }

    #[test]
    fn noise_has_the_size_that_was_asked_for() {
        let body = shapes::generate("ball").unwrap();
        let settings =
            ProbeSettings { tactile_noise_m: 0.001, measures_normals: true, normal_noise_rad: 0.1 };
        let mut probe = Probe::new(settings, 4);
        let approach = Approach { start: Point::new(0.075, 0.0, 0.0), end: Point::new(0.045, 0.0, 0.0) };
        let (mut position_squares, mut angle_squares) = (0.0, 0.0);
        for _ in 0..1000 {
            let Outcome::Hit(touch) = probe.touch(&body, approach) else { panic!("a hit") };
            let position = touch.base_from_sensor.translation.vector;
            position_squares += (position - Vector::new(0.064, 0.0, 0.0)).norm_squared() / 3.0;
            angle_squares += touch.normal.unwrap().angle(&Vector::x()).powi(2) / 2.0;
        }
        assert!(((position_squares / 1000.0_f64).sqrt() / 0.001 - 1.0).abs() < 0.1);
        let angle_deviation = (angle_squares / 1000.0_f64).sqrt();
        assert!((angle_deviation / 0.1 - 1.0).abs() < 0.1, "{angle_deviation}");
    }
}
