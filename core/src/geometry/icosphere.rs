//! The unit sphere as a subdivided icosahedron: the topology that every template is mapped from.
//!
//! Vertex numbers are stable for a number of subdivisions, so a mesh of the session is told apart
//! from the one before it by positions alone.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use super::{Connectivity, Direction, Point, TriangleMesh, Vector};

/// The finest sphere offered: 40,962 vertices.
pub const MAX_SUBDIVISIONS: usize = 6;

/// A unit sphere of triangles with its adjacency; `10 * 4^subdivisions + 2` vertices.
#[derive(Debug)]
pub struct Icosphere {
    /// Unit directions of the vertices.
    pub directions: Vec<Direction>,
    /// Its faces, shared by every mesh that is mapped from it.
    pub connectivity: Arc<Connectivity>,
}

impl Icosphere {
    /// The sphere with `subdivisions` (at most [`MAX_SUBDIVISIONS`]), built once per process.
    ///
    /// # Panics
    /// If `subdivisions` exceeds [`MAX_SUBDIVISIONS`]; the configuration never lets it.
    pub fn get(subdivisions: usize) -> &'static Self {
        static SPHERES: [OnceLock<Icosphere>; MAX_SUBDIVISIONS + 1] =
            [const { OnceLock::new() }; MAX_SUBDIVISIONS + 1];
        SPHERES[subdivisions].get_or_init(|| Self::subdivide(subdivisions))
    }

    /// How many vertices the sphere with `subdivisions` has.
    pub fn vertices(subdivisions: usize) -> usize {
        10 * (1 << (2 * subdivisions)) + 2
    }

    /// Maps every vertex direction to a point and keeps the faces.
    pub fn mesh_of(&self, map: impl FnMut(&Direction) -> Point) -> TriangleMesh {
        TriangleMesh {
            vertices: self.directions.iter().map(map).collect(),
            faces: self.connectivity.faces.clone(),
        }
    }

    fn subdivide(subdivisions: usize) -> Self {
        let (mut directions, mut faces) = icosahedron();
        for _ in 0..subdivisions {
            let mut midpoints = HashMap::new();
            let mut midpoint = |a: u32, b: u32| {
                *midpoints.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let sum = directions[a as usize].into_inner() + directions[b as usize].into_inner();
                    directions.push(Direction::new_normalize(sum));
                    directions.len() as u32 - 1
                })
            };
            faces = faces
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (midpoint(a, b), midpoint(b, c), midpoint(c, a));
                    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
                })
                .collect();
        }
        let connectivity = Arc::new(Connectivity::new(faces, directions.len()).keeping_rings());
        Self { directions, connectivity }
    }
}

fn icosahedron() -> (Vec<Direction>, Vec<[u32; 3]>) {
    let phi = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut directions = Vec::with_capacity(12);
    for (one, golden) in [(1.0, phi), (-1.0, phi), (1.0, -phi), (-1.0, -phi)] {
        directions.push(Vector::new(0.0, one, golden));
        directions.push(Vector::new(one, golden, 0.0));
        directions.push(Vector::new(golden, 0.0, one));
    }
    let directions: Vec<_> = directions.into_iter().map(Direction::new_normalize).collect();
    // Corners at the shortest distance from each other are the faces.
    let adjacent = |a: usize, b: usize| directions[a].dot(&directions[b]) > 0.4;
    let mut faces = Vec::with_capacity(20);
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if adjacent(a, b) && adjacent(b, c) && adjacent(c, a) {
                    let outward = directions[a].cross(&directions[b]).dot(&directions[c]) > 0.0;
                    let (b, c) = if outward { (b, c) } else { (c, b) };
                    faces.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    (directions, faces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_follow_euler() {
        for subdivisions in 0..=4 {
            let sphere = Icosphere::get(subdivisions);
            let n = 4_usize.pow(subdivisions as u32);
            assert_eq!(sphere.directions.len(), 10 * n + 2);
            assert_eq!(sphere.connectivity.faces.len(), 20 * n);
            let edges: usize =
                (0..sphere.directions.len()).map(|v| sphere.connectivity.neighbours(v).len()).sum();
            assert_eq!(edges / 2, 30 * n);
        }
    }

    #[test]
    fn every_face_is_wound_outwards() {
        let sphere = Icosphere::get(3);
        let mesh = sphere.mesh_of(|direction| Point::from(direction.into_inner()));
        for face in 0..mesh.faces.len() {
            assert!(mesh.area_normal(face).dot(&mesh.corners(face)[0].coords) > 0.0);
        }
    }
}
