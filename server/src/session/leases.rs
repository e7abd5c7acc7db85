//! Places that are promised to one robot for a while, so that two arms never probe one spot.
//!
//! They follow from the log and from the times that it has, and change neither the estimate nor its
//! digest. Which of them are in force is asked with the time at hand.

use std::sync::Arc;

use palpate_core::exploration::SEPARATION_M;
use palpate_core::geometry::Point;

use super::Snapshot;

/// A place that is promised to one robot.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lease {
    pub(crate) robot_id: Arc<str>,
    /// The candidate that was proposed there.
    pub(crate) candidate_id: String,
    /// In the session's frame, in metres.
    pub(crate) place: Point,
    /// Until when, in microseconds since 1970, UTC.
    pub(crate) expire_us: i64,
}

/// The promises of a session.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Leases(Vec<Lease>);

impl Leases {
    /// Those that are still in force at a time, in microseconds since 1970, UTC.
    pub(crate) fn at(&self, now_us: i64) -> Self {
        Self(self.0.iter().filter(|lease| lease.expire_us > now_us).cloned().collect())
    }

    /// The places that a robot must leave to others.
    pub(crate) fn of_others(&self, robot_id: &str) -> Vec<Point> {
        let others = self.0.iter().filter(|lease| robot_id.is_empty() || &*lease.robot_id != robot_id);
        others.map(|lease| lease.place).collect()
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// These and new ones, which replace those that the same robot has of the same place.
    fn with(mut self, new: Vec<Lease>) -> Self {
        let is_replaced = |old: &Lease| {
            let same =
                |new: &Lease| new.robot_id == old.robot_id && (new.place - old.place).norm() < SEPARATION_M;
            new.iter().any(same)
        };
        self.0.retain(|old| !is_replaced(old));
        self.0.extend(new);
        self
    }

    /// These without that of a candidate, once it is known what became of it.
    pub(super) fn without(mut self, candidate_id: &str) -> Self {
        self.0.retain(|lease| lease.candidate_id != candidate_id);
        self
    }
}

impl Snapshot {
    /// The session after some places were promised, at `at_us`: one more event, and the same estimate.
    pub(crate) fn lease(&self, new: Vec<Lease>, at_us: i64) -> Self {
        let after = self.noted(at_us);
        Self { leases: after.leases.clone().with(new), ..after }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lease(robot: &str, candidate: &str, x: f64, expire_us: i64) -> Lease {
        let place = Point::new(x, 0.0, 0.0);
        Lease { robot_id: robot.into(), candidate_id: candidate.into(), place, expire_us }
    }

    #[test]
    fn a_promise_binds_the_others_until_it_expires_or_its_candidate_was_tried() {
        let leases = Leases::default().with(vec![lease("a", "1", 0.0, 10), lease("b", "2", 0.1, 20)]);
        let places = |leases: &Leases, robot: &str| -> Vec<f64> {
            leases.of_others(robot).iter().map(|place| place.x).collect()
        };
        assert_eq!(places(&leases, "a"), [0.1]);
        assert_eq!(places(&leases, "b"), [0.0]);
        assert_eq!(places(&leases, ""), [0.0, 0.1], "nobody in particular has no promise");
        assert_eq!(places(&leases.at(9), "c").len(), 2);
        assert_eq!(places(&leases.at(10), "c"), [0.1]);
        assert_eq!(places(&leases.clone().without("2"), "c"), [0.0]);
    }

    #[test]
    fn a_place_promised_again_to_the_same_robot_is_promised_once() {
        let leases = Leases::default().with(vec![lease("a", "1", 0.0, 10), lease("b", "2", 0.001, 10)]);
        let leases = leases.with(vec![lease("a", "3", 0.002, 20)]);
        assert_eq!(leases.len(), 2);
        assert_eq!(leases.without("3").of_others("").len(), 1);
    }
}
