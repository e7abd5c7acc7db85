//! A surface as Wavefront OBJ: text that every viewer opens, without the uncertainty.

use std::fmt::Write;

use palpate_core::reconstruction::Surface;

use super::Remark;

/// Writes vertices and triangles; OBJ counts vertices from one.
pub(super) fn write(surface: &Surface, remark: &Remark<'_>) -> Vec<u8> {
    let mut text = format!("# {}\n# {}\n", remark.origin(), remark.units());
    let result = surface
        .mesh
        .vertices
        .iter()
        .try_for_each(|v| writeln!(text, "v {} {} {}", v.x as f32, v.y as f32, v.z as f32))
        .and_then(|()| {
            let mut faces = surface.mesh.faces.iter();
            faces.try_for_each(|[a, b, c]| writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1))
        });
    debug_assert!(result.is_ok(), "writing to a string cannot fail");
    text.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_format::tests::{HOSTILE, REMARK, tetrahedron};

    #[test]
    fn vertices_come_in_order_and_faces_count_from_one() {
        let text = String::from_utf8(write(&tetrahedron(), &REMARK)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[..2], ["# Palpate, session mug, revision 7", "# unit m, in the frame base"]);
        assert_eq!(lines[3], "v 0.1 0 0");
        assert_eq!(lines[6], "f 1 3 2");
        assert_eq!(lines.len(), 2 + 4 + 4);
        let hostile = String::from_utf8(write(&tetrahedron(), &HOSTILE)).unwrap();
        assert_eq!(hostile.lines().count(), lines.len());
    }
}
