//! Boxes whose distances from a point are found many at a time, so that only those are looked into that may hold what
//! is nearest to it.

use std::ops::Range;

use super::Point;
use crate::vectorised::larger;

/// Boxes in a group.
pub(super) const LANES: usize = 16;

/// Some numbers side by side.
pub(super) type Lanes = [f64; LANES];

/// Boxes in groups; the last group is filled up with boxes that are infinitely far.
#[derive(Clone, Debug)]
pub(super) struct Boxes {
    /// The coordinates of their lowest corners, then of their highest ones.
    groups: Vec<[Lanes; 6]>,
}

impl Boxes {
    /// Boxes from their lowest and their highest corners.
    pub(super) fn new(boxes: &[(Point, Point)]) -> Self {
        let group = |boxes: &[(Point, Point)]| {
            let mut group = [[f64::INFINITY; LANES]; 6];
            for (lane, (low, high)) in boxes.iter().enumerate() {
                for axis in 0..3 {
                    (group[axis][lane], group[3 + axis][lane]) = (low[axis], high[axis]);
                }
            }
            group
        };
        Self { groups: boxes.chunks(LANES).map(group).collect() }
    }

    /// All groups.
    pub(super) fn all(&self) -> Range<usize> {
        0..self.groups.len()
    }

    /// Looks into the boxes of some groups that may hold something as near to a point as what was found: the nearest
    /// box first, then the others in turn. Each is looked into by its number; what is returned, like `within`, is the
    /// square of the distance of the nearest that was found so far, in square metres.
    #[inline(always)]
    pub(super) fn look_into(
        &self,
        groups: Range<usize>,
        to: &[f64; 3],
        within: f64,
        mut look: impl FnMut(usize) -> f64,
    ) {
        let (mut least, mut found) = ([f64::INFINITY; LANES], [0_i64; LANES]);
        for group in groups.clone() {
            let squares = squares(&self.groups[group], to);
            for lane in 0..LANES {
                let is_nearer = squares[lane] < least[lane];
                least[lane] = if is_nearer { squares[lane] } else { least[lane] };
                found[lane] = if is_nearer { group as i64 } else { found[lane] };
            }
        }
        let (mut square, mut nearest) = (f64::INFINITY, 0);
        for lane in 0..LANES {
            if least[lane] < square {
                (square, nearest) = (least[lane], LANES * found[lane] as usize + lane);
            }
        }
        // Rounding keeps the order, so nothing is nearer than its box.
        if square == f64::INFINITY || square > within {
            return;
        }
        let mut within = look(nearest);
        for group in groups {
            let squares = squares(&self.groups[group], to);
            if least_of(&squares) > within {
                continue;
            }
            for (lane, square) in squares.into_iter().enumerate() {
                let number = LANES * group + lane;
                if square <= within && number != nearest {
                    within = look(number);
                }
            }
        }
    }
}

/// The squared distances of a point from some boxes, in square metres; zero inside.
#[inline(always)]
fn squares(boxes: &[Lanes; 6], to: &[f64; 3]) -> Lanes {
    let mut squares = [0.0; LANES];
    for axis in 0..3 {
        let (low, high) = (&boxes[axis], &boxes[3 + axis]);
        for lane in 0..LANES {
            let outside = larger(larger(low[lane] - to[axis], to[axis] - high[lane]), 0.0);
            squares[lane] += outside * outside;
        }
    }
    squares
}

/// The least of some numbers.
#[inline(always)]
pub(super) fn least_of(numbers: &Lanes) -> f64 {
    let mut least = *numbers;
    for half in [8, 4, 2, 1] {
        for lane in 0..half {
            let other = least[lane + half];
            least[lane] = if other < least[lane] { other } else { least[lane] };
        }
    }
    least[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_box_is_left_out_that_may_hold_the_nearest() {
        let low = |k: usize| Point::new((k as f64).sin(), (1.7 * k as f64).cos(), (2.3 * k as f64).sin());
        let side = |k: usize| nalgebra::Vector3::repeat(0.01 * (k % 7) as f64);
        let boxes: Vec<_> = (0..100).map(|k| (low(k), low(k) + side(k))).collect();
        let some = Boxes::new(&boxes);
        for query in [[0.0; 3], [2.0, -0.3, 0.4], [0.5, 0.5, -0.5]] {
            // In each box its farthest corner is what may be found.
            let farthest = |number: usize| {
                let (low, high) = &boxes[number];
                (0..3).map(|a| (low[a] - query[a]).abs().max((high[a] - query[a]).abs()).powi(2)).sum::<f64>()
            };
            let mut found = (f64::INFINITY, usize::MAX);
            let mut looks = 0;
            some.look_into(some.all(), &query, f64::INFINITY, |number| {
                looks += 1;
                if farthest(number) < found.0 {
                    found = (farthest(number), number);
                }
                found.0
            });
            let expected = (0..100).min_by(|a, b| farthest(*a).total_cmp(&farthest(*b))).unwrap();
            assert_eq!(found.1, expected);
            assert!(looks < 20, "{looks}");
            some.look_into(some.all(), &[9.0; 3], 1.0, |_| panic!("all boxes are farther"));
        }
        let none = Boxes::new(&[]);
        none.look_into(none.all(), &[0.0; 3], f64::INFINITY, |_| panic!("there is no box"));
    }
}
