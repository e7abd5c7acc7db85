//! Parts of the workspace that the probe must not enter.

use crate::error::FieldError;
use crate::evidence::{WorkFrame, check_direction, check_point};
use crate::geometry::{Direction, Point, Vector};

/// A part of the workspace that the probe must not enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeepOut(Region);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Region {
    HalfSpace { normal: Direction, offset_m: f64 },
    Ball { center: Point, radius_m: f64 },
}

impl KeepOut {
    /// All points with `normal · p < offset_m`, such as below a table; `normal` points out of the
    /// forbidden side.
    ///
    /// # Errors
    /// A number that is not finite, or a normal without length.
    pub fn half_space(normal: Vector, offset_m: f64) -> Result<Self, FieldError> {
        let normal = check_direction("normal", normal)?;
        check_point("offset_m", &Point::new(offset_m, 0.0, 0.0))?;
        Ok(Self(Region::HalfSpace { normal, offset_m }))
    }

    /// A ball about `center`, in metres.
    ///
    /// # Errors
    /// A number that is not finite, or a radius that is not positive.
    pub fn ball(center: Point, radius_m: f64) -> Result<Self, FieldError> {
        check_point("center", &center)?;
        check_point("radius_m", &Point::new(radius_m, 0.0, 0.0))?;
        if radius_m <= 0.0 {
            return Err(FieldError::invalid("radius_m", format!("{radius_m} m is not positive")));
        }
        Ok(Self(Region::Ball { center, radius_m }))
    }

    /// Whether the segment from `start` to `end` enters.
    pub(super) fn blocks(&self, start: &Point, end: &Point) -> bool {
        match &self.0 {
            Region::HalfSpace { normal, offset_m } => {
                normal.dot(&start.coords).min(normal.dot(&end.coords)) < *offset_m
            }
            Region::Ball { center, radius_m } => {
                let along = end - start;
                let nearest = ((center - start).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
                (start + along * nearest - center).norm() < *radius_m
            }
        }
    }

    /// The same part in the frame that a method works in.
    pub(super) fn entered(&self, frame: &WorkFrame) -> Self {
        Self(match &self.0 {
            Region::HalfSpace { normal, offset_m } => Region::HalfSpace {
                normal: Direction::new_normalize(frame.exact_direction(normal)),
                offset_m: offset_m - normal.dot(&frame.point_in_base(&Point::origin()).coords),
            },
            Region::Ball { center, radius_m } => {
                Region::Ball { center: frame.exact_point(center), radius_m: *radius_m }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_without_a_direction_or_with_a_number_that_is_none_is_refused() {
        let field = |region: Result<KeepOut, FieldError>| region.unwrap_err().field;
        assert_eq!(field(KeepOut::half_space(Vector::zeros(), 0.0)), "normal");
        assert_eq!(field(KeepOut::half_space(Vector::z(), f64::NAN)), "offset_m");
        assert_eq!(field(KeepOut::ball(Point::new(f64::INFINITY, 0.0, 0.0), 0.1)), "center");
        assert_eq!(field(KeepOut::ball(Point::origin(), 0.0)), "radius_m");
        assert_eq!(field(KeepOut::ball(Point::origin(), f64::NAN)), "radius_m");
    }

    #[test]
    fn what_crosses_a_boundary_or_touches_a_ball_is_blocked() {
        let table = KeepOut::half_space(Vector::z() * 2.0, 0.1).unwrap();
        let at = |x: f64, z: f64| Point::new(x, 0.0, z);
        assert!(table.blocks(&at(0.0, 0.2), &at(0.0, 0.09)));
        assert!(!table.blocks(&at(0.0, 0.2), &at(0.0, 0.11)));
        let ball = KeepOut::ball(Point::origin(), 0.05).unwrap();
        assert!(ball.blocks(&at(-0.1, 0.04), &at(0.1, 0.04)));
        assert!(!ball.blocks(&at(-0.1, 0.06), &at(0.1, 0.06)));
    }
}
