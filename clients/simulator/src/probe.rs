//! A pad that is pushed along a line until it touches.
//!
//! ```text
//!   probe_start inside the object ... Early: touched before the window
//!   the object in the window ........ Hit
//!   the window free ................. Miss
//!   reported though nothing touched . False, of the faults
//! ```

mod flat;
mod outcome;
mod pad;

use nalgebra::{Rotation3, UnitQuaternion};
use palpate_core::geometry::{Direction, Point, Pose, Vector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

pub use self::outcome::{Approach, Outcome, Touch};
pub use self::pad::Pad;
use crate::body::Body;
use crate::random::{Stream, generator, standard_normal};

/// How hard the pad is pressed, in newtons.
pub const CONTACT_FORCE_N: f64 = 5.0;
/// Half the side of the square pad, in metres.
pub const PAD_HALF_SIDE_M: f64 = 0.009;
/// Standard deviation of each component of the force that a flat pad measures, in newtons.
pub const FORCE_NOISE_N: f64 = 0.02;
/// Standard deviation of each component of the torque that a flat pad measures, in newton metres.
pub const TORQUE_NOISE_NM: f64 = 0.0001;
/// How far outside the object's bounding ball a guarded approach begins, in metres.
const CLEARANCE_M: f64 = 0.05;

/// What the probe measures, and how badly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeSettings {
    /// What it touches with.
    pub pad: Pad,
    /// Standard deviation of the reported position along each axis, in metres.
    pub tactile_noise_m: f64,
    /// Whether the normal of the touched surface is measured.
    pub measures_normals: bool,
    /// Standard deviation of a measured normal about each of its two tangents, in radians.
    pub normal_noise_rad: f64,
}

/// Where an approach meets the object, exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Meeting {
    /// Whether that is before the approach's start.
    pub(crate) is_early: bool,
    /// Where the pad was going.
    pub(crate) direction: Direction,
    /// Where the free motion began.
    pub(crate) swept_from: Point,
    /// The pad's centre at the moment of contact.
    pub(crate) centre: Point,
    /// The centre of pressure about the pad's centre, in the sensor's frame, in metres; zero for a point.
    pub(crate) offset: Vector,
    /// Outward normal of the surface there.
    pub(crate) normal: Direction,
}

/// Pushes the pad from the approach's start to its end; `None` if it meets nothing.
pub(crate) fn meet(pad: Pad, body: &Body, approach: Approach) -> Option<Meeting> {
    let sweep = approach.end - approach.start;
    let direction = Direction::try_new(sweep, 0.0)?;
    match pad {
        Pad::Point => meet_point(body, approach.start, &direction, sweep.norm()),
        Pad::Flat => flat::meet(body, approach.start, &direction, sweep.norm()),
    }
}

fn meet_point(body: &Body, start: Point, direction: &Direction, reach_m: f64) -> Option<Meeting> {
    let surface = body.surface();
    // From an inside start the first hit would be a back face, so this is asked first.
    let is_early = surface.contains(&start);
    let (swept_from, reach_m) = if is_early {
        let outside = outside_start(body, &start, direction);
        (outside, (start - outside).norm())
    } else {
        (start, reach_m)
    };
    let hit = surface.first_hit(&swept_from, direction, reach_m)?;
    Some(Meeting {
        is_early,
        direction: *direction,
        swept_from,
        centre: hit.point,
        offset: Vector::zeros(),
        normal: body.mesh().face_normal(hit.face),
    })
}

/// A probe with its own streams of random numbers.
#[derive(Debug)]
pub struct Probe {
    settings: ProbeSettings,
    offset: ChaCha8Rng,
    tactile_noise: ChaCha8Rng,
    normal_noise: ChaCha8Rng,
    wrench_noise: ChaCha8Rng,
}

impl Probe {
    /// A probe whose offsets and noise belong to `seed`.
    pub fn new(settings: ProbeSettings, seed: u64) -> Self {
        Self {
            settings,
            offset: generator(seed, Stream::Offset),
            tactile_noise: generator(seed, Stream::TactileNoise),
            normal_noise: generator(seed, Stream::NormalNoise),
            wrench_noise: generator(seed, Stream::WrenchNoise),
        }
    }

    /// Pushes the pad from the approach's start to its end, or until it touches.
    pub fn touch(&mut self, body: &Body, approach: Approach) -> Outcome {
        let Some(meeting) = meet(self.settings.pad, body, approach) else {
            return Outcome::Miss;
        };
        let touch = self.measure(&meeting);
        if meeting.is_early { Outcome::Early(touch) } else { Outcome::Hit(touch) }
    }

    fn measure(&mut self, meeting: &Meeting) -> Touch {
        let noise = Vector::from_fn(|_, _| standard_normal(&mut self.tactile_noise));
        let position = meeting.centre + noise * self.settings.tactile_noise_m;
        let base_from_sensor = Pose::from_parts(position.into(), facing(&meeting.direction));
        let (force_n, torque_nm) = match self.settings.pad {
            Pad::Point => self.point_wrench(),
            Pad::Flat => self.flat_wrench(&base_from_sensor, meeting),
        };
        let normal = self.settings.measures_normals.then(|| self.perturbed(&meeting.normal));
        Touch { base_from_sensor, force_n, torque_nm, swept_from: meeting.swept_from, normal }
    }

    /// The offset on the pad makes torque only: the reported position is the touched point.
    fn point_wrench(&mut self) -> (Vector, Vector) {
        let mut across = || self.offset.random_range(-PAD_HALF_SIDE_M..=PAD_HALF_SIDE_M);
        let offset = Vector::new(across(), across(), 0.0);
        let force_n = -CONTACT_FORCE_N * Vector::z();
        (force_n, offset.cross(&force_n))
    }

    /// The force that the friction there lets through, at the centre of pressure, and the sensor's noise.
    fn flat_wrench(&mut self, base_from_sensor: &Pose, meeting: &Meeting) -> (Vector, Vector) {
        let normal = base_from_sensor.rotation.inverse() * meeting.normal;
        let force_n = CONTACT_FORCE_N * flat::push_back(&normal).into_inner();
        sensed((force_n, meeting.offset.cross(&force_n)), &mut self.wrench_noise)
    }

    /// A normal turned by a random angle about each of two tangents.
    fn perturbed(&mut self, normal: &Direction) -> Direction {
        let frame = facing(normal);
        let mut tilt = || standard_normal(&mut self.normal_noise) * self.settings.normal_noise_rad;
        let turn = Rotation3::new(Vector::new(tilt(), tilt(), 0.0));
        Direction::new_normalize(frame * (turn * Vector::z()))
    }
}

/// What the sensor of a flat pad makes of a force and a torque.
pub(crate) fn sensed((force_n, torque_nm): (Vector, Vector), rng: &mut ChaCha8Rng) -> (Vector, Vector) {
    let mut noise = |sd| Vector::from_fn(|_, _| sd * standard_normal(rng));
    (force_n + noise(FORCE_NOISE_N), torque_nm + noise(TORQUE_NOISE_NM))
}

/// The point on the approach's line, before its start, that lies clear of the object.
fn outside_start(body: &Body, start: &Point, direction: &Direction) -> Point {
    let clear = body.radius_m() + CLEARANCE_M;
    let back_m = (start - body.centre()).norm() + clear;
    start - direction.into_inner() * back_m
}

/// A rotation that turns the z axis to `direction`.
pub(crate) fn facing(direction: &Direction) -> UnitQuaternion<f64> {
    // Any axis that is not parallel fixes the turn about z, which a square pad does not mind.
    let aside = if direction.z.abs() < 0.9 { Vector::z() } else { Vector::x() };
    UnitQuaternion::face_towards(direction, &aside)
}

#[cfg(test)]
mod tests {
    use palpate_core::geometry::Icosphere;

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
    fn a_flat_pad_reports_its_centre_and_its_torque_tells_where_it_was_touched() {
        let ball = Icosphere::get(6).mesh_of(|direction| Point::from(0.064 * direction.into_inner()));
        let body = Body::new(&ball).unwrap();
        let settings = ProbeSettings { pad: Pad::Flat, ..ProbeSettings::default() };
        let mut probe = Probe::new(settings, 3);
        for (y, z) in [(0.0, 0.0), (0.005, -0.004), (-0.003, 0.005)] {
            let start = Point::new(0.075, y, z);
            let outcome = probe.touch(&body, Approach { start, end: start + 0.03 * PUSH });
            let Outcome::Hit(Touch { base_from_sensor, force_n, torque_nm, .. }) = outcome else {
                panic!("a hit")
            };
            let position = base_from_sensor.translation.vector;
            assert!((position - Vector::new(0.064, y, z)).norm() < 2e-4, "{position}");
            let touched = base_from_sensor.inverse() * Point::new(0.064, 0.0, 0.0);
            let torque = touched.coords.cross(&force_n);
            assert!((torque - torque_nm).abs().max() < 5.0 * TORQUE_NOISE_NM + 5.0 * 3e-4, "{torque_nm}");
            let offset = Vector::new(-torque_nm.y, torque_nm.x, 0.0) / force_n.z;
            assert!((base_from_sensor * Point::from(offset)).yz().coords.norm() < 5e-4, "{offset}");
            assert!((force_n + 5.0 * Vector::z()).abs().max() < 5.0 * FORCE_NOISE_N, "{force_n}");
        }
    }

    #[test]
    fn a_touch_with_the_rim_pushes_aside_as_far_as_friction_lets_it() {
        let body = shapes::generate("ball").unwrap();
        let settings = ProbeSettings { pad: Pad::Flat, measures_normals: true, ..ProbeSettings::default() };
        // The rim passes the axis at half the radius, where the ball falls off by 30 degrees.
        let start = Point::new(0.07, 0.032 + PAD_HALF_SIDE_M, 0.0);
        let outcome = Probe::new(settings, 3).touch(&body, Approach { start, end: start + 0.03 * PUSH });
        let Outcome::Hit(touch) = outcome else { panic!("a hit") };
        let force = touch.base_from_sensor.rotation * touch.force_n;
        assert!((force.norm() - CONTACT_FORCE_N).abs() < 5.0 * FORCE_NOISE_N);
        let leans = force.angle(&Vector::x()).to_degrees();
        assert!((leans - (30.0 - 0.3_f64.atan().to_degrees())).abs() < 2.0 && force.y > 0.0, "{force}");
        assert!((touch.normal.unwrap().angle(&Vector::x()).to_degrees() - 30.0).abs() < 2.0);
    }

    #[test]
    fn the_pad_decides_how_wide_a_free_path_is() {
        assert_eq!([Pad::Point, Pad::Flat].map(Pad::sweep_radius_m), [0.0, PAD_HALF_SIDE_M]);
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
        let settings = ProbeSettings {
            tactile_noise_m: 0.001,
            measures_normals: true,
            normal_noise_rad: 0.1,
            ..ProbeSettings::default()
        };
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
