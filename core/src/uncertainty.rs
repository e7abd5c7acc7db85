//! Uncertainty of the vertices, spread from the attractors (Section III-F,
//! "Uncertainty propagation to vertices").
//!
//! As printed, `u / (1 + t²)` falls with distance. It is confidence that decays:
//! `u_v = 1 - (1 - u_i) / (1 + (t / l)²)`, the least over the attractors whose ring reaches the
//! vertex, and 1 where none does.

use crate::attractor::Attractor;
use crate::geometry::{Icosphere, Point};
use crate::symmetry::Place;

/// Vertices of the mesh for which the paper counts edges.
const REFERENCE_VERTICES: f64 = 2562.0;
/// The share of its confidence that a place lends to those that a symmetry makes like it.
const BY_SYMMETRY: f64 = 0.5;

/// How far an attractor's confidence spreads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Edges, on the mesh with 2562 vertices.
    pub hops: u32,
    /// Over this length confidence halves, in metres.
    pub length_m: f64,
}

/// The reach of an attractor on a mesh with another tessellation than the paper's, in edges.
pub fn scaled_hops(hops: u32, vertices: usize) -> usize {
    (f64::from(hops) * (vertices as f64 / REFERENCE_VERTICES).sqrt()).round().max(1.0) as usize
}

impl Reach {
    /// Uncertainty at a distance in metres from something of uncertainty `u`.
    fn spread(&self, u: f64, distance_m: f64) -> f64 {
        let t = distance_m / self.length_m;
        1.0 - (1.0 - u) / (1.0 + t * t)
    }

    /// The same over a share of the length.
    fn shortened(self, share: f64) -> Self {
        Self { length_m: self.length_m * share, ..self }
    }
}

/// The uncertainty of every vertex, in [0, 1]; always computed afresh from all attractors.
/// `share` is the share of the length over which an attractor, by its index, spreads.
pub fn propagate(
    sphere: &Icosphere,
    vertices: &[Point],
    attractors: &[Attractor],
    reach: Reach,
    share: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let hops = scaled_hops(reach.hops, vertices.len());
    let mut uncertainty = vec![1.0_f64; vertices.len()];
    let mut ring = Ring::new(vertices.len());
    for (index, attractor) in attractors.iter().enumerate() {
        let Some(nearest) = nearest_vertex(vertices, &attractor.point) else { continue };
        let reach = reach.shortened(share(index));
        for &vertex in ring.around(sphere, nearest, hops) {
            let distance_m = (vertices[vertex as usize] - attractor.point).norm();
            let u = reach.spread(attractor.uncertainty, distance_m);
            let least = &mut uncertainty[vertex as usize];
            *least = least.min(u);
        }
    }
    uncertainty
}

/// Lowers the uncertainty of places that a symmetry makes like known ones. `folded` are the
/// vertices' places after folding; `share` as for [`propagate`].
///
/// Symmetry alone never makes a place confident: it only lets others go first.
pub fn propagate_by_symmetry(
    uncertainty: &mut [f64],
    vertices: &[Point],
    folded: &[Place],
    (attractors, reach): (&[Attractor], Reach),
    share: impl Fn(usize) -> f64,
) {
    let known: Vec<(&Place, f64, Reach)> = attractors
        .iter()
        .enumerate()
        .filter_map(|(index, a)| {
            let place = &folded[nearest_vertex(vertices, &a.point)? as usize];
            Some((place, a.uncertainty, reach.shortened(share(index))))
        })
        .collect();
    // What is lent is at most this much confidence, so the others cannot become more certain by it.
    for (u, place) in uncertainty.iter_mut().zip(folded).filter(|(u, _)| **u > 1.0 - BY_SYMMETRY) {
        for (other, at, reach) in &known {
            let facing = other.normal.dot(&place.normal);
            if facing > 0.0 {
                let confidence = 1.0 - reach.spread(*at, (place.point - other.point).norm());
                *u = u.min(1.0 - BY_SYMMETRY * facing * confidence);
            }
        }
    }
}

/// The index of the vertex nearest to a point.
pub fn nearest_vertex(vertices: &[Point], point: &Point) -> Option<u32> {
    let mut nearest = (f64::INFINITY, None);
    for (index, vertex) in vertices.iter().enumerate() {
        let square = (vertex - point).norm_squared();
        if square < nearest.0 {
            nearest = (square, Some(index as u32));
        }
    }
    nearest.1
}

/// The vertices within a number of edges of another; reusable, so that a search costs its ring.
#[derive(Clone, Debug)]
pub struct Ring {
    seen: Vec<u32>,
    search: u32,
    vertices: Vec<u32>,
    parents: Vec<u32>,
}

impl Ring {
    /// A search over a mesh with `vertices` vertices.
    pub fn new(vertices: usize) -> Self {
        Self { seen: vec![0; vertices], search: 0, vertices: Vec::new(), parents: Vec::new() }
    }

    /// All vertices at most `hops` edges from `centre`, itself first.
    pub fn around(&mut self, sphere: &Icosphere, centre: u32, hops: usize) -> &[u32] {
        self.search += 1;
        self.seen[centre as usize] = self.search;
        self.vertices.clear();
        self.vertices.push(centre);
        self.parents.clear();
        self.parents.push(0);
        let mut from = 0;
        for _ in 0..hops {
            let to = self.vertices.len();
            for inner in from..to {
                for &outer in sphere.neighbours(self.vertices[inner] as usize) {
                    if self.seen[outer as usize] != self.search {
                        self.seen[outer as usize] = self.search;
                        self.vertices.push(outer);
                        self.parents.push(inner as u32);
                    }
                }
            }
            from = to;
        }
        &self.vertices
    }

    /// What the last search reached.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// For each vertex of [`Self::vertices`] the place in it of the one it was reached from; the
    /// first is its own.
    pub fn parents(&self) -> &[u32] {
        &self.parents
    }

    /// Whether the last search reached `vertex`.
    pub fn reached(&self, vertex: u32) -> bool {
        self.seen[vertex as usize] == self.search
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::Sense;
    use crate::symmetry::{Fold, Symmetry};
    use proptest::prelude::*;

    const REACH: Reach = Reach { hops: 5, length_m: 0.02 };

    fn sphere_vertices(radius_m: f64) -> Vec<Point> {
        Icosphere::get(4).directions.iter().map(|d| Point::from(d.into_inner() * radius_m)).collect()
    }

    fn attractor(point: Point, uncertainty: f64) -> Attractor {
        Attractor { point, uncertainty, sense: Sense::Touch }
    }

    #[test]
    fn confidence_halves_at_one_length_and_ends_at_the_ring() {
        let vertices = sphere_vertices(0.05);
        let at = attractor(vertices[0], 0.0);
        let u = propagate(Icosphere::get(4), &vertices, &[at], REACH, |_| 1.0);
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

    #[test]
    fn symmetry_lowers_uncertainty_by_half_at_most() {
        let vertices = sphere_vertices(0.05);
        let sphere = Icosphere::get(4);
        let at = [attractor(vertices[0], 0.0)];
        let fold = Fold {
            centre: Point::origin(),
            axes: nalgebra::Rotation3::identity(),
            symmetry: Symmetry::Mirror([true, true, true]),
        };
        let folded: Vec<Place> = vertices
            .iter()
            .zip(&sphere.directions)
            .map(|(point, normal)| fold.apply(&Place::new(point, normal)))
            .collect();
        let before = propagate(sphere, &vertices, &at, REACH, |_| 1.0);
        let mut after = before.clone();
        propagate_by_symmetry(&mut after, &vertices, &folded, (&at, REACH), |_| 1.0);
        let opposite = nearest_vertex(&vertices, &Point::from(-vertices[0].coords)).unwrap() as usize;
        assert_eq!((before[opposite], after[0]), (1.0, 0.0));
        assert!((after[opposite] - (1.0 - BY_SYMMETRY)).abs() < 1e-9);
        assert!(after.iter().zip(&before).all(|(after, before)| after <= before));
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
            let sphere = Icosphere::get(4);
            let mut before = vec![1.0; vertices.len()];
            for count in 1..=attractors.len() {
                let after = propagate(sphere, &vertices, &attractors[..count], REACH, |_| 1.0);
                for (before, after) in before.iter().zip(&after) {
                    prop_assert!((0.0..=1.0).contains(after) && after <= before);
                }
                before = after;
            }
        }
    }
}
