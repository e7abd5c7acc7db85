//! Wavefront OBJ: places and faces. Materials, textures and the names of parts are of no interest to a finger.

use std::path::Path;

use super::{MeshFileError, MeshFormat, check_count, check_lines, malformed};
use crate::geometry::{Point, TriangleMesh};

pub(super) fn has_vertices(bytes: &[u8]) -> bool {
    bytes.split(|&byte| byte == b'\n').any(|line| line.starts_with(b"v ") || line.starts_with(b"v\t"))
}

pub(super) fn read(bytes: &[u8], most: usize) -> Result<TriangleMesh, MeshFileError> {
    check_lines(MeshFormat::Obj, bytes)?;
    let shape = shape_of(bytes, most)?;
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut shape.as_bytes(), &options, no_materials)
        .map_err(|error| malformed(MeshFormat::Obj, &error))?;
    let mut mesh = TriangleMesh::default();
    for model in models {
        let first = mesh.vertices.len() as u32;
        let (positions, _) = model.mesh.positions.as_chunks::<3>();
        let (corners, _) = model.mesh.indices.as_chunks::<3>();
        mesh.vertices.extend(positions.iter().map(|&position| Point::from(position.map(f64::from))));
        mesh.faces.extend(corners.iter().map(|corners| corners.map(|vertex| first + vertex)));
    }
    Ok(mesh)
}

/// The lines of vertices and faces alone, these without what they say of textures and normals: the parser keeps all
/// that it reads, and takes what is beside the shape on trust.
fn shape_of(bytes: &[u8], most: usize) -> Result<String, MeshFileError> {
    let mut shape = String::new();
    let (mut vertices, mut triangles) = (0, 0);
    for line in bytes.split(|&byte| byte == b'\n') {
        let is_face = match line {
            [b'v', b' ' | b'\t', ..] => false,
            [b'f', b' ' | b'\t', ..] => true,
            _ => continue,
        };
        let line = str::from_utf8(line).map_err(|error| malformed(MeshFormat::Obj, &error))?;
        if is_face {
            let corners =
                line.split_whitespace().skip(1).map(|corner| corner.split('/').next().unwrap_or(corner));
            let before = shape.len();
            shape.push('f');
            let mut count = 0_usize;
            for corner in corners {
                shape.push(' ');
                shape.push_str(corner);
                count += 1;
            }
            triangles += count.saturating_sub(2);
            if count < 3 {
                // A line or a point.
                shape.truncate(before);
                continue;
            }
        } else {
            shape.push_str(line);
            vertices += 1;
        }
        shape.push('\n');
        check_count("vertices", vertices, most)?;
        check_count("triangles", triangles, most)?;
    }
    Ok(shape)
}
