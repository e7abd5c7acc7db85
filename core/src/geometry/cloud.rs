//! Points of which the nearest is looked for again and again: many at a time, and only where it can be.

use super::Point;
use super::boxes::{Boxes, LANES, Lanes, least_of};
use crate::vectorised::widest;

/// A cloud of points, in metres.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// Their coordinates in blocks; the last one is filled up with points that are infinitely far.
    blocks: Vec<[Lanes; 3]>,
    /// The box around each block. Points that follow each other mostly lie together, as those of an icosphere do, so
    /// most blocks are far from where the nearest is.
    boxes: Boxes,
}

impl Cloud {
    /// A cloud of some points.
    pub fn new(points: &[Point]) -> Self {
        let block = |points: &[Point]| {
            let at = |axis: usize, lane: usize| points.get(lane).map_or(f64::INFINITY, |point| point[axis]);
            std::array::from_fn(|axis| std::array::from_fn(|lane| at(axis, lane)))
        };
        let around = |points: &[Point]| {
            points.iter().fold((points[0], points[0]), |(low, high), point| (low.inf(point), high.sup(point)))
        };
        let boxes: Vec<_> = points.chunks(LANES).map(around).collect();
        Self { blocks: points.chunks(LANES).map(block).collect(), boxes: Boxes::new(&boxes) }
    }

    /// The index of the point nearest to another, of equals the first; nothing where there is none.
    pub fn nearest(&self, to: &Point) -> Option<u32> {
        let to = [to.x, to.y, to.z];
        let (squares, blocks) = widest(
            #[inline(always)]
            || {
                let (mut least, mut found) = ([f64::INFINITY; LANES], [0_i64; LANES]);
                self.boxes.look_into(
                    self.boxes.all(),
                    &to,
                    f64::INFINITY,
                    #[inline(always)]
                    |number| {
                        let [xs, ys, zs] = &self.blocks[number];
                        for lane in 0..LANES {
                            let (dx, dy, dz) = (xs[lane] - to[0], ys[lane] - to[1], zs[lane] - to[2]);
                            let square = dx * dx + dy * dy + dz * dz;
                            let is_first = (square == least[lane]) & ((number as i64) < found[lane]);
                            let is_nearer = (square < least[lane]) | is_first;
                            least[lane] = if is_nearer { square } else { least[lane] };
                            found[lane] = if is_nearer { number as i64 } else { found[lane] };
                        }
                        least_of(&least)
                    },
                );
                (least, found)
            },
        );
        let candidates = squares.iter().zip(blocks).enumerate().filter(|(_, (square, _))| square.is_finite());
        let indexed = candidates.map(|(lane, (square, block))| (*square, block as usize * LANES + lane));
        let nearest = indexed.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
        u32::try_from(nearest.1).ok()
    }
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
