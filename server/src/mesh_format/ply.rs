//! A surface as binary PLY: the one file format here that keeps the uncertainty of each vertex.
//!
//! Viewers know colours, and MeshLab `quality`, so the uncertainty is there under these names too and
//! can be seen without a word about Palpate.

use palpate_core::reconstruction::Surface;

use super::Remark;
use super::colour::{VIRIDIS, colour};

/// Writes a little-endian PLY; numbers are `float`, colours `uchar`, faces lists of three `int`.
pub(super) fn write(surface: &Surface, remark: &Remark<'_>) -> Vec<u8> {
    let mut file = header(surface, remark).into_bytes();
    for (index, vertex) in surface.mesh.vertices.iter().enumerate() {
        let uncertainty = surface.uncertainty[index];
        let std_m = surface.std_m.as_ref().map(|std_m| std_m[index]);
        extend(&mut file, vertex.iter().copied());
        file.extend(colour(&VIRIDIS, uncertainty).map(|part| part.round() as u8));
        extend(&mut file, [uncertainty, uncertainty].into_iter().chain(std_m));
    }
    for face in &surface.mesh.faces {
        file.push(3);
        for index in face {
            file.extend(index.to_le_bytes());
        }
    }
    file
}

fn extend(file: &mut Vec<u8>, values: impl Iterator<Item = f64>) {
    for value in values {
        file.extend((value as f32).to_le_bytes());
    }
}

fn header(surface: &Surface, remark: &Remark<'_>) -> String {
    let std_m = if surface.std_m.is_some() { "property float std_m\n" } else { "" };
    format!(
        "ply\nformat binary_little_endian 1.0\n\
         comment {}\n\
         comment {}\n\
         comment uncertainty in 0..1, as quality and as colour too\n\
         element vertex {}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property float uncertainty\nproperty float quality\n{std_m}\
         element face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        remark.origin(),
        remark.units(),
        surface.mesh.vertices.len(),
        surface.mesh.faces.len(),
    )
}

#[cfg(test)]
mod tests {
    use ply_rs_bw::parser::Parser;
    use ply_rs_bw::ply::{DefaultElement, Ply, Property};

    use super::*;
    use crate::mesh_format::tests::{HOSTILE, REMARK, tetrahedron};

    fn parse(file: &[u8]) -> Ply<DefaultElement> {
        Parser::<DefaultElement>::new().read_ply(&mut std::io::Cursor::new(file)).unwrap()
    }

    #[test]
    fn an_independent_reader_finds_vertices_faces_and_uncertainties() {
        let surface = tetrahedron();
        let ply = parse(&write(&surface, &REMARK));
        let vertices = &ply.payload["vertex"];
        for (index, vertex) in surface.mesh.vertices.iter().enumerate() {
            assert_eq!(vertices[index]["x"], Property::Float(vertex.x as f32));
            assert_eq!(vertices[index]["z"], Property::Float(vertex.z as f32));
            let uncertainty = Property::Float(surface.uncertainty[index] as f32);
            assert_eq!(vertices[index]["uncertainty"], uncertainty);
            assert_eq!(vertices[index]["quality"], uncertainty, "MeshLab's name");
        }
        assert!(!vertices[0].contains_key("std_m"));
        assert_eq!(ply.payload["face"][3]["vertex_indices"], Property::ListInt(vec![1, 2, 3]));
        assert_eq!(ply.header.comments[0], "Palpate, session mug, revision 7");
        assert_eq!(ply.header.comments[1], "unit m, in the frame base");
    }

    #[test]
    fn a_frame_cannot_break_the_header() {
        let ply = parse(&write(&tetrahedron(), &HOSTILE));
        assert_eq!(ply.payload["vertex"].len(), 4);
        assert_eq!(ply.header.comments.len(), 3);
    }

    #[test]
    fn certain_is_dark_and_a_guess_is_yellow() {
        let ply = parse(&write(&tetrahedron(), &REMARK));
        let colours: Vec<[Property; 3]> = ply.payload["vertex"]
            .iter()
            .map(|vertex| ["red", "green", "blue"].map(|part| vertex[part].clone()))
            .collect();
        let expected = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [253, 231, 37]];
        assert_eq!(colours, expected.map(|colour| colour.map(Property::UChar)));
    }

    #[test]
    fn deviations_become_a_property_when_they_are_known() {
        let mut surface = tetrahedron();
        surface.std_m = Some(vec![0.001, 0.002, 0.003, 0.004]);
        let ply = parse(&write(&surface, &REMARK));
        assert_eq!(ply.payload["vertex"][2]["std_m"], Property::Float(0.003));
    }
}
