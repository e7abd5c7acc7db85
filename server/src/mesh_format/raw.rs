//! A surface as packed arrays, for programs that draw or compute.

use palpate_core::reconstruction::Surface;

/// Little-endian arrays of V vertices and F triangles.
pub(crate) struct RawArrays {
    /// V times x, y, z as `f32`, in metres.
    pub(crate) positions_f32_le: Vec<u8>,
    /// F times three vertex indices as `u32`, counter-clockwise seen from outside.
    pub(crate) faces_u32_le: Vec<u8>,
    /// V uncertainties as `f32`, in [0, 1].
    pub(crate) uncertainty_f32_le: Vec<u8>,
    /// V standard deviations along the normal as `f32`, in metres; empty when they are not known.
    pub(crate) std_m_f32_le: Vec<u8>,
}

/// Packs `surface`.
pub(crate) fn raw(surface: &Surface) -> RawArrays {
    RawArrays {
        positions_f32_le: pack(surface.mesh.vertices.iter().flat_map(|vertex| vertex.iter().copied())),
        faces_u32_le: surface.mesh.faces.iter().flatten().flat_map(|index| index.to_le_bytes()).collect(),
        uncertainty_f32_le: pack(surface.uncertainty.iter().copied()),
        std_m_f32_le: pack(surface.std_m.iter().flatten().copied()),
    }
}

fn pack(values: impl Iterator<Item = f64>) -> Vec<u8> {
    values.flat_map(|value| (value as f32).to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_format::tests::tetrahedron;
    use crate::mesh_format::{PointEncoding, read_points};

    #[test]
    fn packed_positions_are_the_vertices_in_order() {
        let surface = tetrahedron();
        let arrays = raw(&surface);
        let points = read_points(PointEncoding::XyzF32Le, &arrays.positions_f32_le).unwrap().points;
        for (point, vertex) in points.iter().zip(&surface.mesh.vertices) {
            assert!((point - vertex).norm() < 1e-8);
        }
        assert_eq!(arrays.faces_u32_le.len(), 4 * 3 * 4);
        assert_eq!(arrays.uncertainty_f32_le[4..8], 0.25_f32.to_le_bytes());
    }

    #[test]
    fn deviations_are_packed_only_where_they_are_known() {
        let mut surface = tetrahedron();
        assert!(raw(&surface).std_m_f32_le.is_empty());
        surface.std_m = Some(vec![0.001; 4]);
        assert_eq!(raw(&surface).std_m_f32_le.len(), 16);
    }
}
