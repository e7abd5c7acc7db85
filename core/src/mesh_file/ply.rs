//! PLY, ASCII and binary.

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

use super::{LONGEST_LINE_BYTES, MeshFileError, MeshFormat, check_count, check_lines, malformed};
use crate::geometry::{Point, TriangleMesh};

const END: &[u8] = b"end_header";

pub(super) fn read(bytes: &[u8], most: usize) -> Result<TriangleMesh, MeshFileError> {
    let head = &bytes[..bytes.len().min(LONGEST_LINE_BYTES)];
    if !head.windows(END.len()).any(|window| window == END) {
        return Err(bad(&format!("there is no end_header within {LONGEST_LINE_BYTES} bytes")));
    }
    let parser = Parser::<Element>::new();
    let mut reader = Reader::new(bytes);
    let header = parser.read_header(&mut reader).map_err(|error| bad(&error))?;
    check(&header, most)?;
    if header.encoding == Encoding::Ascii {
        check_lines(MeshFormat::Ply, bytes)?;
    }
    let mut mesh = TriangleMesh::default();
    let mut faces = Vec::new();
    for (name, element) in &header.elements {
        let rows = parser.read_payload_for_element(&mut reader, element, &header);
        let rows = rows.map_err(|error| bad(&error))?;
        match name.as_str() {
            "vertex" => mesh.vertices = rows.iter().map(|row| Point::from(row.place)).collect(),
            "face" => faces = rows,
            _ => {}
        }
    }
    for face in faces {
        add_polygon(&mut mesh, &face.corners)?;
        check_count("triangles", mesh.faces.len(), most)?;
    }
    Ok(mesh)
}

fn bad(reason: &impl ToString) -> MeshFileError {
    malformed(MeshFormat::Ply, reason)
}

/// Refuses a file that declares more than there may be, or no mesh.
fn check(header: &Header, most: usize) -> Result<(), MeshFileError> {
    let counts = || header.elements.iter().map(|(_, element)| element.count);
    // Elements may take no bytes at all, so what is declared is bounded and not only what is there.
    counts().try_for_each(|count| check_count("elements", count, most))?;
    check_count("elements", counts().fold(0, usize::saturating_add), most.saturating_mul(3))?;
    let element =
        |name: &str| header.elements.iter().find(|(known, _)| *known == name).map(|(_, element)| element);
    if let Some(vertex) = element("vertex").filter(|element| element.count > 0) {
        for name in ["x", "y", "z"] {
            if !has(vertex, name, &is_float) {
                return Err(bad(&format!("a vertex has no number {name} (float or double)")));
            }
        }
    }
    match element("face").filter(|element| element.count > 0) {
        Some(face) if !LISTS.iter().any(|name| has(face, name, &is_list)) => {
            Err(bad(&"a face has no list vertex_indices"))
        }
        _ => Ok(()),
    }
}

/// What the list of a face's corners is called.
const LISTS: [&str; 2] = ["vertex_indices", "vertex_index"];

fn has(element: &ElementDef, name: &str, fits: &dyn Fn(&PropertyType) -> bool) -> bool {
    element.properties.iter().any(|(known, property)| known == name && fits(&property.data_type))
}

fn is_float(data_type: &PropertyType) -> bool {
    matches!(data_type, PropertyType::Scalar(ScalarType::Float | ScalarType::Double))
}

fn is_list(data_type: &PropertyType) -> bool {
    !matches!(
        data_type,
        PropertyType::Scalar(_) | PropertyType::List(_, ScalarType::Float | ScalarType::Double)
    )
}

/// A vertex or a face; whatever else an element says is dropped as it is read.
#[derive(Debug)]
struct Element {
    place: [f64; 3],
    /// One that cannot be is beyond all vertices.
    corners: Vec<u32>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self { place: [0.0; 3], corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ if LISTS.contains(&name) => {
                self.corners = corners(&property).unwrap_or_default();
                return PropertyAccessResult::Set;
            }
            _ => return PropertyAccessResult::Ignored,
        };
        self.place[axis] = match property {
            Property::Float(value) => f64::from(value),
            Property::Double(value) => value,
            // Of an element that is no vertex.
            _ => return PropertyAccessResult::Ignored,
        };
        PropertyAccessResult::Set
    }
}

fn corners(property: &Property) -> Option<Vec<u32>> {
    fn indices<T: Copy>(list: &[T]) -> Vec<u32>
    where
        u32: TryFrom<T>,
    {
        list.iter().map(|&index| u32::try_from(index).unwrap_or(u32::MAX)).collect()
    }
    match property {
        Property::ListChar(list) => Some(indices(list)),
        Property::ListUChar(list) => Some(indices(list)),
        Property::ListShort(list) => Some(indices(list)),
        Property::ListUShort(list) => Some(indices(list)),
        Property::ListInt(list) => Some(indices(list)),
        Property::ListUInt(list) => Some(list.clone()),
        _ => None,
    }
}

/// Splits a polygon into a fan of triangles.
fn add_polygon(mesh: &mut TriangleMesh, corners: &[u32]) -> Result<(), MeshFileError> {
    let known = mesh.vertices.len();
    if let Some(corner) = corners.iter().find(|&&corner| corner as usize >= known) {
        return Err(bad(&format!("a face refers to vertex {corner} of {known}")));
    }
    for pair in corners.get(1..).unwrap_or_default().windows(2) {
        mesh.faces.push([corners[0], pair[0], pair[1]]);
    }
    Ok(())
}
