//! Thinning clouds before they enter the estimate: the method's cost grows with the cube of its points.
//!
//! A thinned cloud has the mean of the points in each voxel, which is less noisy than any of them.

use std::collections::{HashMap, HashSet};

use palpate_core::geometry::{Point, Vector};

/// A voxel, by its place in the grid.
type Key = [i64; 3];

/// Edge lengths that are chosen by themselves: ten a decade, from 10 micrometres on.
const EDGES_A_DECADE: [f64; 10] = [10.0, 12.5, 16.0, 20.0, 25.0, 32.0, 40.0, 50.0, 63.0, 80.0];
/// A hundred kilometres: in such a voxel lies all that is accepted.
const EDGES: usize = 101;

/// The points without exact repetitions, in their order.
pub(crate) fn without_duplicates(points: &[Point]) -> Vec<Point> {
    let mut seen = HashSet::with_capacity(points.len());
    // Adding zero makes -0 and 0 the same place.
    let bits = |point: &Point| [point.x, point.y, point.z].map(|x| (x + 0.0).to_bits());
    points.iter().filter(|point| seen.insert(bits(point))).copied().collect()
}

/// The mean of the points in each voxel with edge `edge_m`, in the order in which the voxels are first met.
pub(crate) fn means(points: &[Point], edge_m: f64) -> Vec<Point> {
    Grid::new(edge_m).add(points)
}

/// The voxels that are taken, so that several clouds may be thinned against each other.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    edge_m: f64,
    taken: HashSet<Key>,
}

impl Grid {
    pub(crate) fn new(edge_m: f64) -> Self {
        Self { edge_m, taken: HashSet::new() }
    }

    /// Edge of the voxels, in metres.
    pub(crate) fn edge_m(&self) -> f64 {
        self.edge_m
    }

    /// The mean of the points in each voxel that was free, which is taken from then on.
    pub(crate) fn add(&mut self, points: &[Point]) -> Vec<Point> {
        let mut index: HashMap<Key, usize> = HashMap::new();
        let mut sums: Vec<(Vector, f64)> = Vec::new();
        for point in points {
            let key = key(point, self.edge_m);
            if self.taken.contains(&key) {
                continue;
            }
            let place = *index.entry(key).or_insert_with(|| {
                sums.push((Vector::zeros(), 0.0));
                sums.len() - 1
            });
            sums[place].0 += point.coords;
            sums[place].1 += 1.0;
        }
        self.taken.extend(index.into_keys());
        sums.into_iter().map(|(sum, count)| Point::from(sum / count)).collect()
    }
}

/// The shortest edge, of a series from 10 micrometres on, with which `clouds` take at most `most` voxels together.
pub(crate) fn edge_for(clouds: &[&[Point]], most: usize) -> f64 {
    let fits = |step: usize| fits(clouds, edge_m(step), most);
    // The counts fall with the edge but for small exceptions; what is found fits in any case.
    let (mut too_short, mut fitting) = (0, EDGES - 1);
    if fits(too_short) {
        return edge_m(too_short);
    }
    while fitting - too_short > 1 {
        let middle = usize::midpoint(too_short, fitting);
        if fits(middle) { fitting = middle } else { too_short = middle }
    }
    edge_m(fitting)
}

/// The same with edges that are `edge_m` doubled once or more: a new voxel is then eight of the old ones, and
/// the mean of what lay in those lies in it.
pub(crate) fn doubled_edge_for(clouds: &[&[Point]], mut edge_m: f64, most: usize) -> f64 {
    loop {
        edge_m *= 2.0;
        if fits(clouds, edge_m, most) {
            return edge_m;
        }
    }
}

fn fits(clouds: &[&[Point]], edge_m: f64, most: usize) -> bool {
    let mut taken = HashSet::new();
    clouds.iter().copied().flatten().all(|point| {
        taken.insert(key(point, edge_m));
        taken.len() <= most
    })
}

fn edge_m(step: usize) -> f64 {
    let per_decade = EDGES_A_DECADE.len();
    // An exact power of ten, so that a millimetre is a millimetre.
    let decade = 10_u64.pow((step / per_decade) as u32) as f64;
    EDGES_A_DECADE[step % per_decade] * decade / 1e6
}

fn key(point: &Point, edge_m: f64) -> Key {
    [point.x, point.y, point.z].map(|x| (x / edge_m).floor() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block() -> Vec<Point> {
        (0..1000)
            .map(|i| Point::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100)) * 0.001)
            .collect()
    }

    #[test]
    fn a_block_of_points_thins_to_the_mean_of_each_voxel() {
        let thinned = means(&block(), 0.002_000_1);
        assert_eq!(thinned.len(), 125);
        assert!((thinned[0] - Point::new(0.001, 0.001, 0.001)).norm() < 1e-12);
        assert!((thinned[124] - Point::new(0.009, 0.009, 0.009)).norm() < 1e-12);
    }

    #[test]
    fn a_point_that_is_alone_in_its_voxel_stays_what_it_was() {
        let points = [Point::new(0.1, -0.2, 0.3), Point::new(-0.1, 0.7, 1.0 / 3.0)];
        assert_eq!(means(&points, 0.001), points);
    }

    #[test]
    fn only_exact_repetitions_are_dropped() {
        let points =
            [Point::origin(), Point::new(-0.0, 0.0, 0.0), Point::new(1e-12, 0.0, 0.0), Point::origin()];
        assert_eq!(without_duplicates(&points), [points[0], points[2]]);
    }

    #[test]
    fn a_second_cloud_gives_only_what_the_first_has_not() {
        let mut grid = Grid::new(0.01);
        assert_eq!(grid.add(&[Point::new(0.001, 0.0, 0.0), Point::new(0.003, 0.0, 0.0)]).len(), 1);
        let other = [Point::new(0.009, 0.0, 0.0), Point::new(0.011, 0.0, 0.0)];
        assert_eq!(grid.add(&other), other[1..]);
    }

    #[test]
    fn the_chosen_edge_is_a_round_one_and_the_shortest_that_fits() {
        let block = block();
        let (some, others) = block.split_at(300);
        let edge = edge_for(&[some, others], 125);
        assert_eq!(edge, 0.002, "two a side, and a rest of one in each direction would be 125 at most");
        assert!(means(&block, edge).len() <= 125);
        assert!(means(&block, 0.0016).len() > 125);
        assert_eq!(edge_for(&[&block[..5]], 10), 1e-5);
        assert_eq!(doubled_edge_for(&[&block], 0.0016, 125), 0.0032);
        assert_eq!(doubled_edge_for(&[&block], 0.0016, 8), 0.0064);
    }
}
