//! Where the object is not: the segments that the probe has swept without touching anything.

use super::attempt::{Contact, Sweep, Target};
use crate::fingerprint::Fingerprint;
use crate::geometry::{Direction, Point, around};

/// Distance between samples of a segment, in metres.
const SPACING_M: f64 = 0.010;
/// The end of a segment that led to a touch is too near the surface to count, in metres.
const CLEARANCE_M: f64 = 0.003;
/// How far back from a touch its segment is sampled, in metres: farther off it tells nothing.
const REACH_M: f64 = 0.060;
/// A probe with a smaller radius counts as thin, in metres.
const LEAST_RADIUS_M: f64 = 0.001;
/// Lines along the rim of the path of a wide probe.
const RIM_POINTS: usize = 6;

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

    /// Enters a path on which nothing was touched: its middle line, and its rim where the probe is
    /// wide enough for that to say more.
    pub fn add_miss(&mut self, sweep: &Sweep) {
        self.add_segment(sweep.from(), sweep.to());
        let along = sweep.to() - sweep.from();
        if sweep.radius_m() >= LEAST_RADIUS_M
            && let Some(direction) = Direction::try_new(along, 0.0)
        {
            for across in around(&direction, RIM_POINTS) {
                let offset = across * sweep.radius_m();
                self.add_segment(&(sweep.from() + offset), &(sweep.to() + offset));
            }
        }
    }

    /// Enters the segment that ended in a touch, `travel_m` being how far outside its candidate the
    /// probe was to start. A touch before that start says that the start lies inside.
    pub fn add_approach(&mut self, contact: &Contact, target: Option<&Target>, travel_m: f64) {
        let touched = contact.point();
        let planned = target.map(|target| target.point() + target.normal().into_inner() * travel_m);
        if let Some(from) = contact.swept_from().copied().or(planned) {
            let back = from - touched;
            let length = back.norm();
            // A start behind the touch was never reached, and nothing is known of the segment to it.
            if length > CLEARANCE_M && back.dot(&contact.approach()) < 0.0 {
                let at = |distance_m: f64| touched + back * (distance_m / length);
                self.add_segment(&at(CLEARANCE_M), &at(length.min(REACH_M)));
            }
        }
        self.inside.extend(planned.filter(|start| (start - touched).dot(&contact.approach()) > CLEARANCE_M));
    }

    /// Adds itself to a fingerprint.
    pub(crate) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self { outside, inside } = self;
        fingerprint.points(outside);
        fingerprint.points(inside);
    }

    fn add_segment(&mut self, from: &Point, to: &Point) {
        let along = to - from;
        let steps = (along.norm() / SPACING_M).ceil().max(1.0) as usize;
        self.outside.extend((0..=steps).map(|step| from + along * (step as f64 / steps as f64)));
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
    fn a_wide_probe_leaves_its_rim_free_too() {
        let mut space = FreeSpace::default();
        let sweep = Sweep::new(Point::origin(), Point::new(0.0, 0.0, 0.03), 0.009).unwrap();
        space.add_miss(&sweep);
        assert_eq!(space.outside().len(), 4 * 7);
        let off_axis = |point: &Point| point.x.hypot(point.y);
        assert!(space.outside()[..4].iter().all(|point| off_axis(point) == 0.0));
        assert!(space.outside()[4..].iter().all(|point| (off_axis(point) - 0.009).abs() < 1e-12));
    }

    #[test]
    fn the_segment_to_a_touch_is_free_up_to_a_little_before_it() {
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
