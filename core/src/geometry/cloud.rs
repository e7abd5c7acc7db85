//! Points of which the nearest is looked for again and again: many at a time, and only where it can be.

use super::Point;
use crate::vectorised::{larger, widest};

/// Points that are compared at a time.
const LANES: usize = 16;

/// Some numbers side by side.
type Lanes = [f64; LANES];

/// A cloud of points, in metres.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// Their coordinates in blocks; the last one is filled up with points that are infinitely far.
    blocks: Vec<[Lanes; 3]>,
    /// The lowest corners of the boxes around the blocks, then the highest ones. Points that follow each other
    /// mostly lie together, as those of an icosphere do, so most blocks are far from where the nearest is.
    boxes: Vec<[Lanes; 6]>,
}

impl Cloud {
    /// A cloud of some points.
    pub fn new(points: &[Point]) -> Self {
        let block = |points: &[Point]| {
            let at = |axis: usize, lane: usize| points.get(lane).map_or(f64::INFINITY, |point| point[axis]);
            std::array::from_fn(|axis| std::array::from_fn(|lane| at(axis, lane)))
        };
        let mut boxes = vec![[[f64::INFINITY; LANES]; 6]; points.len().div_ceil(LANES * LANES)];
        for (number, points) in points.chunks(LANES).enumerate() {
            let (low, high) = points.iter().fold((points[0], points[0]), |(l, h), p| (l.inf(p), h.sup(p)));
            let around = &mut boxes[number / LANES];
            for axis in 0..3 {
                around[axis][number % LANES] = low[axis];
                around[3 + axis][number % LANES] = high[axis];
            }
        }
        Self { blocks: points.chunks(LANES).map(block).collect(), boxes }
    }

    /// The index of the point nearest to another, of equals the first; nothing where there is none.
    pub fn nearest(&self, to: &Point) -> Option<u32> {
        let (squares, blocks) = widest(
            #[inline(always)]
            || self.nearest_of_lanes(&[to.x, to.y, to.z]),
        );
        let candidates = squares.iter().zip(blocks).enumerate().filter(|(_, (square, _))| square.is_finite());
        let indexed = candidates.map(|(lane, (square, block))| (*square, block * LANES as u64 + lane as u64));
        let nearest = indexed.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
        u32::try_from(nearest.1).ok()
    }

    /// The least square of each lane, and the first block that has it; lanes that hold no nearest point may be left
    /// out.
    #[inline(always)]
    fn nearest_of_lanes(&self, to: &[f64; 3]) -> (Lanes, [u64; LANES]) {
        let (mut least, mut found) = ([f64::INFINITY; LANES], [0_u64; LANES]);
        // Some point of the nearest box, though not always the nearest of all.
        let mut within = f64::INFINITY;
        let mut nearest_box = (f64::INFINITY, 0);
        for (group, boxes) in self.boxes.iter().enumerate() {
            for (lane, square) in squares_of_boxes(boxes, to).into_iter().enumerate() {
                if square < nearest_box.0 {
                    nearest_box = (square, group * LANES + lane);
                }
            }
        }
        if let Some(block) = self.blocks.get(nearest_box.1) {
            within = least_of(&squares(block, to));
        }
        for (group, boxes) in self.boxes.iter().enumerate() {
            for (lane, outside) in squares_of_boxes(boxes, to).into_iter().enumerate() {
                // Rounding keeps the order, so no point is nearer than its box.
                if outside > within {
                    continue;
                }
                let number = group * LANES + lane;
                let Some(block) = self.blocks.get(number) else { break };
                for (lane, square) in squares(block, to).into_iter().enumerate() {
                    let is_nearer = square < least[lane];
                    least[lane] = if is_nearer { square } else { least[lane] };
                    found[lane] = if is_nearer { number as u64 } else { found[lane] };
                }
                within = within.min(least_of(&least));
            }
        }
        (least, found)
    }
}

/// The squared distances of a point from some others, in square metres.
#[inline(always)]
fn squares([xs, ys, zs]: &[Lanes; 3], to: &[f64; 3]) -> Lanes {
    let mut squares = [0.0; LANES];
    for lane in 0..LANES {
        let (dx, dy, dz) = (xs[lane] - to[0], ys[lane] - to[1], zs[lane] - to[2]);
        squares[lane] = dx * dx + dy * dy + dz * dz;
    }
    squares
}

/// The squared distances of a point from some boxes, in square metres; zero inside.
#[inline(always)]
fn squares_of_boxes(boxes: &[Lanes; 6], to: &[f64; 3]) -> Lanes {
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

#[inline(always)]
fn least_of(lanes: &Lanes) -> f64 {
    let mut least = *lanes;
    for half in [8, 4, 2, 1] {
        for lane in 0..half {
            least[lane] = if least[lane + half] < least[lane] { least[lane + half] } else { least[lane] };
        }
    }
    least[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Icosphere;

    #[test]
    fn the_nearest_is_the_one_with_the_least_distance_and_of_equals_the_first() {
        let mut points: Vec<Point> = Icosphere::get(3)
            .directions
            .iter()
            .map(|direction| Point::from(direction.into_inner()))
            .collect();
        points.extend(points.clone());
        let cloud = Cloud::new(&points);
        for query in [Point::new(0.3, -2.0, 0.1), Point::new(-0.2, 0.1, 0.9), points[5], points[641]] {
            let square = |index: &usize| (points[*index] - query).norm_squared();
            let expected = (0..points.len()).min_by(|a, b| square(a).total_cmp(&square(b))).unwrap();
            assert_eq!(cloud.nearest(&query), Some(expected as u32));
        }
        assert_eq!(Cloud::new(&[]).nearest(&Point::origin()), None);
    }
}
