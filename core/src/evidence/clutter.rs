//! What a view shows beside the object: the plane that it stands on, and points that float alone.
//!
//! ```text
//! all points --> cells --> linked cells: what is linked to nothing large floats alone
//!                      --> a plane with the rest of the view before it, and around it: the support
//! ```
//!
//! A face of the object is no support: the rest of a body lies behind each of its faces, as the camera sees
//! it, and before the table. The bottom of a dish has the rest before it too, but inside its rim and not
//! around it.

use std::collections::HashMap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::geometry::{Plane, Point, Vector, farthest_point_sampling};

/// Cells that are looked at; more points share them.
const MOST_CELLS: usize = 3000;
/// Cells are linked within this many times the median distance of a cell to its nearest other.
const LINK: f64 = 7.0;
/// Linked cells that are fewer than this share of the largest group float alone.
const GROUP_SHARE: f64 = 0.05;
/// A point is compared with so many others around it, as the camera sees it,
const NEIGHBOURS: usize = 8;
/// and lies farther behind them than by this in metres, and by this many times what they are apart themselves.
const FLYING_M: f64 = 0.004;
const FLYING_SPREAD: f64 = 2.0;
/// What lies this near to a plane belongs to it, in metres.
const PLANE_M: f64 = 0.003;
/// Planes that are tried, each through three points.
const TRIALS: usize = 3000;
/// A support has at least this share of the cells, and so many of them,
const SUPPORT_SHARE: f64 = 0.05;
const SUPPORT_CELLS: usize = 10;
/// leaves at least this share for the object,
const OBJECT_SHARE: f64 = 0.25;
/// has at most this share of the cells behind it,
const BEHIND_SHARE: f64 = 0.02;
/// and lies beyond the rest in at least this many of the directions around it.
const SECTORS: usize = 24;
const LEAST_SECTORS: usize = 13;
/// by more than this share of its reach there, and this much in metres: a slice of a ball is around the rest of
/// it too, but hardly beyond.
const BEYOND: f64 = 0.2;
const BEYOND_M: f64 = 0.008;

/// Why a point was set aside, or that it was not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// Taken for the object.
    Kept,
    /// Of the plane that the object stands on, or beyond it.
    Support,
    /// Floats alone.
    Isolated,
    /// Lies far behind all that is seen around it.
    Flying,
}

/// A view, sorted.
#[derive(Clone, Debug)]
pub struct Sorted {
    /// The fate of each point.
    pub fates: Vec<Fate>,
    /// The plane of the support points, towards the object: the declared one, or the one that was found.
    pub support: Option<Plane>,
}

impl Sorted {
    /// How many points had a fate.
    pub fn count(&self, fate: Fate) -> usize {
        self.fates.iter().filter(|other| **other == fate).count()
    }
}

/// Sorts the points of a view. `viewpoint` is the camera's position, `declared` the plane that the object is
/// known to stand on.
pub fn sort(points: &[Point], viewpoint: Option<&Point>, declared: Option<&Plane>) -> Sorted {
    let cells = Cells::of(points);
    let centres = &cells.centres;
    let mut fates = vec![Fate::Kept; centres.len()];
    let support = declared.copied().or_else(|| found_support(centres, viewpoint?));
    if let Some(support) = &support {
        let lies_on_it = |centre: &Point| support.height_m(centre) < PLANE_M;
        fates
            .iter_mut()
            .zip(centres)
            .filter(|(_, c)| lies_on_it(c))
            .for_each(|(fate, _)| *fate = Fate::Support);
    }
    set_aside(&mut fates, Fate::Isolated, centres, floating);
    if let Some(viewpoint) = viewpoint {
        set_aside(&mut fates, Fate::Flying, centres, |points| flying(points, viewpoint));
    }
    Sorted { fates: cells.members.iter().map(|&cell| fates[cell]).collect(), support }
}

/// Gives a fate to those of the cells kept so far that a test finds.
fn set_aside(fates: &mut [Fate], fate: Fate, centres: &[Point], test: impl Fn(&[Point]) -> Vec<bool>) {
    let kept: Vec<usize> = (0..fates.len()).filter(|&cell| fates[cell] == Fate::Kept).collect();
    let points: Vec<Point> = kept.iter().map(|&cell| centres[cell]).collect();
    for (cell, _) in kept.into_iter().zip(test(&points)).filter(|(_, found)| *found) {
        fates[cell] = fate;
    }
}

/// Points in cells of a grid that is as fine as the number of cells allows.
struct Cells {
    centres: Vec<Point>,
    /// The cell of each point.
    members: Vec<usize>,
}

impl Cells {
    fn of(points: &[Point]) -> Self {
        let size_m = |points: &[Point]| {
            let low = points.iter().fold(Vector::repeat(f64::INFINITY), |low, point| low.inf(&point.coords));
            let high = points.iter().fold(Vector::repeat(f64::NEG_INFINITY), |high, p| high.sup(&p.coords));
            (high - low).amax()
        };
        let mut edge_m = 1e-9;
        let mut cells = Self::with_edge(points, edge_m);
        while cells.centres.len() > MOST_CELLS {
            edge_m = if edge_m < 1e-6 { size_m(points) / 1000.0 } else { edge_m * 1.3 };
            cells = Self::with_edge(points, edge_m);
        }
        cells
    }

    fn with_edge(points: &[Point], edge_m: f64) -> Self {
        let mut numbers: HashMap<[i64; 3], usize> = HashMap::new();
        let mut sums: Vec<(Vector, f64)> = Vec::new();
        let members: Vec<usize> = points
            .iter()
            .map(|point| {
                let key = point.coords.map(|x| (x / edge_m).round() as i64).into();
                let cell = *numbers.entry(key).or_insert_with(|| {
                    sums.push((Vector::zeros(), 0.0));
                    sums.len() - 1
                });
                sums[cell].0 += point.coords;
                sums[cell].1 += 1.0;
                cell
            })
            .collect();
        Self { centres: sums.into_iter().map(|(sum, count)| Point::from(sum / count)).collect(), members }
    }
}

/// Which points are linked to no large group.
fn floating(points: &[Point]) -> Vec<bool> {
    let square = |a: usize, b: usize| (points[a] - points[b]).norm_squared();
    let nearest =
        |a: usize| (0..points.len()).filter(|&b| b != a).map(|b| square(a, b)).fold(f64::INFINITY, f64::min);
    let mut distances: Vec<f64> = (0..points.len()).map(nearest).collect();
    distances.sort_by(f64::total_cmp);
    let Some(median) = distances.get(distances.len() / 2) else { return Vec::new() };
    let link = LINK * LINK * median;
    let mut group = vec![usize::MAX; points.len()];
    let mut sizes = Vec::new();
    for start in 0..points.len() {
        if group[start] != usize::MAX {
            continue;
        }
        let (number, mut size, mut open) = (sizes.len(), 0, vec![start]);
        group[start] = number;
        while let Some(at) = open.pop() {
            size += 1;
            for (other, of_other) in group.iter_mut().enumerate() {
                if *of_other == usize::MAX && square(at, other) <= link {
                    *of_other = number;
                    open.push(other);
                }
            }
        }
        sizes.push(size);
    }
    let largest = sizes.iter().copied().max().unwrap_or(0) as f64;
    group.into_iter().map(|number| (sizes[number] as f64) < GROUP_SHARE * largest).collect()
}

/// Which points lie far behind all that is seen around them: pixels between an edge and what is behind it.
fn flying(points: &[Point], viewpoint: &Point) -> Vec<bool> {
    if points.len() < 4 * NEIGHBOURS {
        return vec![false; points.len()];
    }
    let rays: Vec<(Vector, f64)> = points
        .iter()
        .map(|point| {
            let ray = point - viewpoint;
            (ray / ray.norm().max(f64::MIN_POSITIVE), ray.norm())
        })
        .collect();
    // Of each point how far behind those around it, and how widely these are spread, in metres.
    let compared: Vec<(f64, f64, f64)> = rays
        .iter()
        .enumerate()
        .map(|(number, (direction, range_m))| {
            let mut around: Vec<(f64, f64)> = rays
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != number)
                .map(|(_, (other, range_m))| ((other - direction).norm_squared(), *range_m))
                .collect();
            around.select_nth_unstable_by(NEIGHBOURS, |a, b| a.0.total_cmp(&b.0));
            let mut ranges_m: Vec<f64> = around[..NEIGHBOURS].iter().map(|(_, range_m)| *range_m).collect();
            ranges_m.sort_by(f64::total_cmp);
            // Of the neighbours themselves one or two may be such pixels.
            let (near_m, far_m) = (ranges_m[1], ranges_m[NEIGHBOURS - 3]);
            (range_m - far_m, far_m - near_m, (range_m - ranges_m[NEIGHBOURS / 2]).abs())
        })
        .collect();
    let mut usual_m: Vec<f64> = compared.iter().map(|(_, _, off_m)| *off_m).collect();
    usual_m.sort_by(f64::total_cmp);
    let least_m = FLYING_M.max(2.0 * usual_m[usual_m.len() / 2]);
    compared
        .into_iter()
        .map(|(behind_m, spread_m, _)| behind_m > least_m + FLYING_SPREAD * spread_m)
        .collect()
}

/// The plane that the object stands on, if the view shows one.
fn found_support(points: &[Point], viewpoint: &Point) -> Option<Plane> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut pick = || points[rng.next_u32() as usize % points.len()];
    if points.len() < 3 * SUPPORT_CELLS {
        return None;
    }
    let mut best: Option<(usize, Plane)> = None;
    for _ in 0..TRIALS {
        let Some(plane) = Plane::through(&[pick(), pick(), pick()], viewpoint) else { continue };
        let (on, behind) = counts(&plane, points);
        if best.as_ref().is_some_and(|(most, _)| on <= *most) || !has_room(on, behind, points.len()) {
            continue;
        }
        if surrounds(&plane, points) {
            best = Some((on, plane));
        }
    }
    best.map(|(_, plane)| plane)
}

/// How many points lie on a plane, and how many behind it.
fn counts(plane: &Plane, points: &[Point]) -> (usize, usize) {
    let heights = points.iter().map(|point| plane.height_m(point));
    heights.fold((0, 0), |(on, behind), height_m| {
        (on + usize::from(height_m.abs() < PLANE_M), behind + usize::from(height_m <= -PLANE_M))
    })
}

fn has_room(on: usize, behind: usize, all: usize) -> bool {
    let share = |count: usize| count as f64 / all as f64;
    on >= SUPPORT_CELLS
        && share(on) >= SUPPORT_SHARE
        && share(behind) <= BEHIND_SHARE
        && share(all - on - behind) >= OBJECT_SHARE
}

/// Whether a plane lies beyond what stands on it in most directions.
fn surrounds(plane: &Plane, points: &[Point]) -> bool {
    let (x, y) = plane.axes();
    let (on, above): (Vec<&Point>, Vec<&Point>) =
        points.iter().partition(|point| plane.height_m(point).abs() < PLANE_M);
    let centre = above.iter().map(|point| point.coords).sum::<Vector>() / above.len().max(1) as f64;
    let polar = |point: &Point| {
        let offset = point.coords - centre;
        let (along, across) = (offset.dot(&x), offset.dot(&y));
        let turn = (across.atan2(along) / std::f64::consts::TAU).rem_euclid(1.0);
        ((turn * SECTORS as f64) as usize % SECTORS, along.hypot(across))
    };
    let mut reach = [0.0_f64; SECTORS];
    for (sector, radius_m) in above.iter().map(|point| polar(point)) {
        reach[sector] = reach[sector].max(radius_m);
    }
    let mut beyond = [false; SECTORS];
    for (sector, radius_m) in on.iter().map(|point| polar(point)) {
        beyond[sector] |= radius_m > (1.0 + BEYOND) * reach[sector] + BEYOND_M;
    }
    beyond.iter().filter(|beyond| **beyond).count() >= LEAST_SECTORS
}

/// At most `most` of some points, spread evenly.
pub fn spread(points: &[Point], most: usize) -> Vec<Point> {
    if points.len() <= most {
        return points.to_vec();
    }
    farthest_point_sampling(points, most).into_iter().map(|index| points[index]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Point = Point::new(0.5, 0.2, 0.5);

    /// A square grid of points from a corner along two edges, in centimetres.
    fn face(corner: [f64; 3], u: [f64; 3], v: [f64; 3], steps: i32) -> Vec<Point> {
        let at = |i: i32, j: i32| {
            let (a, b) = (f64::from(i) / f64::from(steps), f64::from(j) / f64::from(steps));
            Point::from(Vector::from_fn(|k, _| 0.01 * (corner[k] + a * u[k] + b * v[k])))
        };
        (0..=steps).flat_map(|i| (0..=steps).map(move |j| at(i, j))).collect()
    }

    /// The top and the front of a box of 10 by 8 by 12 cm.
    fn cuboid() -> Vec<Point> {
        let top = face([0.0, 0.0, 12.0], [10.0, 0.0, 0.0], [0.0, 8.0, 0.0], 9);
        let front = face([10.0, 0.0, 0.5], [0.0, 8.0, 0.0], [0.0, 0.0, 11.0], 9);
        [top, front].concat()
    }

    fn table() -> Vec<Point> {
        let all = face([-6.0, -6.0, 0.0], [22.0, 0.0, 0.0], [0.0, 20.0, 0.0], 20);
        let is_beside = |p: &Point| !((-0.001..0.101).contains(&p.x) && (-0.001..0.081).contains(&p.y));
        all.into_iter().filter(is_beside).collect()
    }

    #[test]
    fn a_table_around_a_box_is_found_and_the_box_is_kept() {
        let points = [cuboid(), table()].concat();
        let sorted = sort(&points, Some(&CAMERA), None);
        let support = sorted.support.unwrap();
        assert!((support.normal().z - 1.0).abs() < 1e-6 && support.offset_m().abs() < 1e-6);
        assert_eq!(sorted.count(Fate::Support), table().len());
        assert!(sorted.fates[..cuboid().len()].iter().all(|fate| *fate == Fate::Kept));
    }

    #[test]
    fn no_face_of_a_body_and_no_bottom_of_a_dish_is_a_support() {
        assert_eq!(sort(&cuboid(), Some(&CAMERA), None).support, None);
        // A plate: a flat middle inside a rim that rises by 2 cm.
        let rim = (0..150).map(|k| {
            let (turn, up) = (0.7 * f64::from(k), f64::from(k % 5) / 5.0);
            Point::new((0.08 + 0.03 * up) * turn.cos(), (0.08 + 0.03 * up) * turn.sin(), 0.004 + 0.02 * up)
        });
        let middle = face([-5.0, -5.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], 10);
        let plate: Vec<Point> = rim.chain(middle).collect();
        let sorted = sort(&plate, Some(&Point::new(0.1, 0.2, 0.6)), None);
        assert_eq!((sorted.support, sorted.count(Fate::Kept)), (None, plate.len()));
    }

    #[test]
    fn a_declared_plane_takes_what_lies_on_it_and_beyond() {
        let plane = Plane::new(Vector::z_axis(), 0.0);
        let mut points = [cuboid(), table()].concat();
        points.push(Point::new(0.02, 0.02, -0.01));
        let sorted = sort(&points, None, Some(&plane));
        assert_eq!(sorted.count(Fate::Support), table().len() + 1);
    }

    #[test]
    fn points_that_float_alone_are_set_aside() {
        let mut points = cuboid();
        points.extend([CAMERA, Point::new(0.05, 0.04, 0.4), Point::new(0.05, 0.05, 0.4)]);
        let sorted = sort(&points, Some(&CAMERA), None);
        assert_eq!(sorted.count(Fate::Isolated), 3);
        assert!(sorted.fates[..cuboid().len()].iter().all(|fate| *fate == Fate::Kept));
    }

    #[test]
    fn a_cloud_of_many_points_is_sorted_by_its_cells() {
        let fine = face([0.0, 0.0, 12.0], [10.0, 0.0, 0.0], [0.0, 8.0, 0.0], 150);
        let front = face([10.0, 0.0, 0.5], [0.0, 8.0, 0.0], [0.0, 0.0, 11.0], 150);
        let table = table();
        let points = [fine, front, table.clone(), table].concat();
        let sorted = sort(&points, Some(&CAMERA), None);
        assert!(sorted.support.is_some());
        assert!(sorted.count(Fate::Support) >= 400, "{}", sorted.count(Fate::Support));
    }
}
