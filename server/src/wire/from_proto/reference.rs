//! A true surface as a file: what is said of it, and the mesh that is in it.

use palpate_core::evidence::MAX_COORDINATE_M;
use palpate_core::geometry::TriangleMesh;
use palpate_core::mesh_file::{self, MeshFormat};
use palpate_proto::{Bytes, v1};

use super::non_finite;
use crate::error::Error;

/// Where a caller wrote the parts of a reference mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReferenceNames {
    pub(crate) mesh: &'static str,
    pub(crate) format: &'static str,
}

/// A file with a true surface, which was not looked into yet.
#[derive(Clone, Debug)]
pub(crate) struct ReferenceFile {
    pub(crate) bytes: Bytes,
    pub(crate) format: MeshFormat,
    pub(crate) metres_per_unit: f64,
}

/// Checks what is said of a file, in passing.
///
/// # Errors
/// There is none, its format cannot be, or the unit is none.
pub(crate) fn reference_file(
    bytes: Bytes,
    format: i32,
    metres_per_unit: f64,
    names: ReferenceNames,
) -> Result<ReferenceFile, Error> {
    if bytes.is_empty() {
        return Err(Error::field(names.mesh, "is empty: send a PLY, STL or OBJ file"));
    }
    let said = v1::MeshFormat::try_from(format).ok();
    let format = match said {
        Some(v1::MeshFormat::Ply) => MeshFormat::Ply,
        Some(v1::MeshFormat::Stl) => MeshFormat::Stl,
        Some(v1::MeshFormat::Obj) => MeshFormat::Obj,
        Some(v1::MeshFormat::Unspecified) => MeshFormat::of(&bytes).ok_or_else(|| {
            Error::field(names.mesh, "is no PLY, STL or OBJ file by its first bytes: say its format")
        })?,
        Some(v1::MeshFormat::Raw | v1::MeshFormat::Glb) | None => {
            return Err(Error::field(names.format, "is no format of a reference mesh: send PLY, STL or OBJ"));
        }
    };
    let metres_per_unit = if metres_per_unit == 0.0 { 1.0 } else { metres_per_unit };
    let field = "metres_per_unit";
    if !metres_per_unit.is_finite() {
        return Err(non_finite(field, format!("{metres_per_unit} is not a finite number")));
    }
    if metres_per_unit < 0.0 {
        return Err(Error::field(
            field,
            format!("{metres_per_unit} is not above 0: 0.001 is for millimetres"),
        ));
    }
    Ok(ReferenceFile { bytes, format, metres_per_unit })
}

/// The surface in a file, in metres and outward wound, of at most `most` vertices and triangles.
///
/// # Errors
/// The file cannot be read, is too large, or has no surface within a workspace.
pub(crate) fn reference_mesh(file: &ReferenceFile, most: usize, field: &str) -> Result<TriangleMesh, Error> {
    let ReferenceFile { bytes, format, metres_per_unit } = file;
    let mut mesh =
        mesh_file::read(bytes, *format, most).map_err(|error| Error::field(field, error.to_string()))?;
    if mesh.faces.is_empty() {
        return Err(Error::field(
            field,
            "has no faces: a point cloud cannot be compared with, send a triangle mesh",
        ));
    }
    mesh.vertices.iter_mut().for_each(|vertex| vertex.coords *= *metres_per_unit);
    if let Some(far) =
        mesh.vertices.iter().flat_map(|vertex| vertex.iter()).find(|x| x.abs() > MAX_COORDINATE_M)
    {
        let description = format!("reaches {far} m, beyond {MAX_COORDINATE_M} m: is metres_per_unit 0.001?");
        return Err(non_finite(field, description));
    }
    // Some tools wind faces the other way; distances do not mind, and volumes would be negative.
    if mesh.volume() < 0.0 {
        mesh.faces.iter_mut().for_each(|face| face.swap(1, 2));
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: ReferenceNames = ReferenceNames { mesh: "mesh", format: "format" };
    const INWARD: &str = "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 100\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n";

    fn read(text: &'static str, metres_per_unit: f64) -> Result<TriangleMesh, Error> {
        let file = reference_file(Bytes::from(text), 0, metres_per_unit, NAMES)?;
        reference_mesh(&file, 10, "mesh")
    }

    #[test]
    fn a_file_in_millimetres_that_is_wound_inwards_gives_an_outward_surface_in_metres() {
        let mesh = read(INWARD, 0.001).unwrap();
        assert!((mesh.volume() - 1e-3 / 6.0).abs() < 1e-9);
    }

    #[test]
    fn what_cannot_be_a_reference_is_refused_by_its_field() {
        let refused = |text, metres_per_unit| {
            let error = read(text, metres_per_unit).unwrap_err();
            (error.fields()[0].field.clone(), error.to_string())
        };
        assert!(refused("", 0.0).1.contains("is empty"));
        assert!(refused("glTF", 0.0).1.contains("say its format"));
        assert_eq!(refused(INWARD, -1.0).0, "metres_per_unit");
        assert_eq!(refused(INWARD, f64::NAN).0, "metres_per_unit");
        assert!(refused(INWARD, 1e6).1.contains("beyond 10000 m"));
        assert!(refused("v 0 0 0\n", 0.0).1.contains("no faces"));
        let raw = reference_file(Bytes::from(INWARD), v1::MeshFormat::Raw.into(), 0.0, NAMES).unwrap_err();
        assert_eq!(raw.fields()[0].field, "format");
        let file = reference_file(Bytes::from(INWARD), 0, 0.0, NAMES).unwrap();
        assert!(reference_mesh(&file, 3, "mesh").unwrap_err().to_string().contains("more than 3"));
    }
}
