//! Thinning a cloud before it enters the estimate: the method's cost grows with the cube of its points.
//!
//! Every kept point is one that was measured, the first in its voxel; the order is kept.

use std::collections::HashSet;
use std::hash::Hash;

use palpate_core::geometry::Point;

/// The points without exact repetitions.
pub(crate) fn without_duplicates(points: &[Point]) -> Vec<Point> {
    // Adding zero makes -0 and 0 the same place.
    first_of_each(points, |point| [point.x, point.y, point.z].map(|x| (x + 0.0).to_bits()))
}

/// One point for each occupied cube of a grid with edge `voxel_m`.
pub(crate) fn one_per_voxel(points: &[Point], voxel_m: f64) -> Vec<Point> {
    first_of_each(points, |point| [point.x, point.y, point.z].map(|x| (x / voxel_m).floor() as i64))
}

fn first_of_each<Key: Eq + Hash>(points: &[Point], key: impl Fn(&Point) -> Key) -> Vec<Point> {
    let mut seen = HashSet::with_capacity(points.len());
    points.iter().filter(|point| seen.insert(key(point))).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_of_points_thins_to_one_for_each_voxel() {
        let points: Vec<Point> = (0..1000)
            .map(|i| Point::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100)) * 0.001)
            .collect();
        let thinned = one_per_voxel(&points, 0.002_000_1);
        assert_eq!(thinned.len(), 125);
        assert!(thinned.iter().all(|point| points.contains(point)));
    }

    #[test]
    fn only_exact_repetitions_are_dropped() {
        let points =
            [Point::origin(), Point::new(-0.0, 0.0, 0.0), Point::new(1e-12, 0.0, 0.0), Point::origin()];
        assert_eq!(without_duplicates(&points), [points[0], points[2]]);
    }
}
