//! STL, ASCII and binary. Corners at exactly the same place become one vertex.

use std::io::Cursor;

use super::{MeshFileError, MeshFormat, check_count, check_lines, malformed};
use crate::geometry::{Point, TriangleMesh};

/// A title, and the number of triangles.
const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;

/// Whether a file is exactly as long as a binary one of its number of triangles. Its title may say "solid", as that of
/// an ASCII file does.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    declared(bytes).is_some_and(|(_, length)| length == bytes.len())
}

/// The number of triangles that a binary file declares, and how long it should be.
fn declared(bytes: &[u8]) -> Option<(usize, usize)> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?.first_chunk::<4>()?;
    let count = u32::from_le_bytes(*count) as usize;
    Some((count, count.checked_mul(TRIANGLE_BYTES)?.checked_add(HEADER_BYTES)?))
}

pub(super) fn read(bytes: &[u8], most: usize) -> Result<TriangleMesh, MeshFileError> {
    let text = bytes.strip_prefix(b"solid").filter(|_| !is_binary(bytes));
    let file = match text {
        Some(rest) => {
            check_lines(MeshFormat::Stl, bytes)?;
            // The parser insists on a title.
            let title = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
            [b"solid mesh", &rest[title..]].concat()
        }
        None => {
            check_length(bytes, most)?;
            // The parser would take this title for that of an ASCII file.
            let mut file = bytes.to_vec();
            file[..HEADER_BYTES - 4].fill(b' ');
            file
        }
    };
    let stl = stl_io::read_stl(&mut Cursor::new(file)).map_err(|error| malformed(MeshFormat::Stl, &error))?;
    check_count("triangles", stl.faces.len(), most)?;
    Ok(TriangleMesh {
        vertices: stl.vertices.iter().map(|vertex| Point::from(vertex.0.map(f64::from))).collect(),
        faces: stl.faces.iter().map(|face| face.vertices.map(|vertex| vertex as u32)).collect(),
    })
}

fn check_length(bytes: &[u8], most: usize) -> Result<(), MeshFileError> {
    let Some((count, length)) = declared(bytes) else {
        return Err(malformed(MeshFormat::Stl, &"it is shorter than the header of a binary file"));
    };
    check_count("triangles", count, most)?;
    if bytes.len() < length {
        let found = bytes.len();
        let reason = format!("{count} triangles take {length} bytes, and the file has {found}");
        return Err(malformed(MeshFormat::Stl, &reason));
    }
    Ok(())
}
