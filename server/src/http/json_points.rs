//! Points as a script writes them in JSON, `[[x, y, z], ...]` or `[x, y, z, x, ...]`, beside base64.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};

use crate::error::Error;

/// Where the cloud is in a request to add a visual prior.
const FIELD: &str = "prior.points";

/// Replaces number arrays in `prior.points` of `body` by what the contract has: base64 of packed `f32`.
///
/// # Errors
/// Something other than numbers, or points that have not three coordinates.
pub(super) fn pack(body: &mut Value) -> Result<(), Error> {
    let Some(prior) = body.get_mut("prior").and_then(Value::as_object_mut) else { return Ok(()) };
    let Some(Value::Array(items)) = prior.get("points") else { return Ok(()) };
    let packed = BASE64_STANDARD.encode(packed_floats(items)?);
    prior.insert("points".into(), Value::String(packed));
    prior.entry("encoding").or_insert_with(|| json!("POINT_ENCODING_XYZ_F32_LE"));
    Ok(())
}

fn packed_floats(items: &[Value]) -> Result<Vec<u8>, Error> {
    let mut floats = Vec::with_capacity(items.len() * 12);
    for (index, item) in items.iter().enumerate() {
        match item.as_array().map(Vec::as_slice) {
            Some([x, y, z]) => {
                for coordinate in [x, y, z] {
                    floats.extend(float(coordinate, index)?.to_le_bytes());
                }
            }
            Some(other) => {
                let found = other.len();
                return Err(Error::field(
                    format!("{FIELD}[{index}]"),
                    format!("{found} coordinates, but a point has 3: x, y, z in metres"),
                ));
            }
            None => floats.extend(float(item, index)?.to_le_bytes()),
        }
    }
    Ok(floats)
}

fn float(value: &Value, index: usize) -> Result<f32, Error> {
    value.as_f64().map(|value| value as f32).ok_or_else(|| {
        Error::field(format!("{FIELD}[{index}]"), format!("{value} is not a number in metres"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed(points: &Value) -> Result<Value, Error> {
        let mut body = json!({ "prior": { "points": points } });
        pack(&mut body)?;
        Ok(body["prior"].take())
    }

    #[test]
    fn nested_and_flat_arrays_become_the_same_bytes() {
        let nested = packed(&json!([[0.5, 1, -2], [3, 4, 5e-1]])).unwrap();
        let flat = packed(&json!([0.5, 1, -2, 3, 4, 5e-1])).unwrap();
        assert_eq!(nested, flat);
        assert_eq!(nested["encoding"], "POINT_ENCODING_XYZ_F32_LE");
        let bytes = BASE64_STANDARD.decode(nested["points"].as_str().unwrap()).unwrap();
        assert_eq!(bytes[8..12], (-2.0_f32).to_le_bytes());
        assert_eq!(bytes.len(), 24);
    }

    #[test]
    fn base64_and_a_stated_encoding_stay_as_they_are() {
        let mut body = json!({ "prior": { "points": "AAAA", "encoding": "POINT_ENCODING_PLY" } });
        let before = body.clone();
        pack(&mut body).unwrap();
        assert_eq!(body, before);
    }

    #[test]
    fn what_is_no_point_is_named_by_its_index() {
        let field = |points: Value| packed(&points).unwrap_err().fields()[0].field.clone();
        assert_eq!(field(json!([[0, 0, 0], [1, 2]])), "prior.points[1]");
        assert_eq!(field(json!([[0, 0, 0], [1, 2, null]])), "prior.points[1]");
        assert_eq!(field(json!([0, 0, "1"])), "prior.points[2]");
    }
}
