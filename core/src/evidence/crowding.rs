//! Long sessions: touches that crowd are taken together, so that a fit costs no more after a thousand of them.
//!
//! Some are kept, spread evenly by farthest-point sampling, and each of the others is counted with the nearest
//! of them. A touch that is doubted, or late enough that it may become so, is always kept: it is judged by itself.
//! Up to a bound nothing is taken together.

use super::attractor::{Attractor, Sense};
use crate::geometry::{Cloud, Point, farthest_point_sampling};

/// The most touches that are kept: on an object of 20 cm they lie a centimetre apart, a fourth of the length over
/// which displacements are correlated.
const MOST_TOUCHES: usize = 220;
/// The latest touches, which are always kept.
const LATEST: usize = 24;
/// Touches are compared this far back along their approach, in metres: those of the two sides of a plate lie apart.
const BACK_M: f64 = 0.010;

/// Attractors of which some stand for others, too.
#[derive(Clone, Debug, Default)]
pub(crate) struct Crowd {
    /// Those that are kept, each with the number of those that it stands for.
    pub(crate) kept: Vec<Attractor>,
    /// The others, each with the index of the one among the kept that stands for it.
    pub(crate) others: Vec<(usize, Attractor)>,
}

impl Crowd {
    /// Takes crowded touches together.
    pub(crate) fn of(attractors: Vec<Attractor>) -> Self {
        let is_touch = |attractor: &Attractor| attractor.sense == Sense::Touch;
        let touches = attractors.iter().filter(|attractor| is_touch(attractor)).count();
        if touches <= MOST_TOUCHES {
            return Self { kept: attractors, others: Vec::new() };
        }
        let latest =
            attractors.iter().filter(|a| is_touch(a)).map(|a| a.provenance.source).max().unwrap_or(0);
        let is_settled = |a: &Attractor| a.provenance.doubt == 0.0 && a.provenance.source + LATEST <= latest;
        let crowded: Vec<usize> = (0..attractors.len())
            .filter(|&at| is_touch(&attractors[at]) && is_settled(&attractors[at]))
            .collect();
        let back = |at: &usize| -> Point {
            let Attractor { point, provenance, .. } = &attractors[*at];
            point - provenance.approach * BACK_M
        };
        let places: Vec<Point> = crowded.iter().map(back).collect();
        let most = MOST_TOUCHES.saturating_sub(touches - crowded.len()).max(MOST_TOUCHES / 2);
        let chosen: Vec<usize> = farthest_point_sampling(&places, most).iter().map(|&k| crowded[k]).collect();
        let cloud = Cloud::new(&chosen.iter().map(back).collect::<Vec<Point>>());

        // Those that stand for themselves, or for whom another of the same rigid offset does not stand.
        let mut stands_for: Vec<Option<usize>> = vec![None; attractors.len()];
        for (at, place) in crowded.iter().zip(&places) {
            let nearest = cloud.nearest(place).map(|k| chosen[k as usize]);
            let of_same = |other: &usize| {
                other != at && attractors[*other].provenance.rigid == attractors[*at].provenance.rigid
            };
            stands_for[*at] = nearest.filter(of_same);
        }
        let mut index = vec![usize::MAX; attractors.len()];
        let mut crowd = Self::default();
        let by_touch = |a: &Attractor| a.sense == Sense::Tangent;
        let is_left_out = |a: &Attractor| {
            // What a measured normal adds goes with its touch.
            by_touch(a)
                && attractors.iter().zip(&stands_for).any(|(touch, by)| {
                    by.is_some() && is_touch(touch) && touch.provenance.source == a.provenance.source
                })
        };
        for (at, attractor) in attractors.iter().enumerate() {
            if stands_for[at].is_none() && !is_left_out(attractor) {
                index[at] = crowd.kept.len();
                crowd.kept.push(*attractor);
            }
        }
        for (at, by) in stands_for.iter().enumerate() {
            if let Some(kept) = by.map(|by| index[by]) {
                crowd.kept[kept].provenance.others += 1;
                crowd.others.push((kept, attractors[at]));
            }
        }
        crowd
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::attractor::Provenance;
    use crate::geometry::{Icosphere, Vector};

    /// Touches all over a ball of 50 mm.
    fn touches(count: usize) -> Vec<Attractor> {
        let directions = &Icosphere::get(4).directions;
        let touch = |number: usize| {
            let direction: Vector = directions[number * 1009 % directions.len()].into_inner();
            let provenance = Provenance { source: number, approach: -direction, ..Provenance::default() };
            Attractor { provenance, ..Attractor::new(Point::from(direction * 0.05), 0.1, Sense::Touch) }
        };
        (0..count).map(touch).collect()
    }

    #[test]
    fn few_touches_are_all_kept_as_they_are() {
        let all = touches(MOST_TOUCHES);
        let crowd = Crowd::of(all.clone());
        assert!(crowd.kept == all && crowd.others.is_empty());
    }

    #[test]
    fn many_are_kept_in_part_and_each_of_the_others_counts_with_one_that_is_near() {
        let mut all = touches(900);
        all[3].provenance.doubt = 0.9;
        let Crowd { kept, others } = Crowd::of(all.clone());
        assert_eq!(kept.len(), MOST_TOUCHES);
        assert_eq!(kept.iter().map(|a| 1 + a.provenance.others).sum::<usize>(), 900);
        assert!(others.iter().all(|(by, other)| (kept[*by].point - other.point).norm() < 0.012));
        let is_kept =
            |number: usize| kept.iter().any(|a| a.provenance.source == number && a.provenance.others == 0);
        assert!(is_kept(3) && (876..900).all(is_kept));
    }

    #[test]
    fn the_two_sides_of_a_plate_are_not_taken_together() {
        let side = |number: usize| {
            let (x, y) = (0.004 * (number / 2 % 20) as f64, 0.004 * (number / 40) as f64);
            let up = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
            let provenance =
                Provenance { source: number, approach: Vector::new(0.0, 0.0, -up), ..Provenance::default() };
            Attractor { provenance, ..Attractor::new(Point::new(x, y, 0.001 * up), 0.1, Sense::Touch) }
        };
        let crowd = Crowd::of((0..800).map(side).collect());
        let approach = |a: &Attractor| a.provenance.approach;
        assert!(crowd.others.iter().all(|(by, other)| approach(&crowd.kept[*by]) == approach(other)));
    }
}
