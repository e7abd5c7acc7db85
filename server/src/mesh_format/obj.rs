//! A surface as Wavefront OBJ: text that every viewer opens, without the uncertainty.

use std::fmt::Write;

use palpate_core::reconstruction::Surface;

/// Writes vertices and triangles; OBJ counts vertices from one.
pub(super) fn write(surface: &Surface, revision: i64) -> Vec<u8> {
    let mut text = format!("# Palpate, revision {revision}\n# unit m, in the session's frame\n");
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
    use crate::mesh_format::tests::tetrahedron;

    #[test]
    fn vertices_come_in_order_and_faces_count_from_one() {
        let text = String::from_utf8(write(&tetrahedron(), 3)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "# Palpate, revision 3");
        assert_eq!(lines[3], "v 0.1 0 0");
        assert_eq!(lines[6], "f 1 3 2");
        assert_eq!(lines.len(), 2 + 4 + 4);
    }
}
