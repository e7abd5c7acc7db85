//! Packed little-endian arrays, the way clouds and meshes travel.

use palpate_proto::v1::{PointEncoding, RawMesh, Vector3, VisualPrior};

use crate::Error;

/// A visual prior from points in metres in the session's frame, and the camera's position if it is known.
///
/// Coordinates are sent as 32-bit floats: 0.1 micrometres of rounding at one metre from the frame's origin.
pub fn visual_prior(points: &[[f64; 3]], viewpoint: Option<[f64; 3]>) -> VisualPrior {
    let bytes: Vec<u8> =
        points.iter().flatten().flat_map(|&coordinate| (coordinate as f32).to_le_bytes()).collect();
    VisualPrior {
        encoding: PointEncoding::XyzF32Le.into(),
        points: bytes.into(),
        viewpoint: viewpoint.map(|[x, y, z]| Vector3 { x, y, z }),
        ..Default::default()
    }
}

/// Positions of the vertices, in metres in the session's frame.
///
/// # Errors
/// [`Error::Malformed`] when there are not three coordinates for each vertex.
pub fn positions(mesh: &RawMesh) -> Result<Vec<[f32; 3]>, Error> {
    let unpacked = unpack("positions_f32_le", &mesh.positions_f32_le)?;
    counted("positions_f32_le", unpacked, mesh.n_vertices)
}

/// Vertex indices of the triangles, counter-clockwise seen from outside.
///
/// Empty when the request said by `have_topology` that the caller has them.
///
/// # Errors
/// [`Error::Malformed`] when there are not three indices for each triangle, or one names no vertex.
pub fn faces(mesh: &RawMesh) -> Result<Vec<[u32; 3]>, Error> {
    if mesh.faces_u32_le.is_empty() {
        return Ok(Vec::new());
    }
    let bits: Vec<[u32; 3]> = unpack_words("faces_u32_le", &mesh.faces_u32_le)?;
    let faces = counted("faces_u32_le", bits, mesh.n_faces)?;
    match faces.iter().flatten().find(|&&index| index >= mesh.n_vertices) {
        None => Ok(faces),
        Some(index) => Err(Error::Malformed {
            what: "faces_u32_le",
            detail: format!("vertex {index} of {}", mesh.n_vertices),
        }),
    }
}

/// Uncertainty of each vertex, in [0, 1].
///
/// # Errors
/// [`Error::Malformed`] when there is not one for each vertex.
pub fn uncertainty(mesh: &RawMesh) -> Result<Vec<f32>, Error> {
    let unpacked = unpack::<1>("uncertainty_f32_le", &mesh.uncertainty_f32_le)?;
    let unpacked = counted("uncertainty_f32_le", unpacked, mesh.n_vertices)?;
    Ok(unpacked.into_iter().flatten().collect())
}

/// Standard deviation of the surface at each vertex along its normal, in metres.
///
/// Empty when the method does not estimate it.
///
/// # Errors
/// [`Error::Malformed`] when there is not one for each vertex.
pub fn std_m(mesh: &RawMesh) -> Result<Vec<f32>, Error> {
    if mesh.std_m_f32_le.is_empty() {
        return Ok(Vec::new());
    }
    let unpacked = unpack::<1>("std_m_f32_le", &mesh.std_m_f32_le)?;
    let unpacked = counted("std_m_f32_le", unpacked, mesh.n_vertices)?;
    Ok(unpacked.into_iter().flatten().collect())
}

/// Reads rows of `N` 32-bit floats.
fn unpack<const N: usize>(what: &'static str, bytes: &[u8]) -> Result<Vec<[f32; N]>, Error> {
    let words = unpack_words(what, bytes)?;
    Ok(words.into_iter().map(|row: [u32; N]| row.map(f32::from_bits)).collect())
}

/// Reads rows of `N` 32-bit words.
fn unpack_words<const N: usize>(what: &'static str, bytes: &[u8]) -> Result<Vec<[u32; N]>, Error> {
    let (words, rest) = bytes.as_chunks::<4>();
    let (rows, more) = words.as_chunks::<N>();
    if !rest.is_empty() || !more.is_empty() {
        return Err(Error::Malformed {
            what,
            detail: format!("{} bytes are no rows of {N} 32-bit values", bytes.len()),
        });
    }
    Ok(rows.iter().map(|row| row.map(u32::from_le_bytes)).collect())
}

/// Gives `rows` back if there are as many as the mesh says.
fn counted<T>(what: &'static str, rows: Vec<T>, expected: u32) -> Result<Vec<T>, Error> {
    if rows.len() == expected as usize {
        return Ok(rows);
    }
    Err(Error::Malformed { what, detail: format!("{} rows instead of {expected}", rows.len()) })
}

#[cfg(test)]
mod tests {
    use palpate_proto::v1::RawMesh;

    use super::{faces, positions, std_m, uncertainty, visual_prior};

    fn triangle() -> RawMesh {
        let corners = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.25, -1.0]];
        let pack_f32 =
            |values: &[f32]| -> Vec<u8> { values.iter().flat_map(|value| value.to_le_bytes()).collect() };
        RawMesh {
            n_vertices: 3,
            n_faces: 1,
            positions_f32_le: visual_prior(&corners, None).points,
            faces_u32_le: vec![0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0].into(),
            uncertainty_f32_le: pack_f32(&[0.0, 0.5, 1.0]).into(),
            ..Default::default()
        }
    }

    #[test]
    fn what_is_packed_is_unpacked_again() {
        let mesh = triangle();
        let expected = vec![[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.25, -1.0]];
        assert_eq!(positions(&mesh).unwrap(), expected);
        assert_eq!(faces(&mesh).unwrap(), vec![[0, 1, 2]]);
        assert_eq!(uncertainty(&mesh).unwrap(), vec![0.0, 0.5, 1.0]);
        assert_eq!(std_m(&mesh).unwrap(), Vec::<f32>::new());
    }

    #[test]
    fn arrays_that_do_not_fit_their_counts_are_refused_by_name() {
        let mut mesh = triangle();
        mesh.positions_f32_le.truncate(24);
        let error = positions(&mesh).unwrap_err().to_string();
        assert!(error.contains("positions_f32_le"), "{error}");
        assert!(error.contains("2 rows instead of 3"), "{error}");

        mesh.uncertainty_f32_le.truncate(11);
        let error = uncertainty(&mesh).unwrap_err().to_string();
        assert!(error.contains("11 bytes"), "{error}");
    }

    #[test]
    fn a_face_that_names_no_vertex_is_refused() {
        let mut mesh = triangle();
        mesh.faces_u32_le = vec![0, 0, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0].into();
        let error = faces(&mesh).unwrap_err().to_string();
        assert!(error.contains("vertex 3 of 3"), "{error}");
    }
}
