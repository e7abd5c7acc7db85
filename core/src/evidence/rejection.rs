//! Places that a robot would not touch, and for how long they are left alone by the reason it gave.
//!
//! A rejection says something of the robot and nothing of the object: the estimate is as good there
//! as before. So it is no failure of the estimate, and is forgotten after a number of attempts, by
//! which the surface and its normals have changed; only a person's word stands.

use crate::fingerprint::Fingerprint;
use crate::geometry::Point;

/// Why an approach was not made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RejectReason {
    /// Not said.
    Unspecified,
    /// No joint configuration reaches the pose.
    NoIk,
    /// The motion would collide.
    Collision,
    /// A safety function stopped the robot.
    SafetyStop,
    /// Planning or motion took too long.
    Timeout,
    /// A person decided so.
    Operator,
}

impl RejectReason {
    /// How far around the candidate nothing is proposed, in metres, and for how many further attempts;
    /// `None` for good.
    pub fn hold(self) -> (f64, Option<u32>) {
        match self {
            // Nothing is known, so the least is assumed: that of a timeout.
            Self::Unspecified => Self::Timeout.hold(),
            // Places around ask for nearly the same pose; a few touches later the normal is another one.
            Self::NoIk => (0.015, Some(10)),
            // What is in the way is as large as a gripper.
            Self::Collision => (0.025, Some(10)),
            // As for a collision, and somebody has to come and reset the robot.
            Self::SafetyStop => (0.025, Some(15)),
            // A planner that draws at random may find a path the next time.
            Self::Timeout => (0.010, Some(3)),
            // Nobody asks a person twice.
            Self::Operator => (0.030, None),
        }
    }

    /// A number of its own, for fingerprints.
    fn number(self) -> usize {
        match self {
            Self::Unspecified => 0,
            Self::NoIk => 1,
            Self::Collision => 2,
            Self::SafetyStop => 3,
            Self::Timeout => 4,
            Self::Operator => 5,
        }
    }
}

/// A candidate that was not tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rejection {
    /// The candidate, in metres. By position: a fit may renumber the vertices.
    pub point: Point,
    /// Why not.
    pub reason: RejectReason,
    /// How many attempts there were by then, this one included.
    pub attempts: u32,
}

impl Rejection {
    /// Whether a place is left alone because of it, after `attempts` in all.
    pub fn holds_at(&self, place: &Point, attempts: u32) -> bool {
        let (radius_m, lasts) = self.reason.hold();
        lasts.is_none_or(|lasts| attempts < self.attempts + lasts) && (self.point - place).norm() < radius_m
    }

    /// Adds itself to a fingerprint.
    pub(super) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self { point, reason, attempts } = self;
        fingerprint.vector(&point.coords);
        fingerprint.count(reason.number());
        fingerprint.count(*attempts as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rejection_holds_close_by_and_for_as_many_attempts_as_its_reason_says() {
        let at = |x: f64| Point::new(x, 0.0, 0.0);
        for (reason, radius_m, lasts) in [
            (RejectReason::Unspecified, 0.010, 3),
            (RejectReason::NoIk, 0.015, 10),
            (RejectReason::Collision, 0.025, 10),
            (RejectReason::SafetyStop, 0.025, 15),
            (RejectReason::Timeout, 0.010, 3),
        ] {
            let rejection = Rejection { point: at(0.0), reason, attempts: 7 };
            assert!(rejection.holds_at(&at(0.99 * radius_m), 7), "{reason:?}");
            assert!(!rejection.holds_at(&at(1.01 * radius_m), 7), "{reason:?}");
            assert!(rejection.holds_at(&at(0.0), 6 + lasts) && !rejection.holds_at(&at(0.0), 7 + lasts));
        }
        let no = Rejection { point: at(0.0), reason: RejectReason::Operator, attempts: 7 };
        assert!(no.holds_at(&at(0.029), u32::MAX) && !no.holds_at(&at(0.031), 7));
    }
}
