//! A surface as binary PLY: the one file format here that keeps the uncertainty of each vertex.

use palpate_core::reconstruction::Surface;

/// Writes a little-endian PLY; numbers are `float`, faces are lists of three `int`.
pub(super) fn write(surface: &Surface, revision: i64) -> Vec<u8> {
    let mut file = header(surface, revision).into_bytes();
    for (index, vertex) in surface.mesh.vertices.iter().enumerate() {
        let std_m = surface.std_m.as_ref().map(|std_m| std_m[index]);
        let values = vertex.iter().chain([&surface.uncertainty[index]]).copied().chain(std_m);
        for value in values {
            file.extend((value as f32).to_le_bytes());
        }
    }
    for face in &surface.mesh.faces {
        file.push(3);
        for index in face {
            file.extend(index.to_le_bytes());
        }
    }
    file
}

fn header(surface: &Surface, revision: i64) -> String {
    let std_m = if surface.std_m.is_some() { "property float std_m\n" } else { "" };
    format!(
        "ply\nformat binary_little_endian 1.0\n\
         comment Palpate, revision {revision}\n\
         comment unit m, in the session's frame; uncertainty in 0..1\n\
         element vertex {}\n\
         property float x\nproperty float y\nproperty float z\nproperty float uncertainty\n{std_m}\
         element face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        surface.mesh.vertices.len(),
        surface.mesh.faces.len(),
    )
}

#[cfg(test)]
mod tests {
    use ply_rs_bw::parser::Parser;
    use ply_rs_bw::ply::{DefaultElement, Ply, Property};

    use super::*;
    use crate::mesh_format::tests::tetrahedron;

    fn parse(file: &[u8]) -> Ply<DefaultElement> {
        Parser::<DefaultElement>::new().read_ply(&mut std::io::Cursor::new(file)).unwrap()
    }

    #[test]
    fn an_independent_reader_finds_vertices_faces_and_uncertainties() {
        let surface = tetrahedron();
        let ply = parse(&write(&surface, 7));
        let vertices = &ply.payload["vertex"];
        for (index, vertex) in surface.mesh.vertices.iter().enumerate() {
            assert_eq!(vertices[index]["x"], Property::Float(vertex.x as f32));
            assert_eq!(vertices[index]["z"], Property::Float(vertex.z as f32));
            assert_eq!(vertices[index]["uncertainty"], Property::Float(surface.uncertainty[index] as f32));
        }
        assert!(!vertices[0].contains_key("std_m"));
        assert_eq!(ply.payload["face"][3]["vertex_indices"], Property::ListInt(vec![1, 2, 3]));
        assert_eq!(ply.header.comments[0], "Palpate, revision 7");
    }

    #[test]
    fn deviations_become_a_property_when_they_are_known() {
        let mut surface = tetrahedron();
        surface.std_m = Some(vec![0.001, 0.002, 0.003, 0.004]);
        let ply = parse(&write(&surface, 1));
        assert_eq!(ply.payload["vertex"][2]["std_m"], Property::Float(0.003));
    }
}
