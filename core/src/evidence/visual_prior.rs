//! What a depth camera saw: points on one side of the object.

use super::check::{check_point, check_unit};
use crate::error::FieldError;
use crate::geometry::{Point, Vector};

/// Points seen on the object, at least four and not all on one line.
#[derive(Clone, Debug, PartialEq)]
pub struct VisualPrior {
    points: Vec<Point>,
    uncertainty: Option<f64>,
    viewpoint: Option<Point>,
}

impl VisualPrior {
    /// Checks a cloud of visual points.
    ///
    /// `uncertainty` in [0, 1] replaces the configured one; `viewpoint` is the camera's position
    /// and tells on which side of the points the object lies.
    ///
    /// # Errors
    /// Fewer than four points, all points on one line, or a number that is not finite.
    pub fn new(
        points: Vec<Point>,
        uncertainty: Option<f64>,
        viewpoint: Option<Point>,
    ) -> Result<Self, FieldError> {
        for point in &points {
            check_point("points", point)?;
        }
        if let Some(viewpoint) = &viewpoint {
            check_point("viewpoint", viewpoint)?;
        }
        if let Some(u) = uncertainty {
            check_unit("uncertainty", u)?;
        }
        if points.len() < 4 {
            let reason = format!("{} points are too few: at least 4 are needed", points.len());
            return Err(FieldError::invalid("points", reason));
        }
        if are_collinear(&points) {
            let reason = "all points are identical or on one line: they show no surface";
            return Err(FieldError::invalid("points", reason));
        }
        Ok(Self { points, uncertainty, viewpoint })
    }

    /// The same cloud with every point mapped.
    pub(super) fn mapped(&self, map: impl Fn(&Point) -> Point) -> Self {
        Self {
            points: self.points.iter().map(&map).collect(),
            uncertainty: self.uncertainty,
            viewpoint: self.viewpoint.as_ref().map(map),
        }
    }

    /// The points, in metres.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The mean of the points, in metres.
    pub fn centre(&self) -> Point {
        mean_of(&self.points)
    }

    /// The cloud's own uncertainty, where it was given.
    pub fn uncertainty(&self) -> Option<f64> {
        self.uncertainty
    }

    /// The camera's position, where it was given.
    pub fn viewpoint(&self) -> Option<&Point> {
        self.viewpoint.as_ref()
    }
}

fn mean_of(points: &[Point]) -> Point {
    Point::from(points.iter().map(|point| point.coords).sum::<Vector>() / points.len() as f64)
}

/// Whether the second largest spread of the points vanishes beside the largest.
fn are_collinear(points: &[Point]) -> bool {
    let centre = mean_of(points);
    let covariance = points
        .iter()
        .map(|point| point - centre)
        .map(|offset| offset * offset.transpose())
        .sum::<nalgebra::Matrix3<f64>>();
    let mut spreads: Vec<f64> = covariance.symmetric_eigenvalues().iter().copied().collect();
    spreads.sort_by(f64::total_cmp);
    spreads[1] <= 1e-8 * spreads[2] || spreads[2] == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner_points() -> Vec<Point> {
        vec![
            Point::new(0.0, 0.0, 0.0),
            Point::new(0.1, 0.0, 0.0),
            Point::new(0.0, 0.1, 0.0),
            Point::new(0.1, 0.1, 0.0),
        ]
    }

    #[test]
    fn four_coplanar_points_are_enough() {
        assert!(VisualPrior::new(corner_points(), None, None).is_ok());
    }

    #[test]
    fn three_points_are_too_few() {
        let error = VisualPrior::new(corner_points()[..3].to_vec(), None, None).unwrap_err();
        assert_eq!(error.to_string(), "points: 3 points are too few: at least 4 are needed");
    }

    #[test]
    fn points_on_a_line_or_in_one_place_are_refused() {
        let line = (0..9).map(|i| Point::new(0.01 * f64::from(i), 0.02 * f64::from(i), 0.3)).collect();
        assert!(VisualPrior::new(line, None, None).is_err());
        assert!(VisualPrior::new(vec![Point::new(0.1, 0.2, 0.3); 5], None, None).is_err());
    }

    #[test]
    fn points_that_are_not_finite_are_refused_by_name() {
        let mut points = corner_points();
        points[2].y = f64::NAN;
        let error = VisualPrior::new(points, None, None).unwrap_err();
        assert_eq!((error.field, error.non_finite), ("points", true));
    }
}
