//! Objects with corners and handles: signed distances, meshed by marching tetrahedra.
//!
//! A tetrahedron has no ambiguous case, so the surface is closed whatever the function.

use std::collections::HashMap;

use palpate_core::geometry::{Point, TriangleMesh, Vector};

const CELL_M: f64 = 0.004;

/// A box with edges rounded by 6 mm.
pub(super) fn rounded_box() -> TriangleMesh {
    let half = Vector::new(0.035, 0.05, 0.08);
    mesh_of(half, |p| box_distance(p.coords, half, 0.006))
}

/// Two bars at a right angle in the x-z plane.
pub(super) fn l_shape() -> TriangleMesh {
    let lying = Vector::new(0.06, 0.02, 0.02);
    let standing = Vector::new(0.02, 0.02, 0.06);
    mesh_of(Vector::new(0.06, 0.02, 0.06), |p| {
        let lying_distance = box_distance(p.coords + Vector::z() * 0.04, lying, 0.005);
        let standing_distance = box_distance(p.coords + Vector::x() * 0.04, standing, 0.005);
        smooth_union(lying_distance, standing_distance, 0.006)
    })
}

/// A cylinder filled to the brim, with a handle on its x side.
pub(super) fn mug() -> TriangleMesh {
    mesh_of(Vector::new(0.08, 0.042, 0.048), |p| {
        let p = p.coords + Vector::x() * 0.018;
        let from_wall = Vector::new(p.x.hypot(p.y) - 0.036, p.z.abs() - 0.042, 0.0);
        let cylinder = from_wall.sup(&Vector::zeros()).norm() + from_wall.xy().max().min(0.0) - 0.005;
        // A torus about the y axis, stretched by 10 mm up and down.
        let z = p.z - p.z.clamp(-0.01, 0.01);
        let from_ring = (p.x - 0.044).hypot(z) - 0.026;
        let handle = from_ring.hypot(p.y) - 0.007;
        smooth_union(cylinder, handle, 0.006)
    })
}

/// Distance to a box of these half sides, edges rounded, in metres; negative inside.
fn box_distance(p: Vector, half: Vector, rounding_m: f64) -> f64 {
    let beyond = p.abs() - half.add_scalar(-rounding_m);
    beyond.sup(&Vector::zeros()).norm() + beyond.max().min(0.0) - rounding_m
}

/// The union of two bodies with a fillet of about `width_m` where they meet.
fn smooth_union(a: f64, b: f64, width_m: f64) -> f64 {
    let overlap = (width_m - (a - b).abs()).max(0.0) / width_m;
    a.min(b) - 0.25 * width_m * overlap * overlap
}

/// The zero surface of `distance` (negative inside) within a box about the origin.
fn mesh_of(half: Vector, distance: impl Fn(&Point) -> f64) -> TriangleMesh {
    // Two cells of margin keep the surface off the border, where it would stay open.
    let counts = half.map(|half| (2.0 * half / CELL_M).ceil() as u32 + 4);
    let index = |c: [u32; 3]| c[0] + counts.x * (c[1] + counts.y * c[2]);
    let mut corners = Vec::new();
    for z in 0..counts.z {
        for y in 0..counts.y {
            for x in 0..counts.x {
                let steps = Vector::new(f64::from(x), f64::from(y), f64::from(z))
                    - counts.map(|n| 0.5 * f64::from(n - 1));
                let point = Point::from(steps * CELL_M);
                corners.push((point, distance(&point)));
            }
        }
    }
    let mut surface = Surface { corners, on_edge: HashMap::new(), mesh: TriangleMesh::default() };
    for z in 0..counts.z - 1 {
        for y in 0..counts.y - 1 {
            for x in 0..counts.x - 1 {
                // Freudenthal: six tetrahedra along the paths from a cube's lowest corner to its
                // highest; neighbouring cubes agree on the diagonals of the face they share.
                for path in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                    let mut corner = [x, y, z];
                    let tetrahedron = [None, Some(path[0]), Some(path[1]), Some(path[2])].map(|axis| {
                        if let Some(axis) = axis {
                            corner[axis] += 1;
                        }
                        index(corner)
                    });
                    surface.cut(tetrahedron);
                }
            }
        }
    }
    surface.mesh
}

struct Surface {
    corners: Vec<(Point, f64)>,
    on_edge: HashMap<(u32, u32), u32>,
    mesh: TriangleMesh,
}

impl Surface {
    /// Adds the one or two triangles that separate the inner from the outer corners.
    fn cut(&mut self, tetrahedron: [u32; 4]) {
        let (inside, outside): (Vec<u32>, Vec<u32>) =
            tetrahedron.into_iter().partition(|&corner| self.corners[corner as usize].1 < 0.0);
        match (inside.as_slice(), outside.as_slice()) {
            (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => {
                let triangle = [b, c, d].map(|other| self.vertex_between(a, other));
                self.push_outward(triangle, &inside, &outside);
            }
            (&[a, b], &[c, d]) => {
                let [ac, ad, bd, bc] =
                    [(a, c), (a, d), (b, d), (b, c)].map(|(from, to)| self.vertex_between(from, to));
                self.push_outward([ac, ad, bd], &inside, &outside);
                self.push_outward([ac, bd, bc], &inside, &outside);
            }
            _ => {}
        }
    }

    /// The vertex where the surface crosses an edge, shared by all tetrahedra around it.
    fn vertex_between(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (a.min(b), a.max(b));
        let (from, from_distance) = self.corners[a as usize];
        let (to, to_distance) = self.corners[b as usize];
        let vertices = &mut self.mesh.vertices;
        *self.on_edge.entry((a, b)).or_insert_with(|| {
            // Off the ends, so that no triangle shrinks to nothing.
            let share = (from_distance / (from_distance - to_distance)).clamp(0.05, 0.95);
            vertices.push(from + (to - from) * share);
            vertices.len() as u32 - 1
        })
    }

    fn push_outward(&mut self, triangle: [u32; 3], inside: &[u32], outside: &[u32]) {
        let mean = |corners: &[u32]| {
            let sum: Vector = corners.iter().map(|&c| self.corners[c as usize].0.coords).sum();
            sum / corners.len() as f64
        };
        let outward = mean(outside) - mean(inside);
        let [a, b, c] = triangle.map(|vertex| self.mesh.vertices[vertex as usize]);
        let [first, second, third] = triangle;
        self.mesh.faces.push(if (b - a).cross(&(c - a)).dot(&outward) > 0.0 {
            triangle
        } else {
            [first, third, second]
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_meshed_ball_has_the_volume_and_area_of_the_ball() {
        let mesh = mesh_of(Vector::repeat(0.06), |p| p.coords.norm() - 0.06);
        let pi = std::f64::consts::PI;
        assert!((mesh.volume() / (4.0 / 3.0 * pi * 0.06_f64.powi(3)) - 1.0).abs() < 0.01);
        assert!((mesh.area() / (4.0 * pi * 0.06_f64.powi(2)) - 1.0).abs() < 0.02);
    }

    #[test]
    fn distances_to_a_box_are_exact_outside_and_on_it() {
        let half = Vector::new(0.1, 0.2, 0.3);
        assert!((box_distance(Vector::new(0.15, 0.0, 0.0), half, 0.01) - 0.05).abs() < 1e-12);
        assert!(box_distance(Vector::new(0.0, 0.2, 0.0), half, 0.01).abs() < 1e-12);
        assert!((box_distance(Vector::zeros(), half, 0.01) + 0.1).abs() < 1e-12);
    }
}
