//! Surfaces as files and packed arrays, and clouds of visual points out of them.
//!
//! Pure functions between bytes and the core's types.
//! All lengths are metres in the session's frame; all packed numbers are little-endian.

mod obj;
mod ply;
mod points;
mod raw;
mod stl;

use palpate_core::reconstruction::Surface;

pub(crate) use points::{Cloud, Declared, Layout, PointEncoding, read_points};
pub(crate) use raw::{RawArrays, raw};

/// The file formats that a surface can be written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FileFormat {
    /// Binary PLY with `uncertainty`, and `std_m` where it is known, of each vertex, also as colour and `quality`.
    Ply,
    /// Wavefront OBJ: the shape alone, as text.
    Obj,
    /// Binary STL: the shape alone, as separate triangles.
    Stl,
}

impl FileFormat {
    /// The media type of such a file.
    pub(crate) fn content_type(self) -> &'static str {
        match self {
            Self::Ply => "model/ply",
            Self::Obj => "model/obj",
            Self::Stl => "model/stl",
        }
    }
}

/// Writes `surface` as a file; `revision` is noted in it where the format has room for a remark.
pub(crate) fn write_file(format: FileFormat, surface: &Surface, revision: i64) -> Vec<u8> {
    match format {
        FileFormat::Ply => ply::write(surface, revision),
        FileFormat::Obj => obj::write(surface, revision),
        FileFormat::Stl => stl::write(surface, revision),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use palpate_core::geometry::{Point, TriangleMesh};
    use palpate_core::reconstruction::Surface;

    /// A tetrahedron with a corner at the origin and three edges of 0.1 m along the axes.
    pub(crate) fn tetrahedron() -> Surface {
        let vertices = vec![
            Point::origin(),
            Point::new(0.1, 0.0, 0.0),
            Point::new(0.0, 0.1, 0.0),
            Point::new(0.0, 0.0, 0.1),
        ];
        let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let mesh = TriangleMesh { vertices, faces };
        Surface { mesh, uncertainty: vec![0.0, 0.25, 0.5, 1.0], std_m: None }
    }
}
