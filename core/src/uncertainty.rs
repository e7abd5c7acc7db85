//! Uncertainty of the vertices, spread from the attractors (Section III-F,
//! "Uncertainty propagation to vertices").
//!
//! Takes the displaced mesh and the attractors; gives a number in [0, 1] for each vertex. As
//! printed, `u / (1 + t²)` falls with distance. It is confidence that decays:
//! `u_v = 1 - (1 - u_i) / (1 + (t / l)²)`, the least over the attractors whose ring reaches the
//! vertex, and 1 where none does.

mod reach;
mod symmetric;

pub use reach::{Reach, scaled_hops};
pub(crate) use symmetric::lowered_by_symmetry;

use crate::evidence::attractor::Attractor;
use crate::geometry::{Cloud, Connectivity, Point, Ring};

/// The uncertainty of every vertex, in [0, 1]; always computed afresh from all attractors.
pub fn propagate(
    connectivity: &Connectivity,
    vertices: &[Point],
    attractors: &[Attractor],
    reach: Reach,
) -> Vec<f64> {
    let hops = scaled_hops(reach.hops, vertices.len());
    let mut uncertainty = vec![1.0_f64; vertices.len()];
    let (cloud, mut ring) = (Cloud::new(vertices), Ring::new(vertices.len()));
    for attractor in attractors {
        let Some(nearest) = cloud.nearest(&attractor.point) else { continue };
        for &vertex in ring.around(connectivity, nearest, hops) {
            let square_m2 = (vertices[vertex as usize] - attractor.point).norm_squared();
            let u = reach.spread(attractor.uncertainty, square_m2);
            let least = &mut uncertainty[vertex as usize];
            *least = least.min(u);
        }
    }
    uncertainty
}

/// The index of the vertex nearest to a point.
pub fn nearest_vertex(vertices: &[Point], point: &Point) -> Option<u32> {
    Cloud::new(vertices).nearest(point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::attractor::Sense;
    use crate::geometry::Icosphere;
    use proptest::prelude::*;

    const REACH: Reach = Reach { hops: 5, length_m: 0.02 };

    fn sphere_vertices(radius_m: f64) -> Vec<Point> {
        Icosphere::get(4).directions.iter().map(|d| Point::from(d.into_inner() * radius_m)).collect()
    }

    fn attractor(point: Point, uncertainty: f64) -> Attractor {
        Attractor::new(point, uncertainty, Sense::Touch)
    }

    #[test]
    fn confidence_halves_at_one_length_and_ends_at_the_ring() {
        let vertices = sphere_vertices(0.05);
        let at = attractor(vertices[0], 0.0);
        let u = propagate(&Icosphere::get(4).connectivity, &vertices, &[at], REACH);
        assert_eq!(u[0], 0.0);
        for (vertex, u) in vertices.iter().zip(&u).filter(|(_, u)| **u < 1.0) {
            let t = (vertex - vertices[0]).norm() / 0.02;
            assert!((u - t * t / (1.0 + t * t)).abs() < 1e-12);
        }
        let reached = u.iter().filter(|u| **u < 1.0).count();
        // Around one of the twelve corners of valence five: 1 + 5 (1 + 2 + 3 + 4 + 5).
        assert!(reached == 76 || reached == 91, "{reached}");
        assert_eq!(
            u[usize::try_from(nearest_vertex(&vertices, &Point::from(-vertices[0].coords)).unwrap())
                .unwrap()],
            1.0
        );
    }

    #[test]
    fn the_ring_covers_the_same_area_on_a_finer_mesh() {
        assert_eq!(scaled_hops(5, 2562), 5);
        assert_eq!(scaled_hops(5, 10242), 10);
        assert_eq!(scaled_hops(1, 162), 1);
    }

    proptest! {
        #[test]
        fn uncertainty_stays_in_bounds_and_evidence_never_raises_it(
            touches in prop::collection::vec((0_usize..2562, 0.0..=1.0_f64, -0.01..0.01_f64), 1..20),
        ) {
            let vertices = sphere_vertices(0.05);
            let attractors: Vec<_> = touches
                .iter()
                .map(|&(vertex, u, height)| {
                    attractor(vertices[vertex] + vertices[vertex].coords.normalize() * height, u)
                })
                .collect();
            let connectivity = &Icosphere::get(4).connectivity;
            let mut before = vec![1.0; vertices.len()];
            for count in 1..=attractors.len() {
                let after = propagate(connectivity, &vertices, &attractors[..count], REACH);
                for (before, after) in before.iter().zip(&after) {
                    prop_assert!((0.0..=1.0).contains(after) && after <= before);
                }
                before = after;
            }
        }
    }
}
