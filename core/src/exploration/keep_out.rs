//! Parts of the workspace that the probe must not enter.

use crate::error::FieldError;
use crate::evidence::{WorkFrame, check_direction, check_point};
use crate::geometry::{Direction, Point, Vector};

/// A part of the workspace that the probe must not enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeepOut(Region);

/// Its shape, as it was checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// All points with `normal · p < offset_m`.
    HalfSpace {
        /// Out of the forbidden side.
        normal: Direction,
        /// Where the boundary lies along the normal, in metres.
        offset_m: f64,
    },
    /// All points nearer to the centre than the radius.
    Ball {
        /// In metres.
        center: Point,
        /// In metres.
        radius_m: f64,
    },
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

    /// Its shape.
    pub fn region(&self) -> &Region {
        &self.0
    }

    /// Whether a disc across the segment from `start` to `end`, of a radius in metres, enters on its
    /// path.
    pub(super) fn blocks(&self, start: &Point, end: &Point, disc_radius_m: f64) -> bool {
        match &self.0 {
            Region::HalfSpace { normal, offset_m } => {
                // The lower the disc's rim hangs, the more it stands on edge.
                let along = (end - start).try_normalize(0.0).unwrap_or_else(Vector::zeros).dot(normal);
                let rim_m = disc_radius_m * (1.0 - along * along).max(0.0).sqrt();
                normal.dot(&start.coords).min(normal.dot(&end.coords)) - rim_m < *offset_m
            }
            Region::Ball { center, radius_m } => {
                let along = end - start;
                let nearest = ((center - start).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
                (start + along * nearest - center).norm() < radius_m + disc_radius_m
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
        assert!(table.blocks(&at(0.0, 0.2), &at(0.0, 0.09), 0.0));
        assert!(!table.blocks(&at(0.0, 0.2), &at(0.0, 0.11), 0.0));
        let ball = KeepOut::ball(Point::origin(), 0.05).unwrap();
        assert!(ball.blocks(&at(-0.1, 0.04), &at(0.1, 0.04), 0.0));
        assert!(!ball.blocks(&at(-0.1, 0.06), &at(0.1, 0.06), 0.0));
    }

    #[test]
    fn the_rim_of_a_pad_that_comes_from_the_side_must_stay_above_a_table_too() {
        let table = KeepOut::half_space(Vector::z(), 0.0).unwrap();
        let from_the_side = |z: f64| (Point::new(-0.1, 0.0, z), Point::new(0.1, 0.0, z));
        let (low, high) = (from_the_side(0.012), from_the_side(0.013));
        assert!(!table.blocks(&low.0, &low.1, 0.0));
        assert!(table.blocks(&low.0, &low.1, 0.0127) && !table.blocks(&high.0, &high.1, 0.0127));
        // From above the rim is as high as the centre.
        assert!(!table.blocks(&Point::new(0.0, 0.0, 0.1), &Point::new(0.0, 0.0, 0.001), 0.0127));
    }
}
