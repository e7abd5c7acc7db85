//! Attractors: the surface points that pull the mesh, and how far each is to be trusted
//! (Sections III-B and III-C).

use super::attempt::Contact;
use crate::geometry::{Point, Vector};

/// Which sense measured an attractor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// The depth camera.
    Vision,
    /// The tactile pad.
    Touch,
    /// Not touched: where the object stands on its support.
    Support,
    /// Not touched itself, but next to a touch, on the plane that its measured normal tells of.
    Tangent,
}

/// A measured point of the object's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attractor {
    /// Where, in metres, corrected by what is believed of rigid offsets.
    pub point: Point,
    /// Unreliability of the measurement, in [0, 1].
    pub uncertainty: f64,
    /// Which sense measured it.
    pub sense: Sense,
    /// Where it comes from, and what is believed of it.
    pub provenance: Provenance,
}

impl Attractor {
    /// A point that is believed as it is.
    pub fn new(point: Point, uncertainty: f64, sense: Sense) -> Self {
        Self { point, uncertainty, sense, provenance: Provenance::default() }
    }
}

/// Where an attractor comes from, and what METHOD_PALPATE believes of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Provenance {
    /// The number of its view among the views, or of its touch among the touches.
    pub source: usize,
    /// Which of the points of its view it is; 0 for a touch.
    pub index: usize,
    /// The probability that it is no point of the surface, in [0, 1].
    pub doubt: f64,
    /// Standard deviation across the approach, in metres: of where on the pad the touch was.
    pub lateral_m: f64,
    /// The direction of the approach; zero for what was seen.
    pub approach: Vector,
    /// What its point was corrected by, in metres.
    pub correction: Vector,
    /// The rigid offsets that it shares with others.
    pub rigid: [Option<Rigid>; 2],
}

/// A rigid offset that all points of a group share, a translation and a small rotation, and how one of them
/// takes part in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigid {
    /// The group.
    pub group: Group,
    /// Standard deviation of the translation in each direction before any touch, in metres.
    pub std_m: f64,
    /// Standard deviation of the rotation about each axis before any touch, in radians.
    pub turn_std: f64,
    /// From what the group turns about to the point, in metres.
    pub lever: Vector,
}

impl Rigid {
    /// By how much a point's height along a normal changes with the rotation about each axis, in metres.
    pub fn turned(&self, normal: &Vector) -> Vector {
        self.lever.cross(normal)
    }
}

/// What may be off as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// A view, by its number.
    View(usize),
    /// All that was measured before the object's last motion.
    BeforeMotion,
}

/// The uncertainty of a touch from its wrench, in [0, `u_max`]; Eq. (1).
///
/// As printed, Eq. (1) adds newtons to newton metres. The torque is divided by the pad's half side
/// first, which gives 0 at the pad's centre, a third of `u_max` at the middle of an edge and half
/// of it at a corner. A wrench of zero says nothing about the place, and counts as `u_max`.
pub fn contact_uncertainty(contact: &Contact, u_max: f64) -> f64 {
    let wrench = contact.wrench();
    let lever = (wrench.torque.x.abs() + wrench.torque.y.abs()) / contact.pad().half_side_m();
    let load = 2.0 * wrench.force.z.abs() + lever; // Eq. (1), denominator
    if load > 0.0 { u_max * lever / load } else { u_max }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{ContactDetail, Pad, Wrench};
    use crate::geometry::{Pose, Vector};

    const HALF_SIDE_M: f64 = 0.009;

    fn contact(wrench: Wrench) -> Contact {
        Contact::new(Pose::identity(), wrench, Pad::new(HALF_SIDE_M).unwrap(), ContactDetail::default())
            .unwrap()
    }

    #[test]
    fn uncertainty_is_zero_at_the_centre_a_third_at_an_edge_and_half_at_a_corner() {
        for (x, y, share) in
            [(0.0, 0.0, 0.0), (HALF_SIDE_M, 0.0, 1.0 / 3.0), (HALF_SIDE_M, -HALF_SIDE_M, 0.5)]
        {
            let force = Vector::new(0.0, 0.0, -5.0);
            let torque = Vector::new(x, y, 0.0).cross(&force);
            let u = contact_uncertainty(&contact(Wrench { force, torque }), 0.2);
            assert!((u - 0.2 * share).abs() < 1e-12, "{u} at ({x}, {y})");
        }
    }

    #[test]
    fn a_zero_wrench_counts_as_u_max() {
        assert_eq!(contact_uncertainty(&contact(Wrench::default()), 0.2), 0.2);
    }
}
