//! The checks that all evidence passes: finite, within a workspace, with a direction where one is
//! needed.

use crate::error::FieldError;
use crate::geometry::{Direction, Point, Vector};

/// No workspace is larger: coordinates beyond this are refused, in metres.
pub const MAX_COORDINATE_M: f64 = 1e4;

pub(crate) fn check_vector(field: &'static str, vector: &Vector) -> Result<(), FieldError> {
    if vector.iter().all(|x| x.abs() <= MAX_COORDINATE_M) {
        return Ok(());
    }
    let reason = format!(
        "({}, {}, {}) is not finite or beyond {MAX_COORDINATE_M}; units are SI",
        vector.x, vector.y, vector.z
    );
    Err(FieldError::non_finite(field, reason))
}

pub(crate) fn check_point(field: &'static str, point: &Point) -> Result<(), FieldError> {
    check_vector(field, &point.coords)
}

pub(crate) fn check_unit(field: &'static str, value: f64) -> Result<(), FieldError> {
    if (0.0..=1.0).contains(&value) {
        return Ok(());
    }
    let reason = format!("{value} is not between 0 and 1");
    Err(FieldError { field, reason, non_finite: !value.is_finite() })
}

pub(crate) fn check_direction(field: &'static str, vector: Vector) -> Result<Direction, FieldError> {
    check_vector(field, &vector)?;
    Direction::try_new(vector, 1e-9)
        .ok_or_else(|| FieldError::invalid(field, "has no direction: its length is zero"))
}
