//! What a Gaussian process has to be told beside the surface: a point that is inside, and points all
//! around that are outside. Without them the field is zero everywhere.

use super::process::{Known, Process};
use crate::evidence::attractor::Attractor;
use crate::evidence::free_space::FreeSpace;
use crate::geometry::{Icosphere, Point};
use crate::template::PatchFrame;

/// The object is taken to reach so many lengths of the visible patch behind it.
const BEHIND: f64 = 1.5;
/// How far around the farthest attractor the object certainly ends.
const MARGIN: f64 = 1.5;
/// A smaller object is taken to be this large, in metres: points may lie so close that their squared
/// distance is zero.
const LEAST_M: f64 = 1e-6;
/// Subdivisions of the sphere of outside points: 42 of them.
const SUBDIVISIONS: usize = 1;
/// Standard deviation of the field at these points.
const DEVIATION: f64 = 1e-3;
/// The field where the probe has swept freely; minus that where it has started inside.
const SWEPT: f64 = 0.1;
/// Its standard deviation.
const SWEPT_DEVIATION: f64 = 0.05;

/// A point inside, and a sphere around it that is outside.
#[derive(Clone, Debug)]
pub(super) struct Controls {
    /// Inside, in metres.
    pub(super) centre: Point,
    /// Radius of the sphere about it, in metres.
    pub(super) radius_m: f64,
}

impl Controls {
    /// The middle of the box around all attractors and a point behind the visible patch, as the camera
    /// sees it.
    pub(super) fn around(attractors: &[Attractor], viewpoint: Option<&Point>) -> Self {
        let patch = PatchFrame::of(attractors, viewpoint);
        let behind = patch.origin + patch.centre * (BEHIND * patch.length_m);
        let points = || attractors.iter().map(|a| a.point).chain([behind]);
        let low = points().fold(behind, |low, point| low.inf(&point));
        let high = points().fold(behind, |high, point| high.sup(&point));
        let centre = nalgebra::center(&low, &high);
        let farthest_m = points().map(|point| (point - centre).norm()).fold(patch.length_m, f64::max);
        Self { centre, radius_m: MARGIN * farthest_m.max(LEAST_M) }
    }

    /// The longest distance between two points of the process, in metres.
    pub(super) fn support_m(&self) -> f64 {
        2.0 * self.radius_m
    }

    /// Where the probe has swept freely and the field is negative, or has started inside and it is positive.
    pub(super) fn contradicted<'a>(
        &'a self,
        free_space: &'a FreeSpace,
        field: &'a Process,
    ) -> impl Iterator<Item = Known> + 'a {
        let swept = |points: &'a [Point], value: f64| {
            points.iter().map(move |&point| Known { point, value, deviation: SWEPT_DEVIATION })
        };
        let all = swept(free_space.outside(), SWEPT).chain(swept(free_space.inside(), -SWEPT));
        let is_near = |known: &Known| (known.point - self.centre).norm() < self.radius_m;
        all.filter(is_near).filter(|known| field.value(&known.point) * known.value < 0.0)
    }

    /// The points with their values.
    pub(super) fn known(&self) -> impl Iterator<Item = Known> {
        let at = |point, value| Known { point, value, deviation: DEVIATION };
        let (centre, radius_m) = (self.centre, self.radius_m);
        let around = Icosphere::get(SUBDIVISIONS).directions.iter();
        let outside = around.map(move |direction| at(centre + direction.into_inner() * radius_m, 1.0));
        std::iter::once(at(centre, -1.0)).chain(outside)
    }
}
