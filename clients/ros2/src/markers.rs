//! The surface as `shape_msgs/Mesh` and as a `Marker` whose colours say how certain it is.
//!
//! Colours are those of the paper: green is certain, red is a guess. A marker's triangle list has three points and three
//! colours for each triangle, so that every viewer draws it.

use palpate_client::proto::v1::RawMesh;
use palpate_client::{Error, faces, positions, uncertainty};

use crate::messages::{ColorRgba, Header, Marker, Mesh, MeshTriangle, Point, Pose, Vector3};

/// A surface, unpacked: metres, in the session's frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Surface {
    vertices: Vec<Point>,
    faces: Vec<[u32; 3]>,
    uncertainty: Vec<f32>,
}

impl Surface {
    /// Unpacks what the server sent.
    ///
    /// # Errors
    /// [`Error::Malformed`] when arrays and counts do not fit.
    pub fn unpack(raw: &RawMesh) -> Result<Self, Error> {
        let vertices = positions(raw)?.into_iter();
        let vertices = vertices.map(|vertex| Point::from_array(vertex.map(f64::from))).collect();
        Ok(Self { vertices, faces: faces(raw)?, uncertainty: uncertainty(raw)? })
    }

    /// The surface as a shape, for planners.
    pub fn mesh(&self) -> Mesh {
        let triangles = self.faces.iter().map(|&vertex_indices| MeshTriangle { vertex_indices }).collect();
        Mesh { triangles, vertices: self.vertices.clone() }
    }

    /// The surface as a triangle list with a colour for each corner, for viewers.
    pub fn marker(&self, header: Header) -> Marker {
        let corners = || self.faces.iter().flatten().map(|&index| index as usize);
        Marker {
            header,
            ns: "palpate".to_owned(),
            kind: Marker::TRIANGLE_LIST,
            action: Marker::ADD,
            pose: Pose::default(),
            scale: Vector3 { x: 1.0, y: 1.0, z: 1.0 },
            color: ColorRgba { r: 1.0, g: 1.0, b: 1.0, a: 1.0 },
            points: corners().map(|index| self.vertices[index]).collect(),
            colors: corners().map(|index| colour(self.uncertainty[index])).collect(),
            ..Marker::default()
        }
    }
}

/// Green, yellow, red, evenly spaced from certain to a guess; as in the server's own files.
const RAMP: [[f32; 3]; 5] = [
    [26.0, 150.0, 65.0],
    [166.0, 217.0, 106.0],
    [255.0, 255.0, 191.0],
    [253.0, 174.0, 97.0],
    [215.0, 25.0, 28.0],
];

/// The colour of an uncertainty in [0, 1].
fn colour(uncertainty: f32) -> ColorRgba {
    let position = uncertainty.clamp(0.0, 1.0) * (RAMP.len() - 1) as f32;
    let below = (position as usize).min(RAMP.len() - 2);
    let share = position - below as f32;
    let [r, g, b] = std::array::from_fn(|part| {
        (RAMP[below][part] + share * (RAMP[below + 1][part] - RAMP[below][part])) / 255.0
    });
    ColorRgba { r, g, b, a: 1.0 }
}

#[cfg(test)]
mod tests {
    use palpate_client::visual_prior;

    use super::*;

    fn raw() -> RawMesh {
        let corners = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, 1.0]];
        let indices: [u32; 6] = [0, 1, 2, 0, 3, 1];
        let uncertainties: [f32; 4] = [0.0, 0.5, 1.0, 0.25];
        RawMesh {
            n_vertices: 4,
            n_faces: 2,
            positions_f32_le: visual_prior(&corners, None).points,
            faces_u32_le: indices.into_iter().flat_map(u32::to_le_bytes).collect::<Vec<_>>().into(),
            uncertainty_f32_le: uncertainties
                .into_iter()
                .flat_map(f32::to_le_bytes)
                .collect::<Vec<_>>()
                .into(),
            ..Default::default()
        }
    }

    #[test]
    fn a_marker_has_three_points_and_three_colours_for_each_triangle() {
        let surface = Surface::unpack(&raw()).unwrap();
        let marker = surface.marker(Header { frame_id: "base".to_owned(), ..Header::default() });
        assert_eq!((marker.points.len(), marker.colors.len()), (6, 6));
        assert_eq!(marker.points[4], Point { x: 0.0, y: 0.0, z: 1.0 });
        assert_eq!(marker.colors[0], marker.colors[3]);
        assert!((marker.colors[0].g - 150.0 / 255.0).abs() < 1e-6);
        assert!((marker.colors[2].r - 215.0 / 255.0).abs() < 1e-6);
        assert!((marker.colors[4].r - 166.0 / 255.0).abs() < 1e-6);
        assert_eq!((marker.header.frame_id.as_str(), marker.scale.x), ("base", 1.0));
    }

    #[test]
    fn a_shape_keeps_vertices_and_faces() {
        let mesh = Surface::unpack(&raw()).unwrap().mesh();
        assert_eq!(mesh.vertices.len(), 4);
        assert_eq!(mesh.triangles[1].vertex_indices, [0, 3, 1]);
    }

    #[test]
    fn a_face_without_its_vertex_is_refused_before_anything_is_drawn() {
        let broken = RawMesh { n_vertices: 3, ..raw() };
        assert!(Surface::unpack(&broken).is_err());
    }
}
