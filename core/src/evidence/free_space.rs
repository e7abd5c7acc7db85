//! Where the object is not: the ways that the probe has swept without touching anything.

use super::attempt::{Contact, Sweep, Target};
use crate::geometry::Point;

/// Distance between samples of a way, in metres.
const SPACING_M: f64 = 0.010;
/// The last of a way that ended in a touch is too near the surface to count, in metres.
const CLEARANCE_M: f64 = 0.003;
/// How far back from a touch its way is sampled, in metres: farther off it tells nothing.
const REACH_M: f64 = 0.060;

/// Points known to lie outside the object, and points known to lie inside.
#[derive(Clone, Debug, Default)]
pub struct FreeSpace {
    outside: Vec<Point>,
    inside: Vec<Point>,
}

impl FreeSpace {
    /// Nothing is known.
    pub(crate) fn unknown() -> &'static Self {
        static UNKNOWN: FreeSpace = FreeSpace { outside: Vec::new(), inside: Vec::new() };
        &UNKNOWN
    }

    /// Points outside, in metres.
    pub fn outside(&self) -> &[Point] {
        &self.outside
    }

    /// Points inside, in metres.
    pub fn inside(&self) -> &[Point] {
        &self.inside
    }

    /// Enters a way on which nothing was touched.
    pub fn add_miss(&mut self, sweep: &Sweep) {
        self.add_way(sweep.from(), sweep.to());
    }

    /// Enters the way that ended in a touch, `travel_m` being how far outside its candidate the
    /// probe was to start. A touch before that start says that the start lies inside.
    pub fn add_approach(&mut self, contact: &Contact, target: Option<&Target>, travel_m: f64) {
        let touched = contact.point();
        let planned = target.map(|target| target.point() + target.normal().into_inner() * travel_m);
        if let Some(from) = contact.swept_from().copied().or(planned) {
            let back = from - touched;
            let length = back.norm();
            // A start behind the touch was never reached, and nothing is known of the way to it.
            if length > CLEARANCE_M && back.dot(&contact.approach()) < 0.0 {
                let at = |distance_m: f64| touched + back * (distance_m / length);
                self.add_way(&at(CLEARANCE_M), &at(length.min(REACH_M)));
            }
        }
        self.inside.extend(planned.filter(|start| (start - touched).dot(&contact.approach()) > CLEARANCE_M));
    }

    fn add_way(&mut self, from: &Point, to: &Point) {
        let way = to - from;
        let steps = (way.norm() / SPACING_M).ceil().max(1.0) as usize;
        self.outside.extend((0..=steps).map(|step| from + way * (step as f64 / steps as f64)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{ContactDetail, Wrench};
    use crate::geometry::{Pose, Vector};

    /// A touch at the origin, coming down the z axis.
    fn touch(swept_from: Option<Point>) -> Contact {
        let pose = Pose::rotation(Vector::x() * std::f64::consts::PI);
        let detail = ContactDetail { swept_from, ..ContactDetail::default() };
        Contact::new(pose, Wrench::default(), 0.009, detail).unwrap()
    }

    fn target(z: f64) -> Target {
        Target::new(Point::new(0.0, 0.0, z), Vector::z()).unwrap()
    }

    #[test]
    fn a_miss_is_free_from_end_to_end() {
        let mut space = FreeSpace::default();
        let sweep = Sweep::new(Point::origin(), Point::new(0.0, 0.0, 0.03), 0.0).unwrap();
        space.add_miss(&sweep);
        assert_eq!(space.outside().len(), 4);
        assert_eq!(space.outside()[3], Point::new(0.0, 0.0, 0.03));
    }

    #[test]
    fn the_way_to_a_touch_is_free_up_to_a_little_before_it() {
        let mut space = FreeSpace::default();
        space.add_approach(&touch(Some(Point::new(0.0, 0.0, 0.5))), None, 0.015);
        let heights = space.outside().iter().map(|point| point.z);
        assert!((heights.clone().fold(f64::INFINITY, f64::min) - 0.003).abs() < 1e-12);
        assert!((heights.fold(0.0, f64::max) - 0.060).abs() < 1e-12);
        assert!(space.inside().is_empty());
    }

    #[test]
    fn a_touch_before_the_planned_start_says_that_the_start_is_inside() {
        let mut space = FreeSpace::default();
        space.add_approach(&touch(Some(Point::new(0.0, 0.0, 0.1))), Some(&target(-0.04)), 0.015);
        assert_eq!(space.inside(), [Point::new(0.0, 0.0, -0.025)]);
        space = FreeSpace::default();
        space.add_approach(&touch(None), Some(&target(0.002)), 0.015);
        assert!(space.inside().is_empty() && !space.outside().is_empty());
    }
}
