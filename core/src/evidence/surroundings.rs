//! Where something may be of use to a session: around all that was seen and touched.
//!
//! No part of the object is farther off than a few times the size of what is known of it. What was reported
//! of places beyond, such as a path in millimetres that was taken for one in metres, says nothing about it.

use std::ops::RangeInclusive;

use crate::geometry::{Point, Vector};

/// What is farther from all that is known than this many times its size, and this much more in metres, is on
/// no part of the object.
pub(super) const FAR_SIZES: f64 = 3.0;
pub(super) const FAR_M: f64 = 0.2;

/// A ball around all that is known, as wide as any part of the object may lie from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Surroundings {
    centre: Point,
    radius_m: f64,
}

impl Surroundings {
    /// Around points of the object; nothing where there are none.
    pub(crate) fn around(points: impl IntoIterator<Item = Point>) -> Option<Self> {
        let mut points = points.into_iter();
        let first = points.next()?;
        let (low, high) =
            points.fold((first, first), |(low, high), point| (low.inf(&point), high.sup(&point)));
        let size_m = (high - low).norm();
        let radius_m = 0.5 * size_m + FAR_SIZES * size_m + FAR_M;
        Some(Self { centre: nalgebra::center(&low, &high), radius_m })
    }

    fn contains(&self, point: &Point) -> bool {
        (point - self.centre).norm() <= self.radius_m
    }

    /// Which of the points `from + along * step / steps` lie within, for a step of `0..=steps`; nothing where
    /// none does.
    pub(super) fn steps_within(
        &self,
        from: &Point,
        along: &Vector,
        steps: usize,
    ) -> Option<RangeInclusive<usize>> {
        if self.contains(from) && self.contains(&(from + along)) {
            return Some(0..=steps);
        }
        let length_m = along.norm();
        let direction = along.try_normalize(0.0)?;
        let to_centre = self.centre - from;
        let nearest_m = to_centre.dot(&direction);
        let half_chord_m = self.radius_m.powi(2) - (to_centre - direction * nearest_m).norm_squared();
        let half_chord_m = (half_chord_m > 0.0).then(|| half_chord_m.sqrt())?;
        let step = |distance_m: f64| distance_m / length_m * steps as f64;
        let (first, last) = (step(nearest_m - half_chord_m).ceil(), step(nearest_m + half_chord_m).floor());
        // What lies before the beginning, or behind the end, was not swept.
        let is_swept = last >= 0.0 && first <= steps as f64 && first <= last;
        is_swept.then(|| first.max(0.0) as usize..=(last as usize).min(steps))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_of_a_way_within_is_found_wherever_it_begins_and_ends() {
        // A radius of 0.2 m about the origin.
        let ball = Surroundings::around([Point::origin()]).unwrap();
        let within = |from: f64, to: f64| {
            ball.steps_within(&Point::new(from, 0.0, 0.12), &Vector::new(to - from, 0.0, 0.0), 100)
        };
        // The chord at a height of 0.12 m is 0.32 m long.
        assert_eq!(within(-1.0, 1.0), Some(42..=58));
        assert_eq!(within(-0.1, 0.1), Some(0..=100));
        assert_eq!(within(0.0, 1.0), Some(0..=16));
        assert_eq!(within(-1.0, 0.0), Some(84..=100));
        for outside in [(0.3, 1.0), (-1.0, -0.3), (5.0, 5.0)] {
            assert_eq!(within(outside.0, outside.1), None, "{outside:?}");
        }
        assert_eq!(Surroundings::around([]), None);
    }
}
