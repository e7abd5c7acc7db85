//! Surfaces as files and packed arrays, and clouds of visual points out of them.
//!
//! Pure functions between bytes and the core's types.
//! All lengths are metres in the session's frame; all packed numbers are little-endian.

mod colour;
mod glb;
mod obj;
mod ply;
mod points;
mod raw;
mod stl;

use palpate_core::reconstruction::Surface;

pub(crate) use colour::Colormap;
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
    /// Binary glTF with `_UNCERTAINTY`, and `_STD_M` where it is known, of each vertex, and as a colour.
    Glb(Colormap),
}

/// What a file says of the surface in it, for people.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Remark<'a> {
    pub(crate) session_id: &'a str,
    pub(crate) frame_id: &'a str,
    pub(crate) revision: i64,
}

impl Remark<'_> {
    /// Whose surface it is.
    fn origin(&self) -> String {
        format!("Palpate, session {}, revision {}", plain(self.session_id), self.revision)
    }

    /// What its numbers are: names are written so that they cannot end a line, nor a header.
    fn units(&self) -> String {
        format!("unit m, in the frame {}", plain(self.frame_id))
    }
}

/// A text of printable ASCII characters only, the others being escaped.
fn plain(text: &str) -> String {
    let is_plain = |character: char| character.is_ascii_graphic() || character == ' ';
    text.chars()
        .map(
            |character| {
                if is_plain(character) {
                    character.to_string()
                } else {
                    character.escape_default().to_string()
                }
            },
        )
        .collect()
}

impl FileFormat {
    /// The media type of such a file.
    pub(crate) fn content_type(self) -> &'static str {
        match self {
            Self::Ply => "model/ply",
            Self::Obj => "model/obj",
            Self::Stl => "model/stl",
            Self::Glb(_) => "model/gltf-binary",
        }
    }
}

/// Writes `surface` as a file; `remark` is noted in it as far as the format has room.
pub(crate) fn write_file(format: FileFormat, surface: &Surface, remark: &Remark<'_>) -> Vec<u8> {
    match format {
        FileFormat::Ply => ply::write(surface, remark),
        FileFormat::Obj => obj::write(surface, remark),
        FileFormat::Stl => stl::write(surface, remark),
        FileFormat::Glb(colormap) => glb::write(surface, remark, colormap),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use palpate_core::geometry::{Point, TriangleMesh};
    use palpate_core::reconstruction::Surface;

    use super::{Remark, plain};

    pub(crate) const REMARK: Remark<'_> = Remark { session_id: "mug", frame_id: "base", revision: 7 };

    /// A frame whose name would end the header of any text format.
    pub(crate) const HOSTILE: Remark<'_> =
        Remark { session_id: "mug", frame_id: "base\nend_header\r\n\u{2028}v 1 2 3", revision: 7 };

    #[test]
    fn a_name_cannot_end_a_line() {
        assert_eq!(plain(HOSTILE.frame_id), r"base\nend_header\r\n\u{2028}v 1 2 3");
        assert_eq!(plain("Tisch 2, \u{e4}u\u{df}en"), r"Tisch 2, \u{e4}u\u{df}en");
    }

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
