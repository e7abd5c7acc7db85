//! Where the object is not: the segments that the probe has swept without touching anything.

use super::attempt::{Contact, Sweep, Target};
use super::attractor::Attractor;
use crate::geometry::{Direction, Plane, Point, Vector, around};

/// Distance between samples of a segment, in metres.
const SPACING_M: f64 = 0.010;
/// The end of a segment that led to a touch is too near the surface to count, in metres.
const CLEARANCE_M: f64 = 0.003;
/// How far back from a touch its segment is sampled, in metres: farther off it tells nothing.
const REACH_M: f64 = 0.060;
/// A probe with a smaller radius counts as thin, in metres.
const LEAST_RADIUS_M: f64 = 0.001;
/// What lies under a support is sampled at least this far around, in metres, at so many places to each side.
const UNDER_REACH_M: f64 = 0.04;
const UNDER_STEPS: i32 = 3;
/// Lines along the rim of the path of a wide probe.
const RIM_POINTS: usize = 6;

/// Points known to lie outside the object, and points known to lie inside.
#[derive(Clone, Debug, Default)]
pub struct FreeSpace {
    outside: Vec<Point>,
    inside: Vec<Point>,
}

impl FreeSpace {
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

    /// Enters the segment that ended in a touch at `touched`, `travel_m` being how far outside its candidate
    /// the probe was to start. A touch before that start says that the start lies inside.
    pub fn add_approach(
        &mut self,
        touched: &Point,
        contact: &Contact,
        target: Option<&Target>,
        travel_m: f64,
    ) {
        let (centre, approach) = (contact.point(), contact.approach());
        let beside = touched - centre;
        let planned = target.map(|target| target.point() + target.normal().into_inner() * travel_m);
        if let Some(from) = contact.swept_from().copied().or(planned) {
            let back = from - centre;
            let length = back.norm();
            // A start behind the touch was never reached, and nothing is known of the segment to it.
            if length > CLEARANCE_M && back.dot(&approach) < 0.0 {
                let at = |distance_m: f64| touched + back * (distance_m / length);
                self.add_segment(&at(CLEARANCE_M), &at(length.min(REACH_M)));
            }
        }
        let starts = planned.map(|start| start + beside);
        self.inside.extend(starts.filter(|start| (start - touched).dot(&approach) > CLEARANCE_M));
    }

    /// Enters the face of a pad that touched with its rim, at `touched`: the rest of the face was free.
    pub fn add_face(&mut self, touched: &Point, contact: &Contact) {
        let (pose, half_side_m) = (contact.base_from_sensor(), contact.pad().half_side_m());
        let sides = [-1.0, 0.0, 1.0];
        let places =
            sides.iter().flat_map(|x| sides.iter().map(move |y| Point::new(*x, *y, 0.0) * half_side_m));
        let face = places.map(|place| pose * place - contact.approach().into_inner() * CLEARANCE_M);
        self.outside.extend(face.filter(|place| (place - touched).norm() > half_side_m));
    }

    /// Enters what lies under the plane that the object stands on, as far as the object may reach.
    pub(super) fn add_support(&mut self, support: &Plane, attractors: &[Attractor]) {
        let feet: Vec<Point> = attractors.iter().map(|attractor| support.foot(&attractor.point)).collect();
        let centre = feet.iter().map(|foot| foot.coords).sum::<Vector>() / feet.len().max(1) as f64;
        let reach_m = feet.iter().map(|foot| (foot.coords - centre).norm()).fold(UNDER_REACH_M, f64::max);
        let (x, y) = support.axes();
        let under = centre - support.normal().into_inner() * CLEARANCE_M;
        let steps = -UNDER_STEPS..=UNDER_STEPS;
        let share = |step: i32| 1.5 * reach_m * f64::from(step) / f64::from(UNDER_STEPS);
        self.outside.extend(
            steps
                .clone()
                .flat_map(|i| steps.clone().map(move |j| Point::from(under + x * share(i) + y * share(j)))),
        );
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
    use crate::evidence::{ContactDetail, Pad, Wrench};
    use crate::geometry::Pose;

    /// A touch at the origin, coming down the z axis.
    fn touch(swept_from: Option<Point>) -> Contact {
        let pose = Pose::rotation(Vector::x() * std::f64::consts::PI);
        let detail = ContactDetail { swept_from, ..ContactDetail::default() };
        Contact::new(pose, Wrench::default(), Pad::new(0.009).unwrap(), detail).unwrap()
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
        space.add_approach(&Point::origin(), &touch(Some(Point::new(0.0, 0.0, 0.5))), None, 0.015);
        let heights = space.outside().iter().map(|point| point.z);
        assert!((heights.clone().fold(f64::INFINITY, f64::min) - 0.003).abs() < 1e-12);
        assert!((heights.fold(0.0, f64::max) - 0.060).abs() < 1e-12);
        assert!(space.inside().is_empty());
    }

    #[test]
    fn a_touch_before_the_planned_start_says_that_the_start_is_inside() {
        let mut space = FreeSpace::default();
        let early = touch(Some(Point::new(0.0, 0.0, 0.1)));
        space.add_approach(&Point::origin(), &early, Some(&target(-0.04)), 0.015);
        assert_eq!(space.inside(), [Point::new(0.0, 0.0, -0.025)]);
        space = FreeSpace::default();
        space.add_approach(&Point::origin(), &touch(None), Some(&target(0.002)), 0.015);
        assert!(space.inside().is_empty() && !space.outside().is_empty());
    }
}
