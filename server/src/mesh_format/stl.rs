//! A surface as binary STL: separate triangles for printers and CAD, without the uncertainty.

use palpate_core::reconstruction::Surface;

use super::Remark;

/// The header may hold any text but must not begin with "solid", by which readers know the text variant.
const HEADER_BYTES: usize = 80;

/// Writes a normal and three corners a triangle, as `f32`. Of a long remark the end is left out.
pub(super) fn write(surface: &Surface, remark: &Remark<'_>) -> Vec<u8> {
    let mesh = &surface.mesh;
    let mut file = format!("{}, {}", remark.units(), remark.origin()).into_bytes();
    file.resize(HEADER_BYTES, b' ');
    file.extend((mesh.faces.len() as u32).to_le_bytes());
    for face in 0..mesh.faces.len() {
        let normal = mesh.face_normal(face);
        let corners = mesh.corners(face);
        for value in normal.iter().chain(corners.iter().flat_map(|corner| corner.iter())) {
            file.extend((*value as f32).to_le_bytes());
        }
        // The attribute byte count, which is always zero.
        file.extend([0, 0]);
    }
    file
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_format::tests::{HOSTILE, REMARK, tetrahedron};

    fn floats(bytes: &[u8]) -> Vec<f32> {
        bytes.chunks_exact(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect()
    }

    #[test]
    fn every_triangle_takes_fifty_bytes_after_the_header() {
        let file = write(&tetrahedron(), &REMARK);
        assert_eq!(file.len(), 84 + 4 * 50);
        assert_eq!(file[80..84], 4_u32.to_le_bytes());
        assert!(file.starts_with(b"unit m, in the frame base, Palpate, session mug, revision 7   "));
    }

    #[test]
    fn normals_point_outwards_and_corners_follow() {
        let file = write(&tetrahedron(), &HOSTILE);
        assert_eq!((file.len(), file.starts_with(b"solid")), (84 + 4 * 50, false));
        let first = floats(&file[84..84 + 48]);
        assert_eq!(first[..3], [0.0, 0.0, -1.0]);
        assert_eq!(first[3..], [0.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0]);
    }
}
