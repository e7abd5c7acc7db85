//! The numbers after a PLY file's header, as words or as bytes.

use super::header::{Element, Kind, Property};
use super::scalar::Scalar;
use crate::mesh_format::points::text::Tokens;

/// The numbers after a header, one after the other.
pub(super) enum Values<'a> {
    Ascii(Tokens<'a>),
    Binary { rest: &'a [u8], is_bigendian: bool },
}

impl Values<'_> {
    /// Reads one element: its x, y and z, NaN where it has none. All else is read over.
    pub(super) fn element(&mut self, element: &Element) -> Result<[f64; 3], String> {
        let mut vertex = [f64::NAN; 3];
        for Property { name, kind } in &element.properties {
            let axis = ["x", "y", "z"].iter().position(|axis| axis == name);
            match (kind, axis) {
                (Kind::Scalar(scalar), Some(axis)) if element.is_vertex() => {
                    vertex[axis] = self.number(*scalar)?;
                }
                (Kind::Scalar(scalar), _) => self.skip(*scalar, 1)?,
                (Kind::List { count, item }, _) => {
                    let length = self.number(*count)?;
                    if !(length >= 0.0 && length.fract() == 0.0 && length <= f64::from(u32::MAX)) {
                        return Err(format!("a list of length {length}"));
                    }
                    self.skip(*item, length as usize)?;
                }
            }
        }
        Ok(vertex)
    }

    fn number(&mut self, scalar: Scalar) -> Result<f64, String> {
        match self {
            // All but 32-bit floats are read as doubles, which hold every integer that PLY has.
            Self::Ascii(tokens) => tokens.number(scalar != Scalar::F32),
            Self::Binary { rest, is_bigendian } => {
                let size = scalar.bytes();
                let (number, after) = rest.split_at_checked(size).ok_or("it ends too early")?;
                let mut bytes = [0; 8];
                bytes[..size].copy_from_slice(number);
                if !*is_bigendian {
                    bytes[..size].reverse();
                }
                *rest = after;
                Ok(scalar.value(bytes))
            }
        }
    }

    fn skip(&mut self, scalar: Scalar, count: usize) -> Result<(), String> {
        match self {
            Self::Ascii(tokens) => (0..count).try_for_each(|_| tokens.word().map(drop)),
            Self::Binary { rest, .. } => {
                let bytes = count.checked_mul(scalar.bytes());
                *rest = bytes.and_then(|bytes| rest.get(bytes..)).ok_or("it ends too early")?;
                Ok(())
            }
        }
    }
}
