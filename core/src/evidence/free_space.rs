//! Where the object is not: the segments that the probe has swept without touching anything.
//!
//! Only what lies in the object's [`Surroundings`] says anything about it, so of a way of any length no
//! more is kept than of one that leads across them.

use std::collections::HashSet;

use super::attempt::{Contact, Sweep, Target};
use super::attractor::Attractor;
use super::surroundings::Surroundings;
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
/// No line has more samples than about this: 5 m at the spacing above, and beyond that fewer a metre.
const LINE_SAMPLES: usize = 512;
/// Nor has a session more points outside than this: many touches and misses more than it may take.
const MOST_SAMPLES: usize = 1 << 16;

/// The cells of which one point is kept are from this to this long, in metres, each by this factor longer than the
/// one before.
const LEAST_CELL_M: f64 = 0.004;
const LARGEST_CELL_M: f64 = 1.0;
const CELL_GROWTH: f64 = 1.2;

/// Points known to lie outside the object, and points known to lie inside.
#[derive(Clone, Debug, Default)]
pub struct FreeSpace {
    outside: Vec<Point>,
    inside: Vec<Point>,
    /// What lies beyond is left out; everything is taken where they are not known.
    surroundings: Option<Surroundings>,
}

impl FreeSpace {
    /// Free space that keeps to the surroundings of the object.
    pub(crate) fn within(surroundings: Option<Surroundings>) -> Self {
        Self { surroundings, ..Self::default() }
    }

    /// The same with no more points outside than a fit can afford, evenly left out.
    pub(crate) fn thinned(mut self) -> Self {
        let stride = self.outside.len().div_ceil(MOST_SAMPLES);
        if stride > 1 {
            self.outside = self.outside.into_iter().step_by(stride).collect();
        }
        self
    }

    /// The same with at most about `most` points outside, the first in each cell of a grid that is as fine as that
    /// allows; all of them where they are no more.
    pub(crate) fn spread(mut self, most: usize) -> Self {
        let mut edge_m = LEAST_CELL_M;
        while self.outside.len() > most && edge_m < LARGEST_CELL_M {
            let mut seen = HashSet::new();
            self.outside.retain(|point| seen.insert(point.coords.map(|x| (x / edge_m).floor() as i64)));
            edge_m *= CELL_GROWTH;
        }
        self
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
        // The samples are those of the whole way, wherever it is cut.
        let within = match &self.surroundings {
            Some(surroundings) => surroundings.steps_within(from, &along, steps),
            None => Some(0..=steps),
        };
        let Some(within) = within else { return };
        let is_bounded = self.surroundings.is_some();
        let stride = if is_bounded { (within.end() - within.start()) / LINE_SAMPLES + 1 } else { 1 };
        self.outside.extend(within.step_by(stride).map(|step| from + along * (step as f64 / steps as f64)));
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

    /// What a session about a ball of 0.1 m at the origin looks at: 0.8 m and more around it.
    fn surroundings() -> Surroundings {
        Surroundings::around([Point::new(-0.05, -0.05, -0.05), Point::new(0.05, 0.05, 0.05)]).unwrap()
    }

    fn missed(from: Point, to: Point, radius_m: f64, surroundings: Option<Surroundings>) -> FreeSpace {
        let mut space = FreeSpace::within(surroundings);
        space.add_miss(&Sweep::new(from, to, radius_m).unwrap());
        space
    }

    #[test]
    fn a_way_within_the_surroundings_is_the_same_to_the_bit() {
        for radius_m in [0.0, 0.009] {
            let ends = (Point::new(-0.31, 0.02, 0.013), Point::new(0.37, -0.01, 0.02));
            let near = missed(ends.0, ends.1, radius_m, Some(surroundings()));
            assert_eq!(near.outside(), missed(ends.0, ends.1, radius_m, None).outside());
        }
    }

    #[test]
    fn a_way_of_kilometres_says_the_same_near_the_object_and_nothing_beyond() {
        for length_m in [3.0, 300.0, 10_000.0] {
            let ends = (Point::new(-length_m, 0.03, -0.04), Point::new(0.7 * length_m, 0.03, 0.01));
            let all = missed(ends.0, ends.1, 0.009, None);
            let near = missed(ends.0, ends.1, 0.009, Some(surroundings()));
            let is_near = |point: &&Point| point.coords.norm() < 0.5;
            let of = |space: &FreeSpace| space.outside().iter().filter(is_near).copied().collect::<Vec<_>>();
            assert!(of(&near) == of(&all), "{length_m}");
            assert!(of(&near).len() > 7 * 95, "a metre of seven lines: {}", of(&near).len());
            assert!(near.outside().iter().all(|point| point.coords.norm() < 1.0), "{length_m}");
            assert!(near.outside().len() < 7 * 200, "{}", near.outside().len());
        }
    }

    #[test]
    fn a_way_that_passes_far_away_says_nothing() {
        let ends = (Point::new(-50.0, 4.0, 0.0), Point::new(50.0, 4.0, 0.0));
        assert!(missed(ends.0, ends.1, 0.009, Some(surroundings())).outside().is_empty());
        let place = Point::new(9e3, -9e3, 9e3);
        assert!(missed(place, place, 0.0, Some(surroundings())).outside().is_empty());
    }

    #[test]
    fn however_large_the_surroundings_are_samples_are_bounded() {
        let huge = Surroundings::around([Point::new(-9e3, 0.0, 0.0), Point::new(9e3, 0.0, 0.0)]);
        let ends = (Point::new(-1e4, 0.0, 0.0), Point::new(1e4, 0.0, 0.0));
        let mut space = missed(ends.0, ends.1, 0.009, huge);
        assert!(space.outside().len() <= 7 * (LINE_SAMPLES + 2), "{}", space.outside().len());
        for _ in 0..40 {
            space.add_miss(&Sweep::new(ends.0, ends.1, 0.009).unwrap());
        }
        assert!((MOST_SAMPLES / 2..=MOST_SAMPLES).contains(&space.thinned().outside().len()));
    }

    #[test]
    fn samples_are_spread_where_there_are_too_many_of_them() {
        let ends = |k: i32| {
            (Point::new(-0.1, 0.002 * f64::from(k), 0.0), Point::new(0.1, 0.002 * f64::from(k), 0.0))
        };
        let mut space = FreeSpace::default();
        (0..50).for_each(|k| space.add_miss(&Sweep::new(ends(k).0, ends(k).1, 0.0).unwrap()));
        let all = space.outside().to_vec();
        assert_eq!(space.clone().spread(all.len()).outside(), all);
        let spread = space.spread(200);
        assert!((100..=200).contains(&spread.outside().len()), "{}", spread.outside().len());
        let nearest = |to: &Point| spread.outside().iter().map(|p| (p - to).norm()).fold(1.0, f64::min);
        assert!(all.iter().all(|point| nearest(point) < 0.025));
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
