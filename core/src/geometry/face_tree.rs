//! Closest points on a mesh whose faces come in the order of a subdivision, such as an icosphere's: of every four
//! faces in turn one box, of every four boxes another, and so on. Nothing is sorted, so that a tree is made anew
//! with every template.

use super::{ClosestPoint, Point, TriangleMesh, Vector};
use crate::vectorised::larger;

/// Boxes, or faces, in one larger box.
const CHILDREN: usize = 4;
/// No more boxes than this are looked at one by one.
const MOST_ROOTS: usize = 80;

/// The coordinates of the lowest corners of some boxes, then of their highest ones, each for all four.
type Boxes = [[f64; CHILDREN]; 6];

/// A tree of boxes over the faces of a mesh.
#[derive(Debug)]
pub struct FaceTree {
    /// From the faces up: the boxes of each level in groups of four.
    levels: Vec<Vec<Boxes>>,
}

/// What has been found so far.
struct Search<'a> {
    mesh: &'a TriangleMesh,
    to: [f64; 3],
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
        let mut boxes: Vec<(Point, Point)> = (0..mesh.faces.len()).map(of_face).collect();
        if boxes.is_empty() {
            return None;
        }
        let mut levels = Vec::new();
        loop {
            levels.push(boxes.chunks(CHILDREN).map(together).collect());
            if boxes.len() <= MOST_ROOTS {
                return Some(Self { levels });
            }
            let around = |boxes: &[(Point, Point)]| {
                boxes.iter().fold(boxes[0], |(low, high), other| (low.inf(&other.0), high.sup(&other.1)))
            };
            boxes = boxes.chunks(CHILDREN).map(around).collect();
        }
    }

    /// The point of the mesh nearest to another. The mesh is the one that the tree was made for.
    pub fn closest(&self, mesh: &TriangleMesh, to: &Point) -> ClosestPoint {
        debug_assert!(to.coords.iter().all(|x| x.is_finite()));
        let to = [to.x, to.y, to.z];
        let mut search = Search { mesh, to, square: f64::INFINITY, found: (mesh.vertices[0], 0) };
        let top = self.levels.len() - 1;
        let mut roots: Vec<(f64, usize)> = self.levels[top]
            .iter()
            .enumerate()
            .map(|(group, boxes)| (squares(boxes, &to).into_iter().fold(f64::INFINITY, f64::min), group))
            .collect();
        roots.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (square, group) in roots {
            if square < search.square {
                self.descend(top, group, &mut search);
            }
        }
        let (point, face) = search.found;
        ClosestPoint { point, face, distance_m: search.square.sqrt() }
    }

    /// Looks into the boxes of a group, the nearest first.
    fn descend(&self, level: usize, group: usize, search: &mut Search<'_>) {
        let mut open: [(f64, usize); CHILDREN] = std::array::from_fn(|child| (f64::INFINITY, child));
        for (entry, square) in open.iter_mut().zip(squares(&self.levels[level][group], &search.to)) {
            entry.0 = square;
        }
        open.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (square, child) in open {
            if square >= search.square {
                return;
            }
            match level {
                0 => search.try_face(CHILDREN * group + child),
                _ => self.descend(level - 1, CHILDREN * group + child, search),
            }
        }
    }
}

impl Search<'_> {
    fn try_face(&mut self, face: usize) {
        let to = Point::from(self.to);
        let point = closest_of_triangle(&to, &self.mesh.corners(face));
        let square = (to - point).norm_squared();
        if square < self.square {
            (self.square, self.found) = (square, (point, face));
        }
    }
}

/// Up to four boxes side by side; those that are missing are infinitely far.
fn together(boxes: &[(Point, Point)]) -> Boxes {
    let mut all = [[f64::INFINITY; CHILDREN]; 6];
    for (child, (low, high)) in boxes.iter().enumerate() {
        for axis in 0..3 {
            (all[axis][child], all[3 + axis][child]) = (low[axis], high[axis]);
        }
    }
    all
}

/// The squared distances of a point from four boxes, in square metres; zero inside.
fn squares([low_x, low_y, low_z, high_x, high_y, high_z]: &Boxes, to: &[f64; 3]) -> [f64; CHILDREN] {
    let mut squares = [0.0; CHILDREN];
    for (axis, (low, high)) in [(low_x, high_x), (low_y, high_y), (low_z, high_z)].into_iter().enumerate() {
        for child in 0..CHILDREN {
            let outside = larger(larger(low[child] - to[axis], to[axis] - high[child]), 0.0);
            squares[child] += outside * outside;
        }
    }
    squares
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
