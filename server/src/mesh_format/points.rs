//! Clouds of visual points out of bytes that somebody sent: nothing in them is believed before it is checked.

use std::io::Cursor;

use palpate_core::error::FieldError;
use palpate_core::geometry::Point;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

/// The field that every error here names.
const FIELD: &str = "points";
const BYTES_A_POINT: usize = 12;

/// How a cloud is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PointEncoding {
    /// Little-endian `f32` x, y, z, x, y, z, ...
    XyzF32Le,
    /// PLY, text or binary, whose element `vertex` has float or double properties x, y, z.
    Ply,
}

/// Reads a cloud, in metres. Whether the numbers make sense is for the core to say.
///
/// # Errors
/// Bytes that are not what `encoding` says; the error names the field `points`.
pub(crate) fn read_points(encoding: PointEncoding, bytes: &[u8]) -> Result<Vec<Point>, FieldError> {
    match encoding {
        PointEncoding::XyzF32Le => read_xyz_f32_le(bytes),
        PointEncoding::Ply => read_ply(bytes).map_err(|reason| FieldError::invalid(FIELD, reason)),
    }
}

fn read_xyz_f32_le(bytes: &[u8]) -> Result<Vec<Point>, FieldError> {
    let (triples, rest) = bytes.as_chunks::<BYTES_A_POINT>();
    if !rest.is_empty() {
        let reason = format!(
            "{} bytes are no whole number of points: each takes {BYTES_A_POINT} bytes, x, y, z as f32",
            bytes.len()
        );
        return Err(FieldError::invalid(FIELD, reason));
    }
    Ok(triples.iter().map(point_from_le).collect())
}

fn point_from_le(bytes: &[u8; BYTES_A_POINT]) -> Point {
    let (numbers, _) = bytes.as_chunks::<4>();
    Point::from_slice(&[0, 1, 2].map(|axis| f64::from(f32::from_le_bytes(numbers[axis]))))
}

fn read_ply(bytes: &[u8]) -> Result<Vec<Point>, String> {
    let parser = Parser::<Vertex>::new();
    let mut reader = Reader::new(Cursor::new(bytes));
    let header =
        parser.read_header(&mut reader).map_err(|error| format!("no PLY header: {}", brief(&error)))?;
    check_header(&header, bytes.len() - reader.get_ref().position() as usize)?;
    // Elements come in the order of the header; those after the vertices are never looked at.
    for (name, element) in &header.elements {
        let vertices = parser
            .read_payload_for_element(&mut reader, element, &header)
            .map_err(|error| format!("the PLY file is damaged: {}", brief(&error)))?;
        if name == "vertex" {
            return Ok(vertices.into_iter().map(|vertex| Point::from_slice(&vertex.xyz)).collect());
        }
    }
    Err("the PLY file has no element 'vertex'".into())
}

/// The parser's message without the quotation of the input that follows it, which may be of any length.
fn brief(error: &ParseError) -> String {
    error.to_string().lines().next().unwrap_or_default().to_owned()
}

/// Refuses a header that is no cloud, or that promises more than the `body_bytes` after it can hold.
fn check_header(header: &Header, body_bytes: usize) -> Result<(), String> {
    let Some(vertex) = header.elements.get("vertex") else {
        return Err("the PLY file has no element 'vertex'".into());
    };
    for axis in ["x", "y", "z"] {
        let data_type = vertex.properties.get(axis).map(|property| &property.data_type);
        if !matches!(data_type, Some(PropertyType::Scalar(ScalarType::Float | ScalarType::Double))) {
            return Err(format!("the PLY file's vertices need a float or double property '{axis}'"));
        }
    }
    for element in header.elements.values() {
        let least_bytes = element.count.checked_mul(least_element_bytes(element, header.encoding));
        // An element without properties takes no bytes, so no length would bound its count.
        if element.properties.is_empty() || least_bytes.is_none_or(|least| least > body_bytes) {
            return Err(format!(
                "the PLY header declares {} of element '{}', but only {body_bytes} bytes follow it",
                element.count, element.name
            ));
        }
        if element.name == "vertex" {
            break;
        }
    }
    Ok(())
}

/// What one element takes at the very least.
fn least_element_bytes(element: &ElementDef, encoding: Encoding) -> usize {
    let properties = element.properties.values().map(|property| &property.data_type);
    match encoding {
        // A digit each, and a blank between them; the last line needs no end.
        Encoding::Ascii => (2 * properties.count()).saturating_sub(1),
        Encoding::BinaryLittleEndian | Encoding::BinaryBigEndian => properties
            .map(|data_type| match data_type {
                PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => scalar_bytes(scalar),
            })
            .sum(),
    }
}

fn scalar_bytes(scalar: &ScalarType) -> usize {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// What is kept of an element: its place. All else is read over.
struct Vertex {
    xyz: [f64; 3],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { xyz: [f64::NAN; 3] }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let value = match property {
            Property::Float(value) => f64::from(value),
            Property::Double(value) => value,
            _ => return PropertyAccessResult::Ignored,
        };
        let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        self.xyz[axis] = value;
        PropertyAccessResult::Set
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_format::tests::tetrahedron;
    use crate::mesh_format::{FileFormat, write_file};

    fn ply(header: &str, body: &[u8]) -> Vec<u8> {
        [header.as_bytes(), body].concat()
    }

    fn reason(bytes: &[u8]) -> String {
        let error = read_points(PointEncoding::Ply, bytes).unwrap_err();
        assert_eq!(error.field, "points");
        error.reason
    }

    #[test]
    fn a_written_surface_is_read_back_as_its_vertices() {
        let surface = tetrahedron();
        let points = read_points(PointEncoding::Ply, &write_file(FileFormat::Ply, &surface, 1)).unwrap();
        assert_eq!(points.len(), 4);
        for (point, vertex) in points.iter().zip(&surface.mesh.vertices) {
            assert!((point - vertex).norm() < 1e-8);
        }
    }

    #[test]
    fn text_with_doubles_other_properties_and_elements_before_is_read() {
        let file = "ply\nformat ascii 1.0\ncomment made by hand\nelement camera 1\nproperty list uchar float view\n\
                    element vertex 2\nproperty uchar red\nproperty double z\nproperty double y\nproperty double x\n\
                    end_header\n2 0.5 0.25\n255 0.3 0.2 0.1\n0 -3 2e-1 1\n";
        let points = read_points(PointEncoding::Ply, file.as_bytes()).unwrap();
        assert_eq!(points, [Point::new(0.1, 0.2, 0.3), Point::new(1.0, 0.2, -3.0)]);
    }

    #[test]
    fn big_endian_floats_are_read() {
        let header = "ply\nformat binary_big_endian 1.0\nelement vertex 1\n\
                      property float x\nproperty float y\nproperty float z\nend_header\n";
        let body: Vec<u8> = [1.0_f32, -2.0, 0.5].iter().flat_map(|x| x.to_be_bytes()).collect();
        let points = read_points(PointEncoding::Ply, &ply(header, &body)).unwrap();
        assert_eq!(points, [Point::new(1.0, -2.0, 0.5)]);
    }

    #[test]
    fn packed_floats_that_break_off_inside_a_point_are_refused() {
        let error = read_points(PointEncoding::XyzF32Le, &[0; 25]).unwrap_err();
        assert!(error.reason.starts_with("25 bytes are no whole number of points"), "{}", error.reason);
    }

    #[test]
    fn counts_beyond_the_bytes_are_refused_before_anything_is_read() {
        let xyz = "property float x\nproperty float y\nproperty float z\n";
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            for count in ["2", "4000000000", "18446744073709551615"] {
                let header = format!("ply\nformat {format} 1.0\nelement vertex {count}\n{xyz}end_header\n");
                assert!(reason(&ply(&header, b"1 2 ")).contains("only 4 bytes follow"), "{header}");
            }
            let empty = format!(
                "ply\nformat {format} 1.0\nelement nothing 18446744073709551615\nelement vertex 1\n{xyz}end_header\n"
            );
            assert!(reason(&ply(&empty, &[0; 40])).contains("element 'nothing'"), "{empty}");
        }
    }

    #[test]
    fn a_list_that_promises_more_than_there_is_is_refused() {
        let header = "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uint double corners\n\
                      element vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
        assert!(reason(&ply(header, &[0xff; 64])).contains("damaged"));
    }

    #[test]
    fn every_truncation_and_every_flipped_byte_gives_an_answer() {
        let file = write_file(FileFormat::Ply, &tetrahedron(), 1);
        let vertices_end = file.len() - 4 * 13;
        for length in 0..file.len() {
            let result = read_points(PointEncoding::Ply, &file[..length]);
            assert_eq!(result.is_ok(), length >= vertices_end, "cut to {length} bytes");
        }
        for index in 0..file.len() {
            let mut damaged = file.clone();
            damaged[index] ^= 0x15;
            let _ = read_points(PointEncoding::Ply, &damaged);
        }
    }

    #[test]
    fn what_is_no_cloud_is_refused_in_words() {
        assert!(reason(b"solid stl").contains("no PLY header"));
        let faces =
            "ply\nformat ascii 1.0\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n";
        assert!(reason(faces.as_bytes()).contains("no element 'vertex'"));
        let flat =
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n";
        assert!(reason(flat.as_bytes()).contains("'z'"));
        let counts = "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\nend_header\n1 2 3\n";
        assert!(reason(counts.as_bytes()).contains("float or double property 'x'"));
    }
}
