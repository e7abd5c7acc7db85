//! The header of a PLY file: which elements follow, and what each has.

use super::scalar::Scalar;
use super::values::Values;
use crate::limits::{FILE_ELEMENTS, FILE_PROPERTIES};
use crate::mesh_format::points::text::{HeaderLines, Tokens};

/// What a property holds.
#[derive(Clone, Debug)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

/// A named part of every element.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// So many things of a kind, such as vertices.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

/// The elements, and the numbers that follow.
///
/// # Errors
/// Bytes that are no such header, or that promise more than they hold.
pub(super) fn read(bytes: &[u8]) -> Result<(Vec<Element>, Values<'_>), String> {
    let mut lines = HeaderLines::new(bytes);
    let mut elements: Vec<Element> = Vec::new();
    let mut format = None;
    if !bytes.starts_with(b"ply") || lines.next()? != Some("ply") {
        return Err("no PLY header: the file does not begin with a line 'ply'".into());
    }
    loop {
        let line = lines.next()?.ok_or("no PLY header: it ends before a line 'end_header'")?;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let read = match *words.as_slice() {
            [] | ["comment" | "obj_info", ..] => Ok(()),
            ["end_header"] => break,
            ["format", name, "1.0"] => {
                format = Some(name);
                Ok(())
            }
            ["element", name, count] => element(&mut elements, name, count),
            ["property", ..] => property(&mut elements, &words[1..]),
            _ => Err("is none that PLY has".into()),
        };
        read.map_err(|reason: String| {
            let quoted: String = line.chars().take(60).collect();
            format!("no PLY header: line {} {quoted:?}: {reason}", lines.line())
        })?;
    }
    let body = lines.rest();
    let values = match format {
        Some("ascii") => Values::Ascii(Tokens::new(body, lines.line() + 1)),
        Some("binary_little_endian") => Values::Binary { rest: body, is_bigendian: false },
        Some("binary_big_endian") => Values::Binary { rest: body, is_bigendian: true },
        _ => {
            let formats = "ascii, binary_little_endian or binary_big_endian, version 1.0";
            return Err(format!("no PLY header: it names no format: {formats}"));
        }
    };
    check(&elements, matches!(values, Values::Ascii(_)), body.len())?;
    Ok((elements, values))
}

fn element(elements: &mut Vec<Element>, name: &str, count: &str) -> Result<(), String> {
    if elements.len() == FILE_ELEMENTS {
        return Err(format!("there are more than {FILE_ELEMENTS} elements, the limit"));
    }
    let count = count.parse().map_err(|_| "the number of elements is none")?;
    elements.push(Element { name: name.into(), count, properties: Vec::new() });
    Ok(())
}

fn property(elements: &mut [Element], words: &[&str]) -> Result<(), String> {
    let element = elements.last_mut().ok_or("a property belongs to an element")?;
    if element.properties.len() == FILE_PROPERTIES {
        return Err(format!("there are more than {FILE_PROPERTIES} properties, the limit"));
    }
    let (name, kind) = match *words {
        ["list", count, item, name] => {
            let count = Scalar::named(count)?;
            if matches!(count, Scalar::F32 | Scalar::F64) {
                return Err("the length of a list is an integer".into());
            }
            (name, Kind::List { count, item: Scalar::named(item)? })
        }
        [kind, name] => (name, Kind::Scalar(Scalar::named(kind)?)),
        _ => return Err("a property is 'property TYPE NAME' or 'property list TYPE TYPE NAME'".into()),
    };
    element.properties.push(Property { name: name.into(), kind });
    Ok(())
}

/// Refuses a header that is no cloud, or that promises more than the `body_bytes` after it can hold.
fn check(elements: &[Element], is_ascii: bool, body_bytes: usize) -> Result<(), String> {
    let Some(vertex) = elements.iter().find(|element| element.is_vertex()) else {
        return Err("the PLY file has no element 'vertex'".into());
    };
    for axis in ["x", "y", "z"] {
        let kind = vertex.properties.iter().find(|property| property.name == axis);
        if !matches!(kind.map(|property| &property.kind), Some(Kind::Scalar(Scalar::F32 | Scalar::F64))) {
            return Err(format!("the PLY file's vertices need a float or double property '{axis}'"));
        }
    }
    for element in elements {
        let least_bytes = element.count.checked_mul(element.least_bytes(is_ascii));
        // An element without properties takes no bytes, so no length would bound its count.
        if element.properties.is_empty() || least_bytes.is_none_or(|least| least > body_bytes) {
            return Err(format!(
                "the PLY header declares {} of element '{}', but only {body_bytes} bytes follow it",
                element.count, element.name
            ));
        }
        if element.is_vertex() {
            break;
        }
    }
    Ok(())
}

impl Element {
    /// Whether it is the one that is read.
    pub(super) fn is_vertex(&self) -> bool {
        self.name == "vertex"
    }

    /// What one of them takes at the very least.
    fn least_bytes(&self, is_ascii: bool) -> usize {
        if is_ascii {
            // A digit each, and a blank between them; the last one needs no end.
            return (2 * self.properties.len()).saturating_sub(1);
        }
        let first = |property: &Property| match property.kind {
            Kind::Scalar(scalar) | Kind::List { count: scalar, .. } => scalar.bytes(),
        };
        self.properties.iter().map(first).sum()
    }
}
