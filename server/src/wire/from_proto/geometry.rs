//! Points, directions and poses.

use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use palpate_core::evidence::MAX_COORDINATE_M;
use palpate_core::geometry::{Point, Pose, Vector};
use palpate_proto::v1;

use super::{non_finite, required};
use crate::error::Error;

/// How far a quaternion's length may be from one before it is refused and not just normalised.
const QUATERNION_TOLERANCE: f64 = 1e-3;

pub(super) fn vector(field: &str, value: Option<&v1::Vector3>) -> Result<Vector, Error> {
    let &v1::Vector3 { x, y, z } = required(field, value)?;
    if [x, y, z].iter().all(|number| number.abs() <= MAX_COORDINATE_M) {
        return Ok(Vector::new(x, y, z));
    }
    let description = format!("({x}, {y}, {z}) is not finite or beyond {MAX_COORDINATE_M}; units are SI");
    Err(non_finite(field, description))
}

pub(super) fn point(field: &str, value: Option<&v1::Vector3>) -> Result<Point, Error> {
    Ok(vector(field, value)?.into())
}

/// A point or direction that may be left out.
pub(super) fn optional_vector(field: &str, value: Option<&v1::Vector3>) -> Result<Option<Vector>, Error> {
    value.map(|value| vector(field, Some(value))).transpose()
}

pub(super) fn pose(field: &str, value: Option<&v1::Pose>) -> Result<Pose, Error> {
    let v1::Pose { position, orientation } = required(field, value)?;
    let translation = vector(&format!("{field}.position"), position.as_ref())?;
    let rotation = rotation(&format!("{field}.orientation"), orientation.as_ref())?;
    Ok(Pose::from_parts(Translation3::from(translation), rotation))
}

fn rotation(field: &str, value: Option<&v1::Quaternion>) -> Result<UnitQuaternion<f64>, Error> {
    let Some(&v1::Quaternion { x, y, z, w }) = value else {
        return Err(Error::field(field, "is missing: no rotation is x 0, y 0, z 0, w 1"));
    };
    let quaternion = Quaternion::new(w, x, y, z);
    let length = quaternion.norm();
    if !length.is_finite() {
        return Err(non_finite(field, format!("({x}, {y}, {z}, {w}) is not finite")));
    }
    if (length - 1.0).abs() > QUATERNION_TOLERANCE {
        let description = format!("({x}, {y}, {z}, {w}) has length {length:.4} and must be normalised to 1");
        return Err(Error::field(field, description));
    }
    Ok(UnitQuaternion::from_quaternion(quaternion))
}
