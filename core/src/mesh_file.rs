//! Triangle meshes out of files: PLY, STL and OBJ.
//!
//! Bytes come in and a mesh goes out, so nothing is opened here. What a file declares is checked before
//! anything is made of it: a header of a few bytes costs as much as a few bytes.

mod obj;
mod ply;
mod stl;

use crate::geometry::TriangleMesh;

/// Bytes of the longest line of a text, and of a PLY file's header.
const LONGEST_LINE_BYTES: usize = 1 << 16;
/// Bytes of what a parser says that are passed on.
const REASON_BYTES: usize = 200;

/// How a mesh is written in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// PLY, ASCII or binary: `x`, `y`, `z` of each vertex, `vertex_indices` or `vertex_index` of each face.
    Ply,
    /// STL, ASCII or binary.
    Stl,
    /// Wavefront OBJ: its `v` and `f` lines.
    Obj,
}

impl MeshFormat {
    /// The format that a file seems to have by its bytes; `None` where it is none of these.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            Some(Self::Ply)
        } else if stl::is_binary(bytes) || bytes.starts_with(b"solid") {
            Some(Self::Stl)
        } else {
            obj::has_vertices(bytes).then_some(Self::Obj)
        }
    }

    /// Its name, as people write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ply => "PLY",
            Self::Stl => "STL",
            Self::Obj => "OBJ",
        }
    }
}

/// Why a file gives no mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshFileError {
    /// The content does not follow its format.
    #[error("cannot be read as {}: {reason}", .format.name())]
    Malformed {
        /// The format.
        format: MeshFormat,
        /// What was found.
        reason: String,
    },
    /// More than the caller takes.
    #[error("has more than {most} {what}: make it coarser")]
    TooMany {
        /// Vertices, triangles or elements.
        what: &'static str,
        /// How many there may be.
        most: usize,
    },
}

/// Reads a file with at most `most` vertices and as many triangles; polygons become fans of triangles. Coordinates are
/// finite, and in the file's own unit.
///
/// # Errors
/// The file does not follow its format, or is larger than that.
pub fn read(bytes: &[u8], format: MeshFormat, most: usize) -> Result<TriangleMesh, MeshFileError> {
    let mesh = match format {
        MeshFormat::Ply => ply::read(bytes, most)?,
        MeshFormat::Stl => stl::read(bytes, most)?,
        MeshFormat::Obj => obj::read(bytes, most)?,
    };
    check_count("vertices", mesh.vertices.len(), most)?;
    check_count("triangles", mesh.faces.len(), most)?;
    match mesh.vertices.iter().position(|vertex| !vertex.iter().all(|x| x.is_finite())) {
        Some(vertex) => Err(malformed(format, &format!("vertex {vertex} is not a finite number"))),
        None => Ok(mesh),
    }
}

fn malformed(format: MeshFormat, reason: &impl ToString) -> MeshFileError {
    // Parsers echo the line that they fail on.
    let reason = reason.to_string();
    let first = reason.lines().next().unwrap_or_default();
    let reason = first[..first.floor_char_boundary(REASON_BYTES)].to_owned();
    MeshFileError::Malformed { format, reason }
}

fn check_count(what: &'static str, count: usize, most: usize) -> Result<(), MeshFileError> {
    if count > most { Err(MeshFileError::TooMany { what, most }) } else { Ok(()) }
}

/// Refuses a text with a line that no mesh has: parsers hold a line in pieces many times its size.
fn check_lines(format: MeshFormat, text: &[u8]) -> Result<(), MeshFileError> {
    if text.split(|&byte| byte == b'\n').all(|line| line.len() <= LONGEST_LINE_BYTES) {
        return Ok(());
    }
    Err(malformed(format, &format!("a line has more than {LONGEST_LINE_BYTES} bytes")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Far more than any file here has.
    const MANY: usize = 1000;

    const OBJ: &str = "# a tetrahedron\no corner\nv 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nvt 0 0\n\
                       usemtl red\nf 1/1 3/1 2/1\nf 1//9 2 4\r\nf 1 4 3\nf -3 -2 -1\n";
    const CORNERS: [[f32; 3]; 4] = [[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
    const FACES: [[u8; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    const PLY_HEADER: &str = "ply\nformat binary_little_endian 1.0\ncomment a tetrahedron\n\
                              element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                              property uchar red\nelement edge 1\nproperty int length\n\
                              element face 4\nproperty list uchar int vertex_indices\nend_header\n";

    fn binary_ply(header: &str) -> Vec<u8> {
        let mut bytes = header.as_bytes().to_vec();
        for corner in CORNERS {
            corner.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
            bytes.push(200);
        }
        bytes.extend([7; 4]);
        for face in FACES {
            bytes.push(3);
            face.iter().for_each(|&vertex| bytes.extend(i32::from(vertex).to_le_bytes()));
        }
        bytes
    }

    fn ascii_ply() -> Vec<u8> {
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n\
         element face 4\nproperty list uchar uint vertex_index\nend_header\n\
         0 0 0\n0.1 0 0\n0 0.1 0\n0 0 0.1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
            .into()
    }

    fn binary_stl(title: &str) -> Vec<u8> {
        let mut bytes = title.as_bytes().to_vec();
        bytes.resize(80, b' ');
        bytes.extend(4_u32.to_le_bytes());
        for face in FACES {
            bytes.extend([0; 12]);
            face.iter()
                .flat_map(|&vertex| CORNERS[usize::from(vertex)])
                .for_each(|x| bytes.extend(x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn ascii_stl(title: &str) -> Vec<u8> {
        let facet = |face: [u8; 3]| {
            let corner = |vertex: u8| {
                let [x, y, z] = CORNERS[usize::from(vertex)];
                format!("vertex {x} {y} {z}\n")
            };
            format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", face.map(corner).concat())
        };
        format!("{title}\n{}endsolid\n", FACES.map(facet).concat()).into()
    }

    fn every_format() -> Vec<(MeshFormat, Vec<u8>)> {
        vec![
            (MeshFormat::Obj, OBJ.into()),
            (MeshFormat::Ply, binary_ply(PLY_HEADER)),
            (MeshFormat::Ply, ascii_ply()),
            (MeshFormat::Stl, binary_stl("made by a test")),
            (MeshFormat::Stl, binary_stl("solid in name only")),
            (MeshFormat::Stl, ascii_stl("solid corner")),
            (MeshFormat::Stl, ascii_stl("solid")),
        ]
    }

    fn refusal(bytes: &[u8], format: MeshFormat) -> String {
        read(bytes, format, MANY).unwrap_err().to_string()
    }

    #[test]
    fn every_format_is_known_by_its_bytes_and_gives_the_same_solid() {
        for (format, bytes) in every_format() {
            assert_eq!(MeshFormat::of(&bytes), Some(format));
            let mesh = read(&bytes, format, MANY).unwrap();
            assert_eq!((mesh.vertices.len(), mesh.faces.len()), (4, 4), "{format:?}");
            assert!((mesh.volume() - 1e-3 / 6.0).abs() < 1e-9, "{format:?}");
        }
        for other in [&b"glTF\x02"[..], b"{\"vertices\": []}", b"", b"0 0 0\n1 0 0\n", b"\xff\xfe"] {
            assert_eq!(MeshFormat::of(other), None);
        }
    }

    #[test]
    fn polygons_become_fans() {
        let pyramid =
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nf 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n";
        assert_eq!(read(pyramid.as_bytes(), MeshFormat::Obj, MANY).unwrap().faces.len(), 6);
        let ply = String::from_utf8(ascii_ply()).unwrap().replace("3 0 2 1\n", "4 0 2 1 3\n");
        assert_eq!(read(ply.as_bytes(), MeshFormat::Ply, MANY).unwrap().faces.len(), 5);
    }

    #[test]
    fn what_a_header_declares_is_refused_before_it_costs_anything() {
        let replaced = |old: &str, new: &str| binary_ply(&PLY_HEADER.replace(old, new));
        let vast = refusal(&replaced("vertex 4", "vertex 18446744073709551615"), MeshFormat::Ply);
        assert!(vast.contains("more than 1000 elements"), "{vast}");
        // An element without properties takes no bytes, so a file can have as many as it likes.
        let header = PLY_HEADER.replace("element edge 1\nproperty int length\n", "element edge 4000000000\n");
        let free = refusal(&binary_ply(&header), MeshFormat::Ply);
        assert!(free.contains("more than 1000 elements"), "{free}");
        let endless = PLY_HEADER.replace("a tetrahedron", &"x".repeat(LONGEST_LINE_BYTES));
        assert!(refusal(&binary_ply(&endless), MeshFormat::Ply).contains("end_header"));
        let mut stl = binary_stl("");
        stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(refusal(&stl, MeshFormat::Stl).contains("more than 1000 triangles"));
        stl[80..84].copy_from_slice(&5_u32.to_le_bytes());
        assert!(refusal(&stl, MeshFormat::Stl).contains("334 bytes"));
    }

    #[test]
    fn what_is_too_much_is_refused_by_its_number() {
        for (format, bytes) in every_format() {
            let refused = read(&bytes, format, 3).unwrap_err();
            assert!(matches!(refused, MeshFileError::TooMany { most: 3, .. }), "{refused}");
        }
        let fan = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {}\n", "1 2 3 ".repeat(MANY));
        assert!(refusal(fan.as_bytes(), MeshFormat::Obj).contains("more than 1000 triangles"));
        let line = format!("v 0 0 0\nf {}\n", "1 ".repeat(LONGEST_LINE_BYTES));
        assert!(refusal(line.as_bytes(), MeshFormat::Obj).contains("a line has more than"));
    }

    #[test]
    fn what_does_not_follow_its_format_says_what_is_wrong() {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        for (bytes, format, reason) in [
            (OBJ.replace("f -3 -2 -1", "f 2 3 9").into_bytes(), MeshFormat::Obj, ""),
            (OBJ.replace("v 0 0 0\n", "v 0 0\n").into_bytes(), MeshFormat::Obj, "position"),
            (OBJ.replace("f -3", "f x").into_bytes(), MeshFormat::Obj, "face"),
            (text(ascii_ply()).replace("3 1 2 3", "3 1 2 4").into_bytes(), MeshFormat::Ply, "vertex 4 of 4"),
            (text(ascii_ply()).replace("3 1 2 3\n", "").into_bytes(), MeshFormat::Ply, "end of file"),
            (text(ascii_ply()).replace("double y", "double w").into_bytes(), MeshFormat::Ply, "number y"),
            (text(ascii_ply()).replace("vertex_index", "corners").into_bytes(), MeshFormat::Ply, "list"),
            (text(ascii_stl("solid a")).replace("outer", "inner").into_bytes(), MeshFormat::Stl, "loop"),
            (b"short".to_vec(), MeshFormat::Stl, "header"),
            (b"".to_vec(), MeshFormat::Ply, "end_header"),
        ] {
            let refused = refusal(&bytes, format);
            assert!(refused.contains(reason) && refused.len() < 300, "{reason}: {refused}");
        }
        let mut stl = binary_stl("");
        stl[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(refusal(&stl, MeshFormat::Stl).contains("vertex 0 is not a finite number"));
    }

    #[test]
    fn no_file_whatever_its_bytes_brings_a_parser_down() {
        // A stream of numbers that is the same each time, to break files with.
        let mut seed = 1_u32;
        let mut next = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            seed >> 8
        };
        for (format, bytes) in every_format() {
            for _ in 0..2000 {
                let mut broken = bytes.clone();
                for _ in 0..1 + next() % 4 {
                    let at = next() as usize % broken.len();
                    match next() % 3 {
                        0 => broken[at] = next() as u8,
                        1 => drop(broken.remove(at)),
                        _ => broken.insert(at, b"0 -/9\n"[next() as usize % 6]),
                    }
                }
                // Whatever comes of it, it comes back.
                drop(read(&broken, format, MANY));
            }
        }
    }
}
