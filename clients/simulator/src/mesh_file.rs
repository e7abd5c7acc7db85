//! Objects from files: PLY, STL and OBJ, told apart by their ending. Units are metres.

use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

use palpate_core::geometry::{Point, TriangleMesh};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, ElementDef, Property};

use crate::body::{Body, BodyError};

/// The endings of the files that can be read.
pub const EXTENSIONS: [&str; 3] = ["ply", "stl", "obj"];

/// What makes a mesh of the bytes of a file.
type ReadMesh = fn(&[u8]) -> Result<TriangleMesh, MeshProblem>;

/// Why a file does not give an object.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct MeshFileError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: MeshProblem,
}

/// What is wrong with a mesh file.
#[derive(Debug, thiserror::Error)]
pub enum MeshProblem {
    /// The file cannot be opened.
    #[error("cannot be opened ({0})")]
    Unreadable(io::Error),
    /// The ending is not one of [`EXTENSIONS`].
    #[error("is not a .ply, .stl or .obj file")]
    UnknownFormat,
    /// The content does not follow its format.
    #[error("cannot be read as {format}: {reason}")]
    Malformed {
        /// PLY, STL or OBJ.
        format: &'static str,
        /// What the parser found.
        reason: String,
    },
    /// The scale is not a positive number.
    #[error("cannot be scaled by {0}: the scale must be a positive number")]
    BadScale(f64),
    /// The mesh is no solid.
    #[error(transparent)]
    NotASolid(#[from] BodyError),
}

/// Reads a closed mesh and scales it to metres.
///
/// # Errors
/// [`MeshFileError`] names the file and says what is wrong with it.
pub fn read(path: &Path, scale: f64) -> Result<Body, MeshFileError> {
    read_body(path, scale).map_err(|problem| MeshFileError { path: path.to_owned(), problem })
}

fn read_body(path: &Path, scale: f64) -> Result<Body, MeshProblem> {
    let extension = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let reader = reader(extension)?;
    check_scale(scale)?;
    let bytes = std::fs::read(path).map_err(MeshProblem::Unreadable)?;
    body(reader(&bytes)?, scale)
}

/// Reads a closed mesh out of the bytes of a file with this ending, one of [`EXTENSIONS`], and scales it to metres.
///
/// # Errors
/// What is wrong with the bytes, the ending or the scale.
pub fn parse(extension: &str, bytes: &[u8], scale: f64) -> Result<Body, MeshProblem> {
    let reader = reader(extension)?;
    check_scale(scale)?;
    body(reader(bytes)?, scale)
}

fn check_scale(scale: f64) -> Result<(), MeshProblem> {
    if scale.is_finite() && scale > 0.0 { Ok(()) } else { Err(MeshProblem::BadScale(scale)) }
}

/// What reads a file with this ending.
fn reader(extension: &str) -> Result<ReadMesh, MeshProblem> {
    match extension.to_ascii_lowercase().as_str() {
        "ply" => Ok(read_ply),
        "stl" => Ok(read_stl),
        "obj" => Ok(read_obj),
        _ => Err(MeshProblem::UnknownFormat),
    }
}

fn body(mut mesh: TriangleMesh, scale: f64) -> Result<Body, MeshProblem> {
    mesh.vertices.iter_mut().for_each(|vertex| vertex.coords *= scale);
    Ok(Body::new(&mesh)?)
}

fn malformed(format: &'static str, reason: &impl ToString) -> MeshProblem {
    MeshProblem::Malformed { format, reason: reason.to_string() }
}

fn read_ply(file: &[u8]) -> Result<TriangleMesh, MeshProblem> {
    let (parser, mut reader) = (Parser::<DefaultElement>::new(), Reader::new(file));
    let header = parser.read_header(&mut reader).map_err(|error| malformed("PLY", &error))?;
    // One without properties takes no bytes, so that a short file could declare any number of them.
    if let Some(element) = header.elements.values().find(|element| element.count > file.len()) {
        let ElementDef { name, count, .. } = element;
        let reason = format!("the file declares {count} of {name}, more than it has bytes");
        return Err(malformed("PLY", &reason));
    }
    let payload = parser.read_payload(&mut reader, &header).map_err(|error| malformed("PLY", &error))?;
    let elements = |name: &str| payload.get(name).map_or(&[][..], Vec::as_slice);
    let mut mesh = TriangleMesh::default();
    for vertex in elements("vertex") {
        let coordinate = |name: &str| {
            vertex
                .get(name)
                .and_then(scalar)
                .ok_or_else(|| malformed("PLY", &format!("a vertex has no number {name}")))
        };
        mesh.vertices.push(Point::new(coordinate("x")?, coordinate("y")?, coordinate("z")?));
    }
    for face in elements("face") {
        let corners = face
            .get("vertex_indices")
            .or_else(|| face.get("vertex_index"))
            .and_then(indices)
            .ok_or_else(|| malformed("PLY", &"a face has no list vertex_indices"))?;
        add_polygon(&mut mesh, &corners).map_err(|reason| malformed("PLY", &reason))?;
    }
    Ok(mesh)
}

fn scalar(property: &Property) -> Option<f64> {
    match property {
        Property::Float(value) => Some(f64::from(*value)),
        Property::Double(value) => Some(*value),
        _ => None,
    }
}

fn indices(property: &Property) -> Option<Vec<i64>> {
    match property {
        Property::ListChar(list) => Some(list.iter().copied().map(i64::from).collect()),
        Property::ListUChar(list) => Some(list.iter().copied().map(i64::from).collect()),
        Property::ListShort(list) => Some(list.iter().copied().map(i64::from).collect()),
        Property::ListUShort(list) => Some(list.iter().copied().map(i64::from).collect()),
        Property::ListInt(list) => Some(list.iter().copied().map(i64::from).collect()),
        Property::ListUInt(list) => Some(list.iter().copied().map(i64::from).collect()),
        _ => None,
    }
}

/// Splits a polygon into a fan of triangles.
fn add_polygon(mesh: &mut TriangleMesh, corners: &[i64]) -> Result<(), String> {
    let known = mesh.vertices.len();
    let corners: Vec<u32> = corners
        .iter()
        .map(|&corner| match u32::try_from(corner) {
            Ok(index) if (index as usize) < known => Ok(index),
            _ => Err(format!("a face refers to vertex {corner} of {known}")),
        })
        .collect::<Result<_, _>>()?;
    for pair in corners.get(1..).unwrap_or_default().windows(2) {
        mesh.faces.push([corners[0], pair[0], pair[1]]);
    }
    Ok(())
}

fn read_stl(file: &[u8]) -> Result<TriangleMesh, MeshProblem> {
    let stl = stl_io::read_stl(&mut Cursor::new(file)).map_err(|error| malformed("STL", &error))?;
    Ok(TriangleMesh {
        vertices: stl.vertices.iter().map(|vertex| Point::from(vertex.0.map(f64::from))).collect(),
        faces: stl.faces.iter().map(|face| face.vertices.map(|vertex| vertex as u32)).collect(),
    })
}

fn read_obj(mut file: &[u8]) -> Result<TriangleMesh, MeshProblem> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    // Materials are of no interest to a finger.
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let (models, _) =
        tobj::load_obj_buf(&mut file, &options, no_materials).map_err(|error| malformed("OBJ", &error))?;
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

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Write;

    use super::*;

    const OBJ_TETRAHEDRON: &str = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n\
         f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

    /// The unit pyramid of [`OBJ_TETRAHEDRON`] as corners of its faces.
    fn faces() -> Vec<[[f32; 3]; 3]> {
        let corner = [[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
        [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
            .map(|face: [usize; 3]| face.map(|vertex| corner[vertex]))
            .to_vec()
    }

    fn binary_stl() -> Vec<u8> {
        let mut bytes = vec![0; 80];
        bytes.extend(4_u32.to_le_bytes());
        for face in faces() {
            bytes.extend([0; 12]);
            face.iter().flatten().for_each(|x| bytes.extend(x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn binary_ply() -> Vec<u8> {
        let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\n\
            property float x\nproperty float y\nproperty float z\nproperty uchar red\n\
            element face 4\nproperty list uchar int vertex_indices\nend_header\n"
            .to_vec();
        for corner in [[0.0_f32; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]] {
            corner.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
            bytes.push(200);
        }
        for face in [[0_i32, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
            bytes.push(3);
            face.iter().for_each(|vertex| bytes.extend(vertex.to_le_bytes()));
        }
        bytes
    }

    fn read_bytes(name: &str, bytes: &[u8], scale: f64) -> Result<Body, MeshFileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        File::create(&path).unwrap().write_all(bytes).unwrap();
        read(&path, scale)
    }

    #[test]
    fn every_format_gives_the_same_solid() {
        let ascii_ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\n\
            property double y\nproperty double z\nelement face 4\n\
            property list uchar uint vertex_index\nend_header\n\
            0 0 0\n0.1 0 0\n0 0.1 0\n0 0 0.1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
        for (name, bytes) in [
            ("a.obj", OBJ_TETRAHEDRON.as_bytes().to_vec()),
            ("a.STL", binary_stl()),
            ("a.ply", binary_ply()),
            ("b.ply", ascii_ply.as_bytes().to_vec()),
        ] {
            let body = read_bytes(name, &bytes, 1.0).unwrap();
            assert_eq!(body.mesh().vertices.len(), 4, "{name}");
            assert!((body.mesh().volume() - 1e-3 / 6.0).abs() < 1e-9, "{name}");
        }
    }

    #[test]
    fn a_scale_turns_millimetres_into_metres() {
        let millimetres = OBJ_TETRAHEDRON.replace("0.1", "100");
        let error = read_bytes("a.obj", millimetres.as_bytes(), 1.0).unwrap_err();
        assert!(error.to_string().contains("--scale"), "{error}");
        let body = read_bytes("a.obj", millimetres.as_bytes(), 0.001).unwrap();
        assert!((body.mesh().volume() - 1e-3 / 6.0).abs() < 1e-9);
        assert!(read_bytes("a.obj", millimetres.as_bytes(), -1.0).is_err());
    }

    #[test]
    fn a_short_ply_file_that_declares_billions_of_vertices_is_refused_before_they_are_read() {
        for property in ["", "property float x\n"] {
            let header = "format binary_little_endian 1.0\nelement vertex 430000000076770\n";
            let file = format!("ply\n{header}{property}end_header\n");
            let refused = parse("ply", file.as_bytes(), 1.0).unwrap_err().to_string();
            assert!(refused.contains("430000000076770 of vertex"), "{refused}");
        }
    }

    #[test]
    fn polygons_become_fans() {
        let pyramid = "v 0 0 0\nv 0.1 0 0\nv 0.1 0.1 0\nv 0 0.1 0\nv 0.05 0.05 0.1\n\
            f 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n";
        assert_eq!(read_bytes("a.obj", pyramid.as_bytes(), 1.0).unwrap().mesh().faces.len(), 6);
    }

    #[test]
    fn errors_name_the_file_and_the_problem() {
        let missing = read(Path::new("no-such-file.ply"), 1.0).unwrap_err().to_string();
        assert!(missing.contains("no-such-file.ply") && missing.contains("cannot be opened"));
        let unknown = read_bytes("a.step", b"", 1.0).unwrap_err().to_string();
        assert!(unknown.contains(".ply, .stl or .obj"), "{unknown}");
        let cloud = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n\
            property float y\nproperty float z\nend_header\n0 0 0\n";
        let cloud = read_bytes("a.ply", cloud, 1.0).unwrap_err().to_string();
        assert!(cloud.contains("no faces"), "{cloud}");
        let out_of_range = String::from_utf8_lossy(&binary_ply()).replace("vertex 4", "vertex 3");
        assert!(read_bytes("a.ply", out_of_range.as_bytes(), 1.0).is_err());
        let open = OBJ_TETRAHEDRON.replace("f 2 3 4\n", "");
        let open = read_bytes("a.obj", open.as_bytes(), 1.0).unwrap_err().to_string();
        assert!(open.contains("not closed: 3 edges"), "{open}");
    }
}
