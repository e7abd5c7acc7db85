//! The object where it stands now, the camera that looks at it and the probe that touches it.
//!
//! Here the faults come in: what the robot sees and feels passes through a scene, in process and over
//! the wire alike.

use palpate_core::geometry::Vector;

use crate::body::Body;
use crate::camera::{Camera, View};
use crate::faults::Faults;
use crate::faults::false_contact::FalseContacts;
use crate::probe::{Approach, Outcome, Probe, ProbeSettings};

/// What a robot has before it.
#[derive(Debug)]
pub struct Scene<'a> {
    body: &'a Body,
    seed: u64,
    faults: Faults,
    probe: Probe,
    false_contacts: FalseContacts,
    attempts: u32,
}

impl<'a> Scene<'a> {
    /// The object before the first attempt. `seed` decides the view, the patch, all noise and all faults.
    pub fn new(body: &'a Body, settings: ProbeSettings, faults: Faults, seed: u64) -> Self {
        Self {
            body,
            seed,
            faults,
            probe: Probe::new(settings, seed),
            false_contacts: FalseContacts::new(faults.false_contact_share, settings, seed),
            attempts: 0,
        }
    }

    /// Takes the picture that belongs to the seed; the object has not moved yet.
    pub fn look(&self, camera: &Camera) -> View {
        camera.look_with(self.body, self.seed, &self.faults)
    }

    /// Makes the next attempt.
    pub fn touch(&mut self, approach: Approach) -> Outcome {
        self.attempts += 1;
        match self.motion() {
            // Touching what has moved is touching what has not, from as much further back.
            Some(moved) => self.touch_unmoved(approach.moved(&-moved)).moved(&moved),
            None => self.touch_unmoved(approach),
        }
    }

    /// By what the object stands elsewhere than at the beginning, in metres, as of the last attempt. Whoever
    /// compares an estimate with the object moves the one back or the other along.
    pub fn displacement(&self) -> Vector {
        self.motion().unwrap_or_default()
    }

    fn motion(&self) -> Option<Vector> {
        let motion = self.faults.move_after?;
        (self.attempts > motion.attempt).then(|| motion.displacement(self.seed))
    }

    fn touch_unmoved(&mut self, approach: Approach) -> Outcome {
        let outcome = self.probe.touch(self.body, approach);
        // The probe has drawn its numbers, so the attempts after this one are as they would be without it.
        match self.false_contacts.strike(self.body, approach) {
            Some(touch) => Outcome::False(touch),
            None => outcome,
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::geometry::Point;

    use super::*;
    use crate::faults::Motion;
    use crate::probe::{Pad, Touch};
    use crate::shapes;

    /// Towards the middle of a ball of 64 mm about this place.
    fn approach(middle: Vector) -> Approach {
        let start = Point::from(middle + 0.075 * Vector::x());
        Approach { start, end: start - 0.03 * Vector::x() }
    }

    fn position(touch: &Touch) -> Vector {
        touch.base_from_sensor.translation.vector
    }

    #[test]
    fn an_object_that_has_moved_is_touched_where_it_is() {
        let body = shapes::generate("ball").unwrap();
        let motion = Motion { attempt: 2, distance_m: 0.02 };
        let faults = Faults { move_after: Some(motion), ..Faults::default() };
        let moved = motion.displacement(5);
        for pad in [Pad::Point, Pad::Flat] {
            let settings = ProbeSettings { pad, ..ProbeSettings::default() };
            let mut scene = Scene::new(&body, settings, faults, 5);
            for _ in 0..2 {
                let Outcome::Hit(touch) = scene.touch(approach(Vector::zeros())) else { panic!("a hit") };
                assert!((position(&touch) - 0.064 * Vector::x()).norm() < 2e-4);
                assert_eq!(scene.displacement(), Vector::zeros());
            }
            let Outcome::Hit(touch) = scene.touch(approach(moved)) else { panic!("a hit") };
            assert_eq!(scene.displacement(), moved);
            assert!((position(&touch) - moved - 0.064 * Vector::x()).norm() < 2e-4);
            assert!((touch.swept_from - approach(moved).start).norm() < 1e-12);
        }
    }

    #[test]
    fn a_false_contact_changes_no_other_attempt() {
        let body = shapes::generate("ball").unwrap();
        let settings = ProbeSettings { pad: Pad::Flat, tactile_noise_m: 0.001, ..ProbeSettings::default() };
        let outcomes = |share, seed| -> Vec<Outcome> {
            let faults = Faults { false_contact_share: share, ..Faults::default() };
            let mut scene = Scene::new(&body, settings, faults, seed);
            (0..100).map(|_| scene.touch(approach(Vector::zeros()))).collect()
        };
        let (right, wrong) = (outcomes(0.0, 3), outcomes(0.2, 3));
        let is_false = |outcome: &Outcome| matches!(outcome, Outcome::False(_));
        assert!((10..35).contains(&wrong.iter().filter(|outcome| is_false(outcome)).count()));
        for (right, wrong) in right.iter().zip(&wrong) {
            assert!(is_false(wrong) || right == wrong);
        }
        assert_eq!(wrong, outcomes(0.2, 3), "the same seed gives the same");
        assert_ne!(wrong, outcomes(0.2, 4));
    }
}
