//! Where a fit of one part starts afresh: from an ellipsoid, a cylinder about each axis, a box, and
//! a slab behind the patch.

use nalgebra::Rotation3;

use super::part::Part;
use super::patch_frame::{PatchFrame, clamp_log_size, principal_axis};
use super::superquadric::{BOX, CYLINDER, SLAB};
use crate::evidence::attractor::{Attractor, Sense};
use crate::geometry::Vector;

/// Half the thickness of the slab, in lengths of the patch.
const SLAB_HALF: f64 = 0.15;
/// The least and the largest half width of the slab, likewise.
const SLAB_WIDTH: (f64, f64) = (0.3, std::f64::consts::E);

/// The cylinders and the box.
pub(super) fn squared(ellipsoid: &Part) -> impl Iterator<Item = Part> {
    let cylinders = (0..3).map(|axis| ellipsoid.squared(axis, CYLINDER));
    cylinders.chain([ellipsoid.squared(2, BOX)])
}

/// A plate, round or square, whose face is the patch: from a thicker body no fit comes down to it,
/// since the misses beside its edge push sideways before they thin.
pub(super) fn slab(ellipsoid: &Part, attractors: &[Attractor], frame: &PatchFrame) -> Part {
    let offsets: Vec<Vector> =
        attractors.iter().filter(|a| a.sense == Sense::Vision).map(|a| a.point - frame.origin).collect();
    let thinnest = principal_axis(&offsets, 0);
    let inwards = if thinnest.dot(&frame.centre) > 0.0 { thinnest } else { -thinnest };
    let widest = principal_axis(&offsets, 2);
    let width = clamp_log_size(ellipsoid.log_axes.max()).exp().clamp(SLAB_WIDTH.0, SLAB_WIDTH.1);
    Part {
        centre: inwards * SLAB_HALF,
        log_axes: Vector::new(width, width, SLAB_HALF).map(f64::ln),
        rotation: Rotation3::from_basis_unchecked(&[widest, inwards.cross(&widest), inwards]),
        exponents: SLAB,
        along: None,
    }
}
