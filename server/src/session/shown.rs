//! What readers are shown of a state: its surface in single precision, as every format has it, and what contradicts
//! it. Packed, it is kept beside the log, so that a look at an earlier revision computes nothing.

use palpate_core::geometry::{Icosphere, MAX_SUBDIVISIONS, Point, TriangleMesh};
use palpate_core::reconstruction::Surface;
use serde::{Deserialize, Serialize};

use super::Snapshot;

/// The surface of a state, each of its numbers one of single precision.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shown {
    /// The frame of every point.
    pub(crate) frame_id: String,
    pub(crate) surface: Surface,
    pub(crate) doubted: Vec<Doubted>,
}

/// A contact that contradicts what else is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Doubted {
    /// Its event.
    pub(crate) seq: i64,
    /// Where it touched, in metres.
    pub(crate) point: [f64; 3],
    /// The probability that it is no touch of the object.
    pub(crate) doubt: f64,
}

#[derive(Serialize, Deserialize)]
struct Packed {
    frame_id: String,
    faces: Faces,
    positions_m: Vec<[f32; 3]>,
    uncertainty: Vec<f32>,
    std_m: Option<Vec<f32>>,
    doubted: Vec<Doubted>,
}

/// Those of an icosphere are known by how often it was divided.
#[derive(Serialize, Deserialize)]
enum Faces {
    OfSphere(u8),
    Own(Vec<[u32; 3]>),
}

impl Shown {
    /// What is shown of a state; nothing before the first visual prior.
    pub(crate) fn of(snapshot: &Snapshot) -> Option<Self> {
        let mut surface = snapshot.reconstruction.surface()?;
        surface.mesh.vertices.iter_mut().flat_map(|vertex| vertex.iter_mut()).for_each(round);
        surface.uncertainty.iter_mut().for_each(round);
        surface.std_m.iter_mut().flatten().for_each(round);
        Some(Self {
            frame_id: snapshot.definition.frame_id.clone(),
            surface,
            doubted: snapshot.doubted().collect(),
        })
    }

    pub(crate) fn packed(&self) -> Option<Vec<u8>> {
        let Surface { mesh, uncertainty, std_m } = &self.surface;
        let narrow = |values: &Vec<f64>| values.iter().map(|value| *value as f32).collect();
        let packed = Packed {
            frame_id: self.frame_id.clone(),
            faces: Faces::of(mesh),
            positions_m: mesh.vertices.iter().map(|v| [v.x, v.y, v.z].map(|x| x as f32)).collect(),
            uncertainty: narrow(uncertainty),
            std_m: std_m.as_ref().map(narrow),
            doubted: self.doubted.clone(),
        };
        postcard::to_stdvec(&packed).ok()
    }

    /// What was packed; nothing where it cannot be read.
    pub(crate) fn unpacked(bytes: &[u8]) -> Option<Self> {
        let Packed { frame_id, faces, positions_m, uncertainty, std_m, doubted } =
            postcard::from_bytes(bytes).ok()?;
        let vertices = positions_m.into_iter().map(|at| Point::from(at.map(f64::from))).collect();
        let wide = |values: Vec<f32>| values.into_iter().map(f64::from).collect();
        let mesh = TriangleMesh { vertices, faces: faces.into_faces()? };
        Some(Self {
            frame_id,
            surface: Surface { mesh, uncertainty: wide(uncertainty), std_m: std_m.map(wide) },
            doubted,
        })
    }
}

impl Faces {
    fn of(mesh: &TriangleMesh) -> Self {
        let spheres = 0..=MAX_SUBDIVISIONS;
        let is_it = |times: &usize| {
            mesh.vertices.len() == Icosphere::vertices(*times)
                && mesh.faces == Icosphere::get(*times).connectivity.faces
        };
        match spheres.into_iter().find(is_it) {
            Some(times) => Self::OfSphere(times as u8),
            None => Self::Own(mesh.faces.clone()),
        }
    }

    fn into_faces(self) -> Option<Vec<[u32; 3]>> {
        match self {
            Self::OfSphere(times) if usize::from(times) <= MAX_SUBDIVISIONS => {
                Some(Icosphere::get(usize::from(times)).connectivity.faces.clone())
            }
            Self::OfSphere(_) => None,
            Self::Own(faces) => Some(faces),
        }
    }
}

/// To the nearest number of single precision.
fn round(value: &mut f64) {
    *value = f64::from(*value as f32);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_format::tests::tetrahedron;

    fn shown(surface: Surface) -> Shown {
        let doubted = vec![Doubted { seq: 7, point: [0.1, 0.2, 0.3], doubt: 0.9 }];
        Shown { frame_id: "base".into(), surface, doubted }
    }

    #[test]
    fn what_is_unpacked_is_what_was_packed_also_without_its_faces() {
        let mut small = shown(tetrahedron());
        small.surface.mesh.vertices.iter_mut().flat_map(|vertex| vertex.iter_mut()).for_each(round);
        small.surface.uncertainty.iter_mut().for_each(round);
        small.surface.std_m.iter_mut().flatten().for_each(round);
        assert_eq!(Shown::unpacked(&small.packed().unwrap()).as_ref(), Some(&small));

        let sphere = Icosphere::get(4);
        let mesh = sphere.mesh_of(|direction| Point::from(direction.into_inner().map(f64::round)));
        let uncertainty = vec![0.5; mesh.vertices.len()];
        let ball = shown(Surface { mesh, uncertainty, std_m: None });
        let packed = ball.packed().unwrap();
        assert!(packed.len() < 17 * sphere.directions.len(), "its faces are known: {}", packed.len());
        assert_eq!(Shown::unpacked(&packed), Some(ball));
    }

    #[test]
    fn bytes_of_something_else_are_none() {
        assert_eq!(Shown::unpacked(b"no surface"), None);
        assert_eq!(Shown::unpacked(&[0, 0, 200]), None);
    }
}
