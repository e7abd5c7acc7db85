//! Attractors: the surface points that pull the mesh, and how far each is to be trusted
//! (Sections III-B and III-C).

use super::attempt::Contact;
use crate::fingerprint::Fingerprint;
use crate::geometry::Point;

/// Which sense measured an attractor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// The depth camera.
    Vision,
    /// The tactile pad.
    Touch,
    /// Not touched itself, but next to a touch, on the plane that its measured normal tells of.
    Tangent,
}

/// A measured point of the object's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attractor {
    /// Where, in metres.
    pub point: Point,
    /// Unreliability of the measurement, in [0, 1].
    pub uncertainty: f64,
    /// Which sense measured it.
    pub sense: Sense,
}

impl Attractor {
    /// Adds itself to a fingerprint.
    pub(crate) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self { point, uncertainty, sense } = self;
        fingerprint.vector(&point.coords);
        fingerprint.number(*uncertainty);
        fingerprint.count(*sense as usize);
    }
}

/// The uncertainty of a touch from its wrench, in [0, `u_max`]; Eq. (1).
///
/// As printed, Eq. (1) adds newtons to newton metres. The torque is divided by the pad's half side
/// first, which gives 0 at the pad's centre, a third of `u_max` at the middle of an edge and half
/// of it at a corner. A wrench of zero says nothing about the place, and counts as `u_max`.
pub fn contact_uncertainty(contact: &Contact, u_max: f64) -> f64 {
    let wrench = contact.wrench();
    let lever = (wrench.torque.x.abs() + wrench.torque.y.abs()) / contact.pad_half_side_m();
    let load = 2.0 * wrench.force.z.abs() + lever; // Eq. (1), denominator
    if load > 0.0 { u_max * lever / load } else { u_max }
}

/// What is physically doubtful about a touch's wrench, in words for the caller.
pub fn wrench_warnings(contact: &Contact) -> Vec<String> {
    let wrench = contact.wrench();
    let mut warnings = Vec::new();
    if wrench.force.norm() == 0.0 && wrench.torque.norm() == 0.0 {
        warnings
            .push("wrench: force and torque are zero, so the contact's uncertainty is tactile_u_max".into());
    }
    if wrench.force.z > 0.0 {
        warnings.push(format!(
            "wrench.force.z: {} N pulls on the pad; pressing on an object gives a negative z",
            wrench.force.z
        ));
    }
    let half_diagonal_m = std::f64::consts::SQRT_2 * contact.pad_half_side_m();
    if wrench.torque.norm() > wrench.force.norm() * half_diagonal_m {
        warnings.push(format!(
            "wrench.torque: {:.4} N m is more than {:.3} N can exert on a pad of half side {} m",
            wrench.torque.norm(),
            wrench.force.norm(),
            contact.pad_half_side_m()
        ));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{ContactDetail, Wrench};
    use crate::geometry::{Pose, Vector};

    const HALF_SIDE_M: f64 = 0.009;

    /// A push of 5 N at an offset on the pad.
    fn contact_at(x: f64, y: f64) -> Contact {
        let force = Vector::new(0.0, 0.0, -5.0);
        let torque = Vector::new(x, y, 0.0).cross(&force);
        contact(Wrench { force, torque })
    }

    fn contact(wrench: Wrench) -> Contact {
        Contact::new(Pose::identity(), wrench, HALF_SIDE_M, ContactDetail::default()).unwrap()
    }

    #[test]
    fn uncertainty_is_zero_at_the_centre_a_third_at_an_edge_and_half_at_a_corner() {
        for (x, y, share) in
            [(0.0, 0.0, 0.0), (HALF_SIDE_M, 0.0, 1.0 / 3.0), (HALF_SIDE_M, -HALF_SIDE_M, 0.5)]
        {
            let u = contact_uncertainty(&contact_at(x, y), 0.2);
            assert!((u - 0.2 * share).abs() < 1e-12, "{u} at ({x}, {y})");
        }
    }

    #[test]
    fn a_zero_wrench_counts_as_u_max_and_is_warned_about() {
        let contact = contact(Wrench::default());
        assert_eq!(contact_uncertainty(&contact, 0.2), 0.2);
        assert!(wrench_warnings(&contact)[0].contains("zero"));
    }

    #[test]
    fn a_plausible_wrench_has_no_warning() {
        assert!(wrench_warnings(&contact_at(0.004, 0.002)).is_empty());
    }

    #[test]
    fn a_pull_and_an_impossible_torque_are_warned_about() {
        let pull = Wrench { force: Vector::new(0.0, 0.0, 2.0), torque: Vector::zeros() };
        assert!(wrench_warnings(&contact(pull))[0].contains("negative z"));
        let twist = Wrench { force: Vector::new(0.0, 0.0, -1.0), torque: Vector::new(0.1, 0.0, 0.0) };
        assert!(wrench_warnings(&contact(twist))[0].starts_with("wrench.torque"));
    }
}
