//! Pixels that show something else than the object: the table, the air behind an edge, nothing at all.
//!
//! They take the places of points of the patch, so that a view has as many points with them as without.

use palpate_core::geometry::{Point, Vector};
use rand::RngExt;
use rand::seq::SliceRandom;

use super::Faults;
use crate::body::Body;
use crate::camera::{View, is_visible};
use crate::random::{Stream, generator};

/// How far the table is seen beyond the object's bounding box, in metres.
pub(crate) const TABLE_MARGIN_M: f64 = 0.06;
/// How far behind its edge a flying pixel is found, in metres.
pub(crate) const FLIGHT_M: [f64; 2] = [0.005, 0.04];
/// Draws for each point of the table before those that are hidden are left out.
const TABLE_DRAWS: usize = 50;

/// Which points of a view show what, by their places in it.
#[derive(Clone, Debug)]
pub(crate) struct Pixels {
    table: Vec<usize>,
    zero: Vec<usize>,
    object: Vec<usize>,
    flying: usize,
}

impl Pixels {
    /// Deals out the places of a view of so many points; what the object keeps is what is left.
    pub(crate) fn new(faults: &Faults, points: usize, seed: u64) -> Self {
        let share_of = |share: f64| (share * points as f64).round() as usize;
        let mut left: Vec<usize> = (0..points).collect();
        left.shuffle(&mut generator(seed, Stream::Pixels));
        let mut deal = |share: f64| left.split_off(left.len().saturating_sub(share_of(share)));
        let (table, zero) = (deal(faults.table_share), deal(faults.zero_share));
        Self { table, zero, flying: share_of(faults.flying_pixel_share).min(left.len()), object: left }
    }

    /// Puts points of the table, uniform over what is seen of it around the object, in their places.
    pub(crate) fn show_table(&self, view: &mut View, body: &Body, seed: u64) {
        let (low, high) = body.bounds();
        let mut rng = generator(seed, Stream::Table);
        let mut across =
            |axis: usize| rng.random_range(low[axis] - TABLE_MARGIN_M..=high[axis] + TABLE_MARGIN_M);
        // What the object stands on and what lies in its shadow is not seen.
        let seen = std::iter::repeat_with(|| Point::new(across(0), across(1), low.z))
            .take(TABLE_DRAWS * self.table.len())
            .filter(|point| is_visible(body, &view.viewpoint, point));
        for (&place, point) in self.table.iter().zip(seen) {
            view.points[place] = point;
        }
    }

    /// Pushes some of the points at the patch's edge away from the camera, along their rays.
    pub(crate) fn fly(&self, view: &mut View, seed: u64) {
        let View { viewpoint, points } = view;
        let ray = |place: usize| (points[place] - *viewpoint).normalize();
        let middle = self.object.iter().map(|&place| ray(place)).sum::<Vector>();
        let mut edge = self.object.clone();
        edge.sort_by(|&a, &b| ray(a).dot(&middle).total_cmp(&ray(b).dot(&middle)));
        // Not every pixel of an edge flies.
        edge.truncate(2 * self.flying);
        let mut rng = generator(seed, Stream::FlyingPixels);
        edge.shuffle(&mut rng);
        for &place in edge.iter().take(self.flying) {
            let ray = (points[place] - *viewpoint).normalize();
            points[place] += ray * rng.random_range(FLIGHT_M[0]..=FLIGHT_M[1]);
        }
    }

    /// Puts the pixels without depth where a driver puts them: at the camera.
    pub(crate) fn lose(&self, view: &mut View) {
        for &place in &self.zero {
            view.points[place] = view.viewpoint;
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::geometry::Direction;

    use super::*;
    use crate::camera::{Camera, PATCH_POINTS};
    use crate::shapes;

    /// What is seen without a fault, and with it.
    fn looks(object: &str, seed: u64, faults: &Faults) -> [View; 2] {
        let body = shapes::generate(object).unwrap();
        [Faults::default(), *faults].map(|faults| Camera::default().look_with(&body, seed, &faults))
    }

    /// The points that differ, as they are and as they would be.
    fn changed([right, wrong]: &[View; 2]) -> Vec<(Point, Point)> {
        assert_eq!(right.viewpoint, wrong.viewpoint);
        let pairs = wrong.points.iter().copied().zip(right.points.iter().copied());
        pairs.filter(|(wrong, right)| wrong != right).collect()
    }

    #[test]
    fn a_share_of_the_view_lies_on_the_table_around_the_object_where_the_camera_sees_it() {
        for object in ["ball", "box", "mug"] {
            let body = shapes::generate(object).unwrap();
            let (low, high) = body.bounds();
            let views = looks(object, 4, &Faults { table_share: 0.25, ..Faults::default() });
            let table = changed(&views);
            assert_eq!(table.len(), PATCH_POINTS / 4);
            let mut spread = [f64::INFINITY, f64::NEG_INFINITY];
            for (point, _) in table {
                assert_eq!(point.z, low.z);
                for axis in 0..2 {
                    assert!(point[axis] > low[axis] - 0.0601 && point[axis] < high[axis] + 0.0601);
                }
                let sight = point - views[0].viewpoint;
                let direction = Direction::new_normalize(sight);
                let hit = body.surface().first_hit(&views[0].viewpoint, &direction, sight.norm() - 1e-5);
                assert!(hit.is_none(), "{object}: {point} is hidden");
                spread = [spread[0].min(point.x), spread[1].max(point.x)];
            }
            assert!(spread[1] - spread[0] > 0.6 * (high.x - low.x + 0.12), "{spread:?}");
        }
    }

    #[test]
    fn points_of_the_table_are_as_noisy_as_the_others() {
        let body = shapes::generate("can").unwrap();
        let faults = Faults { table_share: 0.25, ..Faults::default() };
        let camera = Camera { depth_noise_m: 0.002, ..Camera::default() };
        let noisy = camera.look_with(&body, 4, &faults);
        let exact = Camera::default().look_with(&body, 4, &faults);
        let low = body.bounds().0.z;
        let of_table = |(point, exact): (&Point, &Point)| (exact.z == low).then(|| (point - exact).norm());
        let moved: Vec<f64> = noisy.points.iter().zip(&exact.points).filter_map(of_table).collect();
        let rms = (moved.iter().map(|m| m * m).sum::<f64>() / moved.len() as f64).sqrt();
        assert!(moved.len() >= PATCH_POINTS / 4 && (rms / 0.002 - 1.0).abs() < 0.3, "{rms}");
    }

    #[test]
    fn flying_pixels_lie_behind_the_patchs_edge_along_their_rays() {
        let views = looks("ball", 9, &Faults { flying_pixel_share: 0.05, ..Faults::default() });
        let flying = changed(&views);
        assert_eq!(flying.len(), PATCH_POINTS / 20);
        let View { viewpoint, points } = &views[0];
        let middle: Vector = points.iter().map(|point| (point - viewpoint).normalize()).sum();
        let aside = |point: &Point| (point - viewpoint).angle(&middle);
        let inner = points.iter().filter(|point| flying.iter().all(|(_, from)| from != *point));
        let mean_of_inner = inner.clone().map(aside).sum::<f64>() / inner.count() as f64;
        for (point, from) in &flying {
            let (flight, ray) = (point - from, (from - viewpoint).normalize());
            assert!(flight.cross(&ray).norm() < 1e-12);
            assert!((0.005..=0.04).contains(&flight.dot(&ray)), "{}", flight.dot(&ray));
            assert!(aside(from) > mean_of_inner, "it was not at the edge");
        }
    }

    #[test]
    fn pixels_without_depth_are_all_at_the_camera_wherever_it_is_believed_to_be() {
        let faults = Faults { zero_share: 0.05, hand_eye_m: 0.003, ..Faults::default() };
        let [_, view] = looks("pear", 2, &faults);
        let zeros = view.points.iter().filter(|point| **point == view.viewpoint).count();
        assert_eq!((zeros, view.points.len()), (PATCH_POINTS / 20, PATCH_POINTS));
    }

    #[test]
    fn faults_of_several_kinds_take_different_points_and_leave_the_others_alone() {
        let faults =
            Faults { table_share: 0.2, flying_pixel_share: 0.1, zero_share: 0.05, ..Faults::default() };
        let views = looks("can", 6, &faults);
        assert_eq!(changed(&views).len(), 20 + 40 + 10);
        assert_eq!(views[1], looks("can", 6, &faults)[1], "the same seed sees the same");
        assert_eq!(changed(&looks("can", 6, &Faults { table_share: 0.2, ..Faults::default() })).len(), 40);
    }

    #[test]
    fn more_than_all_is_all() {
        let faults =
            Faults { table_share: 0.9, zero_share: 0.9, flying_pixel_share: 0.9, ..Faults::default() };
        let pixels = Pixels::new(&faults, 10, 1);
        assert_eq!((pixels.table.len(), pixels.zero.len(), pixels.flying), (9, 1, 0));
    }
}
