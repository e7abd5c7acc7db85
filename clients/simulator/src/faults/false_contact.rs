//! Contacts where there is nothing: a jerk of the arm, a cable, a sensor that drifts.

use palpate_core::geometry::{Direction, Pose, Vector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::body::Body;
use crate::probe::{
    Approach, CONTACT_FORCE_N, PAD_HALF_SIDE_M, Pad, ProbeSettings, Touch, facing, meet, sensed,
};
use crate::random::{Stream, generator};

/// Decides which approaches end in the air.
#[derive(Debug)]
pub(crate) struct FalseContacts {
    share: f64,
    probe: ProbeSettings,
    rng: ChaCha8Rng,
}

impl FalseContacts {
    /// Those of a probe that belong to `seed`; `share` is their probability.
    pub(crate) fn new(share: f64, probe: ProbeSettings, seed: u64) -> Self {
        Self { share, probe, rng: generator(seed, Stream::FalseContact) }
    }

    /// What is reported of an approach that ends in the air; `None` if this one does not.
    ///
    /// The place is uniform over the free part of the approach; of the way to an early contact, over the last
    /// part, as long as the approach. The force is that of a touch, somewhere on the pad.
    pub(crate) fn strike(&mut self, body: &Body, approach: Approach) -> Option<Touch> {
        // Every approach takes as many numbers, so that which are false depends on nothing else.
        let mut between = |low: f64, high: f64| low + (high - low) * self.rng.random::<f64>();
        let drawn = between(0.0, 1.0);
        let place = between(0.0, 1.0);
        let mut across = || between(-PAD_HALF_SIDE_M, PAD_HALF_SIDE_M);
        let offset = Vector::new(across(), across(), 0.0);
        let force_n = -CONTACT_FORCE_N * Vector::z();
        let exact = (force_n, offset.cross(&force_n));
        let noisy = sensed(exact, &mut self.rng);
        if drawn >= self.share {
            return None;
        }
        let sweep = approach.end - approach.start;
        let direction = Direction::try_new(sweep, 0.0)?;
        let (from, free_m) = match meet(self.probe.pad, body, approach) {
            Some(meeting) => (meeting.swept_from, (meeting.centre - meeting.swept_from).norm()),
            None => (approach.start, sweep.norm()),
        };
        let before_m = free_m.min(sweep.norm()) * (1.0 - place);
        let position = from + direction.into_inner() * (free_m - before_m);
        let (force_n, torque_nm) = match self.probe.pad {
            Pad::Point => exact,
            Pad::Flat => noisy,
        };
        Some(Touch {
            base_from_sensor: Pose::from_parts(position.into(), facing(&direction)),
            force_n,
            torque_nm,
            swept_from: from,
            // What presses evenly feels like a surface that lies flat against the pad.
            normal: self.probe.measures_normals.then(|| -direction),
        })
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::geometry::Point;

    use super::*;
    use crate::probe::FORCE_NOISE_N;
    use crate::shapes;

    /// Towards the middle of a ball of 64 mm, from this far before or behind its surface.
    fn approach(before_m: f64) -> Approach {
        let start = Point::new(0.064 + before_m, 0.0, 0.0);
        Approach { start, end: start - 0.03 * Vector::x() }
    }

    fn struck(share: f64, probe: ProbeSettings, before_m: f64) -> Vec<Touch> {
        let body = shapes::generate("ball").unwrap();
        let mut false_contacts = FalseContacts::new(share, probe, 7);
        (0..2000).filter_map(|_| false_contacts.strike(&body, approach(before_m))).collect()
    }

    #[test]
    fn as_many_approaches_are_false_as_was_asked_for() {
        let count = |share| struck(share, ProbeSettings::default(), 0.015).len();
        assert_eq!([count(0.0), count(1.0)], [0, 2000]);
        assert!((150..250).contains(&count(0.1)), "{}", count(0.1));
    }

    #[test]
    fn a_false_contact_is_in_the_air_anywhere_before_the_touch() {
        // Missed, hit, and touched early, where the last 30 mm count.
        for (before_m, nearest) in [(0.05, 0.084), (0.015, 0.064), (-0.02, 0.064)] {
            let farthest = if before_m > 0.0 { 0.064 + before_m } else { 0.094 };
            let touches = struck(1.0, ProbeSettings::default(), before_m);
            let places = || touches.iter().map(|touch| touch.base_from_sensor.translation.vector);
            assert!(places().all(|place| place.yz().norm() < 1e-9));
            let least = places().map(|place| place.x).fold(f64::INFINITY, f64::min);
            let most = places().map(|place| place.x).fold(0.0, f64::max);
            assert!(least > nearest - 2e-4 && least < nearest + 5e-4, "{before_m}: {least}");
            assert!((most - farthest).abs() < 5e-4, "{before_m}: {most}");
            assert!(touches.iter().all(|touch| touch.swept_from.x >= most - 1e-12));
        }
    }

    #[test]
    fn a_false_contact_presses_like_a_true_one() {
        for pad in [Pad::Point, Pad::Flat] {
            let probe = ProbeSettings { pad, measures_normals: true, ..ProbeSettings::default() };
            for touch in struck(0.2, probe, 0.015) {
                assert!((touch.force_n.z + CONTACT_FORCE_N).abs() < 6.0 * FORCE_NOISE_N);
                assert!(touch.torque_nm.abs().max() < 5.0 * 1.1 * PAD_HALF_SIDE_M);
                assert!((touch.base_from_sensor.rotation * Vector::z() + Vector::x()).norm() < 1e-12);
                assert!((touch.normal.unwrap().into_inner() - Vector::x()).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn which_approaches_are_false_belongs_to_the_seed_and_not_to_what_is_met() {
        let body = shapes::generate("ball").unwrap();
        let which = |seed, pad, before_m| -> Vec<bool> {
            let probe = ProbeSettings { pad, ..ProbeSettings::default() };
            let mut false_contacts = FalseContacts::new(0.3, probe, seed);
            (0..50).map(|_| false_contacts.strike(&body, approach(before_m)).is_some()).collect()
        };
        assert_eq!(which(1, Pad::Point, 0.015), which(1, Pad::Flat, 0.05));
        assert_ne!(which(1, Pad::Point, 0.015), which(2, Pad::Point, 0.015));
    }
}
