//! Confidence passed on to symmetric points: where a revolution is found, what it makes like a known
//! point is touched last, so that the budget goes to where something new can be.

use super::Reach;
use crate::evidence::attractor::Attractor;
use crate::geometry::{Cloud, SurfacePoint, TriangleMesh};
use crate::symmetry::{Symmetry, SymmetryFrame};

/// Confidence passed on to symmetric points, as a share.
const BY_SYMMETRY: f64 = 0.5;

/// The uncertainty of each vertex, lowered where a symmetry makes it like a known one. Of a
/// revolution only.
///
/// Symmetry alone lowers the uncertainty of a vertex to a half at most: others are touched first.
pub(crate) fn lowered_by_symmetry(
    mut uncertainty: Vec<f64>,
    mesh: &TriangleMesh,
    frame: &SymmetryFrame,
    attractors: &[Attractor],
    reach: Reach,
) -> Vec<f64> {
    let Symmetry::Revolution(_) = frame.symmetry else { return uncertainty };
    let displaced = mesh.vertices.iter().zip(mesh.vertex_normals());
    let representatives: Vec<SurfacePoint> =
        displaced.map(|(p, n)| frame.representative(&SurfacePoint::new(p, &n))).collect();
    let cloud = Cloud::new(&mesh.vertices);
    let known: Vec<(&SurfacePoint, f64)> = attractors
        .iter()
        .filter_map(|a| {
            let nearest = cloud.nearest(&a.point)?;
            Some((&representatives[nearest as usize], a.uncertainty))
        })
        .collect();
    // At most this much confidence is passed on, so the others cannot become more certain by it.
    let can_gain = |(u, _): &(&mut f64, &SurfacePoint)| **u > 1.0 - BY_SYMMETRY;
    for (u, at) in uncertainty.iter_mut().zip(&representatives).filter(can_gain) {
        for (other, of_other) in &known {
            let facing = other.normal.dot(&at.normal);
            if facing > 0.0 {
                let confidence = 1.0 - reach.spread(*of_other, (at.point - other.point).norm_squared());
                *u = u.min(1.0 - BY_SYMMETRY * facing * confidence);
            }
        }
    }
    uncertainty
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::attractor::Sense;
    use crate::geometry::{Icosphere, Point};
    use crate::uncertainty::{nearest_vertex, propagate};

    #[test]
    fn symmetry_lowers_uncertainty_by_half_at_most() {
        let sphere = Icosphere::get(4);
        let mesh = sphere.mesh_of(|direction| Point::from(direction.into_inner() * 0.05));
        let frame = SymmetryFrame {
            centre: Point::origin(),
            axes: nalgebra::Rotation3::identity(),
            symmetry: Symmetry::Revolution(2),
        };
        let reach = Reach { hops: 5, length_m: 0.02 };
        let nearest =
            |x: f64, y: f64| nearest_vertex(&mesh.vertices, &Point::new(x, y, 0.0)).unwrap() as usize;
        let (here, opposite) = (nearest(0.05, 0.0), nearest(-0.05, 0.0));
        let at = [Attractor::new(mesh.vertices[here], 0.0, Sense::Touch)];
        let before = propagate(&sphere.connectivity, &mesh.vertices, &at, reach);
        let after = lowered_by_symmetry(before.clone(), &mesh, &frame, &at, reach);
        assert_eq!((before[opposite], after[here]), (1.0, 0.0));
        assert!((after[opposite] - (1.0 - BY_SYMMETRY)).abs() < 1e-2, "{}", after[opposite]);
        assert!(after.iter().zip(&before).all(|(after, before)| after <= before));
        let none = SymmetryFrame { symmetry: Symmetry::None, ..frame };
        assert_eq!(lowered_by_symmetry(before.clone(), &mesh, &none, &at, reach), before);
    }
}
