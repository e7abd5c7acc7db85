//! A depth camera that sees one side of the object, and of that only a patch.
//!
//! 0.6 m away, 20 to 50 degrees above the horizon, from any side. Of what it sees, the patch is that
//! share of the whole surface which is nearest to a random visible point; 200 points of it are the prior.

use nalgebra::Rotation3;
use palpate_core::geometry::{Direction, Point, Vector};
use palpate_core::metrics::SurfaceSampler;
use rand::RngExt;
use rand::seq::SliceRandom;

use crate::body::Body;
use crate::faults::{Faults, Pixels, hand_eye};
use crate::random::{Stream, generator, standard_normal};

/// From the camera to the centre of the object, in metres.
pub const DISTANCE_M: f64 = 0.6;
/// The lowest and the highest elevation, in degrees.
pub const ELEVATION_DEG: [f64; 2] = [20.0, 50.0];
/// Points of the patch that are handed on.
pub const PATCH_POINTS: usize = 200;

/// Points over the whole surface among which the visible ones are looked for.
const SURFACE_POINTS: usize = 10_000;
/// A ray that ends this near before its point has reached it.
const OCCLUSION_TOLERANCE_M: f64 = 1e-5;

/// How much the camera sees, and how well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The patch as a share of the whole surface, in (0, 1]. The paper does not state its own.
    pub patch_share: f64,
    /// Standard deviation along each ray, in metres.
    pub depth_noise_m: f64,
}

impl Default for Camera {
    /// A small patch, without noise.
    fn default() -> Self {
        Self { patch_share: 0.12, depth_noise_m: 0.0 }
    }
}

/// What the camera hands on: a patch of the surface and where it was seen from.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The camera's position.
    pub viewpoint: Point,
    /// Visible points of the surface, at most [`PATCH_POINTS`].
    pub points: Vec<Point>,
}

impl Camera {
    /// Takes the picture that belongs to `seed`.
    pub fn look(&self, body: &Body, seed: u64) -> View {
        self.look_with(body, seed, &Faults::default())
    }

    /// Takes the picture that belongs to `seed` with what goes wrong in it.
    pub fn look_with(&self, body: &Body, seed: u64, faults: &Faults) -> View {
        let viewpoint = viewpoint(body, seed);
        let points = self.patch(body, seed, &viewpoint);
        let pixels = Pixels::new(faults, points.len(), seed);
        let mut view = View { viewpoint, points };
        pixels.show_table(&mut view, body, seed);
        let mut noise = generator(seed, Stream::DepthNoise);
        for point in &mut view.points {
            let ray = Direction::new_normalize(*point - viewpoint);
            *point += ray.into_inner() * (self.depth_noise_m * standard_normal(&mut noise));
        }
        pixels.fly(&mut view, seed);
        pixels.lose(&mut view);
        hand_eye::turn(&mut view, faults.hand_eye_turn, seed);
        hand_eye::shift(&mut view, faults.hand_eye_m, seed);
        view
    }

    /// What is seen, of the surface and exactly.
    fn patch(&self, body: &Body, seed: u64, viewpoint: &Point) -> Vec<Point> {
        let mut rng = generator(seed, Stream::Patch);
        let surface = SurfaceSampler::new(body.mesh())
            .map(|sampler| sampler.stratified(SURFACE_POINTS, &mut rng))
            .unwrap_or_default();
        let mut patch: Vec<Point> = surface
            .into_iter()
            .map(|sample| sample.point)
            .filter(|point| is_visible(body, viewpoint, point))
            .collect();
        if !patch.is_empty() {
            let centre = patch[rng.random_range(0..patch.len())];
            patch.sort_by(|a, b| {
                let squared = |point: &Point| (point - centre).norm_squared();
                squared(a).total_cmp(&squared(b))
            });
        }
        // Every sample stands for the same area, so a share of the area is a share of the samples.
        patch.truncate((self.patch_share * SURFACE_POINTS as f64) as usize);
        patch.shuffle(&mut rng);
        patch.truncate(PATCH_POINTS);
        patch
    }
}

fn viewpoint(body: &Body, seed: u64) -> Point {
    let mut rng = generator(seed, Stream::View);
    let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
    let elevation = rng.random_range(ELEVATION_DEG[0]..ELEVATION_DEG[1]).to_radians();
    let towards = Rotation3::from_axis_angle(&Vector::z_axis(), azimuth)
        * Vector::new(elevation.cos(), 0.0, elevation.sin());
    body.centre() + towards * DISTANCE_M
}

/// Whether nothing of the object stands before this point of it or beside it.
pub(crate) fn is_visible(body: &Body, viewpoint: &Point, point: &Point) -> bool {
    let sight = point - viewpoint;
    let distance = sight.norm();
    let Some(direction) = Direction::try_new(sight, 0.0) else {
        return false;
    };
    body.surface().first_hit(viewpoint, &direction, distance - OCCLUSION_TOLERANCE_M).is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    #[test]
    fn the_camera_stands_where_it_should() {
        let body = shapes::generate("can").unwrap();
        for seed in 0..50 {
            let sight = Camera::default().look(&body, seed).viewpoint - body.centre();
            assert!((sight.norm() - 0.6).abs() < 1e-12);
            let elevation = (sight.z / 0.6).asin().to_degrees();
            assert!((20.0..=50.0).contains(&elevation), "{elevation}");
        }
    }

    #[test]
    fn the_patch_is_a_cap_of_the_ball_with_twelve_percent_of_its_area() {
        let body = shapes::generate("ball").unwrap();
        let mut widest = 0.0_f64;
        for seed in 0..30 {
            let view = Camera::default().look(&body, seed);
            assert_eq!(view.points.len(), PATCH_POINTS);
            let towards = (view.viewpoint - body.centre()).normalize();
            for point in &view.points {
                assert!(point.coords.norm() > 0.0635, "points lie on the surface");
                // A point is seen when it is above the horizon that the camera's distance leaves.
                assert!(point.coords.dot(&towards) > 0.064 * 0.064 / DISTANCE_M - 1e-3);
            }
            let across = view
                .points
                .iter()
                .flat_map(|a| view.points.iter().map(move |b| (a - b).norm()))
                .fold(0.0, f64::max);
            widest = widest.max(across);
            // A cap of 12 % of the sphere is 83 mm across; at the horizon it is cut and longer.
            assert!(across > 0.078, "{across}");
        }
        assert!(widest < 0.128);
    }

    #[test]
    fn a_larger_share_is_a_larger_patch_and_more_than_is_visible_is_all_that_is() {
        let body = shapes::generate("ball").unwrap();
        let across = |patch_share| {
            let points = Camera { patch_share, ..Camera::default() }.look(&body, 7).points;
            let pairs = points.iter().flat_map(|a| points.iter().map(move |b| (a - b).norm()));
            pairs.fold(0.0, f64::max)
        };
        let [small, large, visible, all] = [0.05, 0.3, 0.5, 1.0].map(across);
        assert!(small < large && large < visible, "{small} {large} {visible}");
        assert!((all - visible).abs() < 0.01, "the far side stays hidden: {visible} {all}");
    }

    #[test]
    fn nothing_behind_something_else_is_seen() {
        let body = shapes::generate("mug").unwrap();
        let view = Camera::default().look(&body, 3);
        for point in &view.points {
            let direction = Direction::new_normalize(point - view.viewpoint);
            let hit = body.surface().first_hit(&view.viewpoint, &direction, 1.0).unwrap();
            assert!((hit.point - point).norm() < 1e-4);
        }
    }

    #[test]
    fn depth_noise_moves_points_along_their_rays_only() {
        let body = shapes::generate("ball").unwrap();
        let exact = Camera::default().look(&body, 5);
        let noisy = Camera { depth_noise_m: 0.003, ..Camera::default() }.look(&body, 5);
        assert_eq!(exact.viewpoint, noisy.viewpoint);
        let mut squares = 0.0;
        for (exact_point, noisy_point) in exact.points.iter().zip(&noisy.points) {
            let moved = noisy_point - exact_point;
            let ray = (exact_point - exact.viewpoint).normalize();
            assert!(moved.cross(&ray).norm() < 1e-12);
            squares += moved.norm_squared();
        }
        let deviation = (squares / PATCH_POINTS as f64).sqrt();
        assert!((deviation / 0.003 - 1.0).abs() < 0.2, "{deviation}");
    }

    #[test]
    fn the_same_seed_sees_the_same() {
        let body = shapes::generate("box").unwrap();
        let camera = Camera { depth_noise_m: 0.001, ..Camera::default() };
        assert_eq!(camera.look(&body, 9), camera.look(&body, 9));
        assert_ne!(camera.look(&body, 9).viewpoint, camera.look(&body, 10).viewpoint);
    }
}
