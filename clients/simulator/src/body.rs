//! A solid object: a closed mesh, indexed for rays, distances and inside tests.

use std::collections::HashMap;

use palpate_core::geometry::{Point, SurfaceIndex, TriangleMesh, Vector};

/// Objects beyond this extent are refused: a mesh in millimetres is what this usually is.
pub const MAX_EXTENT_M: f64 = 2.0;
/// Objects below this extent are refused: no pad could explore them.
pub const MIN_EXTENT_M: f64 = 0.005;

/// Why a mesh is not a solid object.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// No face with three different corners.
    #[error("the mesh has no faces: a point cloud cannot be touched, a triangle mesh is needed")]
    NoFaces,
    /// A vertex is NaN or infinite.
    #[error("vertex {vertex} is not a finite number")]
    NotFinite {
        /// Its index after welding.
        vertex: usize,
    },
    /// Edges without a neighbour on the other side.
    #[error(
        "the mesh is not closed: {open_edges} edges lack a matching neighbour (a hole, or faces \
         wound against each other); close it first, for example with the hole filling of MeshLab \
         or Blender, so that inside and outside are defined"
    )]
    NotClosed {
        /// How many directed edges have no opposite.
        open_edges: usize,
    },
    /// Larger than [`MAX_EXTENT_M`].
    #[error(
        "the object is {extent_m:.1} m long and at most {MAX_EXTENT_M} m is accepted: millimetres? \
         scale by 0.001 with --scale"
    )]
    TooLarge {
        /// Longest side of its bounding box, in metres.
        extent_m: f64,
    },
    /// Smaller than [`MIN_EXTENT_M`].
    #[error(
        "the object is {extent_m} m long and at least {MIN_EXTENT_M} m is needed: units are \
         metres, enlarge it with --scale"
    )]
    TooSmall {
        /// Longest side of its bounding box, in metres.
        extent_m: f64,
    },
    /// A closed surface that encloses nothing.
    #[error("the mesh is flat: it encloses no volume")]
    NoVolume,
}

/// A closed object, outward wound, in metres.
#[derive(Clone, Debug)]
pub struct Body {
    mesh: TriangleMesh,
    surface: SurfaceIndex,
    centre: Point,
    radius_m: f64,
}

impl Body {
    /// Welds equal vertices, turns the faces outwards and checks that the mesh is a solid.
    ///
    /// # Errors
    /// A [`BodyError`] that says what is wrong with the mesh and what to do about it.
    pub fn new(mesh: &TriangleMesh) -> Result<Self, BodyError> {
        let mut mesh = weld(mesh);
        if let Some(vertex) =
            mesh.vertices.iter().position(|vertex| !vertex.coords.iter().all(|x| x.is_finite()))
        {
            return Err(BodyError::NotFinite { vertex });
        }
        if mesh.faces.is_empty() {
            return Err(BodyError::NoFaces);
        }
        let (low, high) = bounds(&mesh);
        let extent_m = (high - low).max();
        if extent_m > MAX_EXTENT_M {
            return Err(BodyError::TooLarge { extent_m });
        }
        if extent_m < MIN_EXTENT_M {
            return Err(BodyError::TooSmall { extent_m });
        }
        let open_edges = open_edges(&mesh);
        if open_edges > 0 {
            return Err(BodyError::NotClosed { open_edges });
        }
        let volume = mesh.volume();
        if volume.abs() < 1e-6 * extent_m.powi(3) {
            return Err(BodyError::NoVolume);
        }
        if volume < 0.0 {
            mesh.faces.iter_mut().for_each(|face| face.swap(1, 2));
        }
        let surface = SurfaceIndex::of_solid(&mesh).ok_or(BodyError::NoFaces)?;
        Ok(Self { surface, centre: nalgebra::center(&low, &high), radius_m: 0.5 * (high - low).norm(), mesh })
    }

    /// The triangles.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// Rays, distances and inside tests.
    pub fn surface(&self) -> &SurfaceIndex {
        &self.surface
    }

    /// The centre of the bounding box.
    pub fn centre(&self) -> Point {
        self.centre
    }

    /// The lowest and the highest corner of the bounding box.
    pub fn bounds(&self) -> (Point, Point) {
        bounds(&self.mesh)
    }

    /// Radius of a ball about [`Self::centre`] that holds the object, in metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }
}

/// Joins vertices at exactly the same place and drops faces that this collapses.
fn weld(mesh: &TriangleMesh) -> TriangleMesh {
    let mut index_of = HashMap::new();
    let mut vertices = Vec::new();
    let welded: Vec<u32> = mesh
        .vertices
        .iter()
        .map(|vertex| {
            // Adding zero makes one of the two zeros, which have different bits.
            let key: [u64; 3] = vertex.coords.map(|x| (x + 0.0).to_bits()).into();
            *index_of.entry(key).or_insert_with(|| {
                vertices.push(*vertex);
                vertices.len() as u32 - 1
            })
        })
        .collect();
    let faces = mesh
        .faces
        .iter()
        .map(|face| face.map(|vertex| welded[vertex as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    TriangleMesh { vertices, faces }
}

fn bounds(mesh: &TriangleMesh) -> (Point, Point) {
    let start = (Point::from(Vector::repeat(f64::INFINITY)), Point::from(Vector::repeat(f64::NEG_INFINITY)));
    mesh.vertices.iter().fold(start, |(low, high), vertex| (low.inf(vertex), high.sup(vertex)))
}

/// Directed edges that are not matched by as many in the opposite direction.
fn open_edges(mesh: &TriangleMesh) -> usize {
    let mut balance: HashMap<(u32, u32), i32> = HashMap::new();
    for &[a, b, c] in &mesh.faces {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let step = if from < to { 1 } else { -1 };
            *balance.entry((from.min(to), from.max(to))).or_default() += step;
        }
    }
    balance.values().map(|open| open.unsigned_abs() as usize).sum()
}

#[cfg(test)]
mod tests {
    use palpate_core::geometry::Icosphere;

    use super::*;

    fn ball(radius_m: f64) -> TriangleMesh {
        Icosphere::get(3).mesh_of(|direction| Point::from(radius_m * direction.into_inner()))
    }

    #[test]
    fn a_soup_of_triangles_is_welded_into_a_solid() {
        let ball = ball(0.05);
        let soup = TriangleMesh {
            vertices: (0..ball.faces.len()).flat_map(|face| ball.corners(face)).collect(),
            faces: (0..ball.faces.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect(),
        };
        let body = Body::new(&soup).unwrap();
        assert_eq!(body.mesh().vertices.len(), ball.vertices.len());
        assert!(body.surface().contains(&Point::origin()));
    }

    #[test]
    fn an_inside_out_mesh_is_turned() {
        let mut inside_out = ball(0.05);
        inside_out.faces.iter_mut().for_each(|face| face.swap(0, 1));
        assert!(Body::new(&inside_out).unwrap().mesh().volume() > 0.0);
    }

    #[test]
    fn a_hole_is_reported_with_its_edges() {
        let mut open = ball(0.05);
        open.faces.pop();
        assert_eq!(Body::new(&open).unwrap_err(), BodyError::NotClosed { open_edges: 3 });
    }

    #[test]
    fn a_single_face_wound_the_other_way_is_not_a_closed_surface() {
        let mut mixed = ball(0.05);
        mixed.faces[7].swap(0, 1);
        assert!(matches!(Body::new(&mixed), Err(BodyError::NotClosed { .. })));
    }

    #[test]
    fn millimetres_are_recognised() {
        let error = Body::new(&ball(50.0)).unwrap_err();
        assert!(error.to_string().contains("--scale"), "{error}");
        assert!(matches!(Body::new(&ball(0.0001)), Err(BodyError::TooSmall { .. })));
    }

    #[test]
    fn meshes_without_faces_volume_or_numbers_are_refused() {
        assert_eq!(Body::new(&TriangleMesh::default()).unwrap_err(), BodyError::NoFaces);
        let mut broken = ball(0.05);
        broken.vertices[3].y = f64::NAN;
        assert_eq!(Body::new(&broken).unwrap_err(), BodyError::NotFinite { vertex: 3 });
        let flat = TriangleMesh {
            vertices: vec![Point::origin(), Point::new(0.1, 0.0, 0.0), Point::new(0.0, 0.1, 0.0)],
            faces: vec![[0, 1, 2], [0, 2, 1]],
        };
        assert_eq!(Body::new(&flat).unwrap_err(), BodyError::NoVolume);
    }
}
