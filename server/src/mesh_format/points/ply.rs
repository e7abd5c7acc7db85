//! PLY, text or binary, whose element `vertex` has float or double properties x, y, z.
//!
//! The text of a PLY file is a stream of words: where its lines break says nothing, as programs differ in it.

mod header;
mod scalar;
mod values;

use palpate_core::geometry::Point;

/// Reads the vertices, not finite ones included.
///
/// # Errors
/// The bytes are no such file, or promise more than they hold.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<Point>, String> {
    let (elements, mut values) = header::read(bytes)?;
    // Elements come in the order of the header; those after the vertices are never looked at.
    for element in elements {
        let mut points = Vec::with_capacity(if element.is_vertex() { element.count } else { 0 });
        for index in 0..element.count {
            let vertex = values.element(&element).map_err(|reason| {
                format!("{} {index} of {} in the PLY file: {reason}", element.name, element.count)
            })?;
            if element.is_vertex() {
                points.push(Point::from_slice(&vertex));
            }
        }
        if element.is_vertex() {
            return Ok(points);
        }
    }
    Err("the PLY file has no element 'vertex'".into())
}

#[cfg(test)]
mod tests;
