//! Closest points on a mesh whose faces come in the order of a subdivision, such as an icosphere's: faces that follow
//! each other lie together, so there is a box around each face, and one around every sixteen. Nothing is sorted, so
//! that a tree is made anew with every template.

use super::boxes::{Boxes, LANES};
use super::{ClosestPoint, Point, TriangleMesh, Vector};
use crate::vectorised::widest;

/// Squared distances that differ by no more than this share are equal: faces that meet in the nearest point differ in
/// rounding alone, which shall not choose among them.
const TIE: f64 = 1e-9;

/// A tree of boxes over the faces of a mesh.
#[derive(Debug)]
pub struct FaceTree {
    /// A box around each face.
    faces: Boxes,
    /// A box around each group of those.
    groups: Boxes,
}

/// What has been found so far.
struct Search<'a> {
    mesh: &'a TriangleMesh,
    to: Point,
    square: f64,
    found: (Point, usize),
}

impl FaceTree {
    /// A tree over a mesh; nothing for one without faces.
    pub fn new(mesh: &TriangleMesh) -> Option<Self> {
        let of_face = |face: usize| {
            let [a, b, c] = mesh.corners(face);
            (a.inf(&b).inf(&c), a.sup(&b).sup(&c))
        };
        let faces: Vec<(Point, Point)> = (0..mesh.faces.len()).map(of_face).collect();
        if faces.is_empty() {
            return None;
        }
        let around = |boxes: &[(Point, Point)]| {
            boxes.iter().fold(boxes[0], |(low, high), other| (low.inf(&other.0), high.sup(&other.1)))
        };
        let groups: Vec<(Point, Point)> = faces.chunks(LANES).map(around).collect();
        Some(Self { faces: Boxes::new(&faces), groups: Boxes::new(&groups) })
    }

    /// The point of the mesh nearest to another, on the first of the faces that meet there. The mesh is the one that
    /// the tree was made for.
    pub fn closest(&self, mesh: &TriangleMesh, to: &Point) -> ClosestPoint {
        debug_assert!(to.coords.iter().all(|x| x.is_finite()));
        let mut search = Search { mesh, to: *to, square: f64::INFINITY, found: (mesh.vertices[0], 0) };
        let to = [to.x, to.y, to.z];
        widest(
            #[inline(always)]
            || {
                self.groups.look_into(
                    self.groups.all(),
                    &to,
                    f64::INFINITY,
                    #[inline(always)]
                    |group| {
                        let within = search.square * (1.0 + TIE);
                        self.faces.look_into(group..group + 1, &to, within, |face| search.try_face(face));
                        search.square * (1.0 + TIE)
                    },
                );
            },
        );
        let (point, face) = search.found;
        ClosestPoint { point, face, distance_m: search.square.sqrt() }
    }
}

impl Search<'_> {
    /// Within which square of a distance a face is worth a look, once this one was looked at.
    fn try_face(&mut self, face: usize) -> f64 {
        let point = closest_of_triangle(&self.to, &self.mesh.corners(face));
        let square = (self.to - point).norm_squared();
        let is_first = square <= self.square * (1.0 + TIE) && face < self.found.1;
        if square < self.square * (1.0 - TIE) || is_first {
            self.found = (point, face);
        }
        self.square = self.square.min(square);
        self.square * (1.0 + TIE)
    }
}

/// The point of a triangle nearest to another, by the region of the triangle's plane that it lies over (Ericson,
/// Real-Time Collision Detection, 5.1.5).
fn closest_of_triangle(to: &Point, [a, b, c]: &[Point; 3]) -> Point {
    let (ab, ac): (Vector, Vector) = (b - a, c - a);
    let along = |corner: &Point| (ab.dot(&(to - corner)), ac.dot(&(to - corner)));
    let ((d1, d2), (d3, d4), (d5, d6)) = (along(a), along(b), along(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let of_c = d1 * d4 - d3 * d2;
    if of_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let of_b = d5 * d2 - d1 * d6;
    if of_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let of_a = d3 * d6 - d5 * d4;
    if of_a <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let per_area = 1.0 / (of_a + of_b + of_c);
    a + ab * (of_b * per_area) + ac * (of_c * per_area)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Icosphere, SurfaceIndex};

    #[test]
    fn of_the_faces_that_meet_in_the_nearest_point_it_is_the_first_wherever_the_mesh_lies() {
        for moved in [Vector::zeros(), Vector::new(-0.7, 1.1, 0.4), Vector::new(0.1, 3.3, -0.2)] {
            let sphere = Icosphere::get(4);
            let mesh =
                sphere.mesh_of(|d| Point::from(d.component_mul(&Vector::new(0.05, 0.03, 0.08)) + moved));
            let tree = FaceTree::new(&mesh).unwrap();
            for (vertex, direction) in sphere.directions.iter().enumerate() {
                let found = tree.closest(&mesh, &(mesh.vertices[vertex] + direction.into_inner() * 1e-3));
                // Above a vertex, if not just beside it.
                if (found.point - mesh.vertices[vertex]).norm() < 1e-12 {
                    assert_eq!(Some(&(found.face as u32)), sphere.connectivity.faces_at(vertex).iter().min());
                }
            }
        }
    }

    #[test]
    fn closest_points_are_those_of_the_general_index() {
        for subdivisions in [0, 3, 4] {
            let mesh = Icosphere::get(subdivisions)
                .mesh_of(|d| Point::new(0.05 * d.x + 0.1, 0.02 * d.y, 0.1 * d.z.powi(3)));
            let (tree, index) = (FaceTree::new(&mesh).unwrap(), SurfaceIndex::new(&mesh).unwrap());
            for k in 0..500 {
                let turn = f64::from(k);
                let query =
                    Point::new(0.1 + 0.08 * turn.sin(), 0.05 * (1.7 * turn).cos(), 0.12 * (2.3 * turn).sin());
                let (found, expected) = (tree.closest(&mesh, &query), index.closest(&query));
                assert!((found.distance_m - expected.distance_m).abs() < 1e-12, "{query}");
                let [a, b, c] = mesh.corners(found.face);
                let normal = mesh.face_normal(found.face);
                assert!((found.point - a).dot(&normal).abs() < 1e-9, "on its face");
                let centre = Point::from((a.coords + b.coords + c.coords) / 3.0);
                assert!(
                    (found.point - centre).norm()
                        <= (a - centre).norm().max((b - centre).norm()).max((c - centre).norm()) + 1e-12
                );
            }
        }
        assert!(FaceTree::new(&TriangleMesh::default()).is_none());
    }
}
