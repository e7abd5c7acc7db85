//! Long sessions: of touches that crowd some are left out, so that a fit costs no more after a thousand of them.
//!
//! By a first share of them the template is fitted, hyperparameters are chosen and doubts are found, which is most
//! of the work; a second share beside it gives the surface its detail. Both are spread evenly by farthest-point
//! sampling. A touch that is doubted, or so late that it may yet be, is always among the first. Up to a bound all
//! are, and nothing is left out.

use super::attractor::{Attractor, Sense};
use crate::geometry::{Point, farthest_point_sampling};

/// The most touches that a fit judges: on an object of 20 cm they lie little more than a centimetre apart, a fourth
/// of the length over which displacements are correlated.
const MOST_JUDGED: usize = 150;
/// The most touches in all.
const MOST_TOUCHES: usize = 400;
/// The latest touches, which are always judged.
const LATEST: usize = 24;
/// Touches are compared this far back along their approach, in metres: those of the two sides of a plate lie apart.
const BACK_M: f64 = 0.010;

/// Attractors, with the touches in a bounded number.
#[derive(Clone, Debug, Default)]
pub(crate) struct Crowd {
    /// What is judged, in the order that it came in.
    pub(crate) judged: Vec<Attractor>,
    /// Further touches, which are believed.
    pub(crate) detail: Vec<Attractor>,
}

impl Crowd {
    /// Sorts attractors into what is judged, what gives detail, and what is left out.
    pub(crate) fn of(attractors: Vec<Attractor>) -> Self {
        let is_touch = |attractor: &Attractor| attractor.sense == Sense::Touch;
        let source = |attractor: &Attractor| attractor.provenance.source;
        let touches = attractors.iter().filter(|attractor| is_touch(attractor)).count();
        if touches <= MOST_JUDGED {
            return Self { judged: attractors, detail: Vec::new() };
        }
        let latest = attractors.iter().filter(|a| is_touch(a)).map(source).max().unwrap_or(0);
        let is_settled =
            |a: &Attractor| is_touch(a) && a.provenance.doubt == 0.0 && source(a) + LATEST <= latest;
        let settled: Vec<&Attractor> = attractors.iter().filter(|a| is_settled(a)).collect();
        let back = |a: &&Attractor| -> Point { a.point - a.provenance.approach * BACK_M };
        let places: Vec<Point> = settled.iter().map(back).collect();
        let others = touches - settled.len();
        let chosen = farthest_point_sampling(&places, MOST_TOUCHES.saturating_sub(others));
        let (judged, detail) = chosen.split_at(MOST_JUDGED.saturating_sub(others).min(chosen.len()));
        let detail: Vec<Attractor> = detail.iter().map(|&at| *settled[at]).collect();
        let mut is_left = vec![false; latest + 1];
        settled.iter().for_each(|a| is_left[source(a)] = true);
        judged.iter().for_each(|&at| is_left[source(settled[at])] = false);
        // What a measured normal adds goes with its touch.
        let is_judged = |a: &Attractor| match a.sense {
            Sense::Touch | Sense::Tangent => !is_left[source(a)],
            Sense::Vision | Sense::Support => true,
        };
        Self { judged: attractors.into_iter().filter(is_judged).collect(), detail }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::attractor::Provenance;
    use crate::geometry::{Icosphere, Vector};

    fn touch(number: usize, point: Vector, approach: Vector) -> Attractor {
        let provenance = Provenance { source: number, approach, ..Provenance::default() };
        Attractor { provenance, ..Attractor::new(Point::from(point), 0.1, Sense::Touch) }
    }

    /// Touches all over a ball of 50 mm.
    fn touches(count: usize) -> Vec<Attractor> {
        let directions = &Icosphere::get(4).directions;
        let direction = |number: usize| directions[number * 1009 % directions.len()].into_inner();
        (0..count).map(|number| touch(number, direction(number) * 0.05, -direction(number))).collect()
    }

    #[test]
    fn few_touches_are_all_judged() {
        let all = touches(MOST_JUDGED);
        let crowd = Crowd::of(all.clone());
        assert!(crowd.judged == all && crowd.detail.is_empty());
    }

    #[test]
    fn of_many_as_many_as_the_bounds_allow_are_kept_and_what_is_left_out_lies_near_one_of_them() {
        for count in [MOST_JUDGED + 1, 300, 900] {
            let mut all = touches(count);
            all[3].provenance.doubt = 0.9;
            let Crowd { judged, detail } = Crowd::of(all.clone());
            assert_eq!((judged.len(), judged.len() + detail.len()), (MOST_JUDGED, count.min(MOST_TOUCHES)));
            let kept = || judged.iter().chain(&detail);
            assert!(all.iter().all(|a| kept().any(|other| (other.point - a.point).norm() < 0.010)));
            let is_judged = |number: usize| judged.iter().any(|a| a.provenance.source == number);
            assert!(is_judged(3) && (count - LATEST..count).all(is_judged));
        }
    }

    #[test]
    fn what_a_measured_normal_adds_goes_with_its_touch() {
        let beside = |a: &Attractor| Attractor { sense: Sense::Tangent, ..*a };
        let all = touches(300);
        let tangents: Vec<Attractor> = all.iter().map(beside).collect();
        let judged = Crowd::of([all, tangents].concat()).judged;
        let (touches, tangents): (Vec<&Attractor>, Vec<&Attractor>) =
            judged.iter().partition(|a| a.sense == Sense::Touch);
        let sources = |of: &[&Attractor]| of.iter().map(|a| a.provenance.source).collect::<Vec<_>>();
        assert_eq!(sources(&touches), sources(&tangents));
    }
}
