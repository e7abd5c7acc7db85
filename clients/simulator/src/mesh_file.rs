//! Objects from files: PLY, STL and OBJ, told apart by their ending. Units are metres.

use std::io;
use std::path::{Path, PathBuf};

use palpate_core::mesh_file::{self, MeshFileError as ContentError, MeshFormat};

use crate::body::{Body, BodyError};

/// The endings of the files that can be read.
pub const EXTENSIONS: [&str; 3] = ["ply", "stl", "obj"];

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
    #[error(transparent)]
    Malformed(#[from] ContentError),
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
    let format = format(path.extension().and_then(|ending| ending.to_str()).unwrap_or_default())?;
    check_scale(scale)?;
    let bytes = std::fs::read(path).map_err(MeshProblem::Unreadable)?;
    body(&bytes, format, scale)
}

/// Reads a closed mesh out of the bytes of a file with this ending, one of [`EXTENSIONS`], and scales it to metres.
///
/// # Errors
/// What is wrong with the bytes, the ending or the scale.
pub fn parse(extension: &str, bytes: &[u8], scale: f64) -> Result<Body, MeshProblem> {
    let format = format(extension)?;
    check_scale(scale)?;
    body(bytes, format, scale)
}

fn check_scale(scale: f64) -> Result<(), MeshProblem> {
    if scale.is_finite() && scale > 0.0 { Ok(()) } else { Err(MeshProblem::BadScale(scale)) }
}

/// The format of files with this ending.
fn format(extension: &str) -> Result<MeshFormat, MeshProblem> {
    match extension.to_ascii_lowercase().as_str() {
        "ply" => Ok(MeshFormat::Ply),
        "stl" => Ok(MeshFormat::Stl),
        "obj" => Ok(MeshFormat::Obj),
        _ => Err(MeshProblem::UnknownFormat),
    }
}

fn body(bytes: &[u8], format: MeshFormat, scale: f64) -> Result<Body, MeshProblem> {
    // Whatever a file declares, each vertex and each triangle takes some of its bytes.
    let mut mesh = mesh_file::read(bytes, format, bytes.len())?;
    mesh.vertices.iter_mut().for_each(|vertex| vertex.coords *= scale);
    Ok(Body::new(&mesh)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBJ_TETRAHEDRON: &str = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n\
         f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

    fn read_bytes(name: &str, bytes: &[u8], scale: f64) -> Result<Body, MeshFileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read(&path, scale)
    }

    #[test]
    fn elements_that_take_no_bytes_are_refused_before_they_are_read() {
        let file =
            b"ply\nformat binary_little_endian 1.0\nelement nothing 430000000076770\nelement vertex 4\n\
            property float x\nproperty float y\nproperty float z\nelement face 4\n\
            property list uchar int vertex_indices\nend_header\n";
        let refusal = parse("ply", file, 1.0).unwrap_err().to_string();
        assert!(refusal.contains("elements"), "{refusal}");
    }

    #[test]
    fn the_ending_says_the_format_in_any_case() {
        let body = read_bytes("a.OBJ", OBJ_TETRAHEDRON.as_bytes(), 1.0).unwrap();
        assert!((body.mesh().volume() - 1e-3 / 6.0).abs() < 1e-9);
        let other = read_bytes("a.ply", OBJ_TETRAHEDRON.as_bytes(), 1.0).unwrap_err().to_string();
        assert!(other.contains("a.ply: cannot be read as PLY"), "{other}");
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
    fn errors_name_the_file_and_the_problem() {
        let missing = read(Path::new("no-such-file.ply"), 1.0).unwrap_err().to_string();
        assert!(missing.contains("no-such-file.ply") && missing.contains("cannot be opened"));
        let unknown = read_bytes("a.step", b"", 1.0).unwrap_err().to_string();
        assert!(unknown.contains(".ply, .stl or .obj"), "{unknown}");
        let cloud = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n\
            property float y\nproperty float z\nend_header\n0 0 0\n";
        let cloud = read_bytes("a.ply", cloud, 1.0).unwrap_err().to_string();
        assert!(cloud.contains("no faces"), "{cloud}");
        let open = OBJ_TETRAHEDRON.replace("f 2 3 4\n", "");
        let open = read_bytes("a.obj", open.as_bytes(), 1.0).unwrap_err().to_string();
        assert!(open.contains("not closed: 3 edges"), "{open}");
    }
}
