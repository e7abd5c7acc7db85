//! The object as the zero level of a Gaussian process over space, the related work of the paper
//! (Section II): Williams and Fitzgibbon's thin-plate covariance, "Gaussian process implicit surfaces"
//! (2007), used for touch by Dragiev, Toussaint and Gienger (2011).
//!
//! ```text
//! attractors ----> 0 --+
//! middle --------> -1 -+--> process over space --> level 0, as a mesh --> share of deviation left
//! far around ----> +1 -+
//! swept freely --> > 0 -+
//! ```
//!
//! The process knows nothing of templates, and its mesh has another topology after every touch.

mod controls;
mod level_set;
mod process;

use controls::Controls;
use process::{Known, Process};

use crate::evidence::attractor::Attractor;
use crate::evidence::free_space::FreeSpace;
use crate::geometry::{Point, TriangleMesh};

/// Standard deviation of the field at an attractor of uncertainty 0, and how much more of it one of
/// uncertainty 1 has. The field is -1 in the middle and 1 far around, so 0.01 is a hundredth of a radius.
const NOISE: f64 = 0.01;
const NOISE_OF_UNCERTAINTY: f64 = 0.05;

/// Swept places are looked at this many times: what is learnt of one may move the surface over another.
const ROUNDS: usize = 2;

/// An object as the zero level of a Gaussian process over space.
#[derive(Clone, Debug)]
pub(crate) struct ImplicitObject {
    controls: Controls,
    process: Process,
    /// The process that knows no attractor: how unsure everything was before.
    before: Process,
}

impl ImplicitObject {
    /// Conditions the process on the attractors, at least one, with what lies inside and outside of them.
    pub(crate) fn fit(attractors: &[Attractor], free_space: &FreeSpace, viewpoint: Option<&Point>) -> Self {
        let controls = Controls::around(attractors, viewpoint);
        let known: Vec<Known> = controls.known().collect();
        let measured = attractors.iter().map(|a| Known {
            point: a.point,
            value: 0.0,
            deviation: NOISE + NOISE_OF_UNCERTAINTY * a.uncertainty,
        });
        let mut all: Vec<Known> = known.iter().copied().chain(measured).collect();
        let support_m = controls.support_m();
        let mut process = Process::fit(&all, support_m);
        for _ in 0..ROUNDS {
            let contradicted: Vec<Known> = controls.contradicted(free_space, &process).collect();
            if contradicted.is_empty() {
                break;
            }
            all.extend(contradicted);
            process = Process::fit(&all, support_m);
        }
        Self { controls, process, before: Process::fit(&known, support_m) }
    }

    /// What is taken to lie inside, in metres.
    pub(crate) fn centre(&self) -> Point {
        self.controls.centre
    }

    /// The zero level as a closed mesh, found on a grid with `cells` cells a side.
    pub(crate) fn mesh(&self, cells: usize) -> TriangleMesh {
        level_set::mesh(&self.process, self.controls.centre, self.controls.radius_m, cells)
    }

    /// What is left of the deviation at some points now that there are attractors, in [0, 1]: 1 where
    /// nothing was seen or touched.
    pub(crate) fn uncertainty(&self, points: &[Point]) -> Vec<f64> {
        let left = self.process.deviations(points);
        let all = self.before.deviations(points);
        left.iter().zip(all).map(|(left, all)| (left / all.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)).collect()
    }

    /// Root mean square distance of the attractors from the zero level, to first order, in metres.
    pub(crate) fn residual_m(&self, attractors: &[Attractor]) -> f64 {
        let squares = attractors.iter().map(|a| {
            let (value, gradient) = self.process.at(&a.point);
            (value / gradient.norm().max(f64::MIN_POSITIVE)).powi(2)
        });
        (squares.sum::<f64>() / attractors.len().max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::attractor::Sense;
    use crate::geometry::{Icosphere, SurfaceIndex};

    fn on_ball(radius_m: f64, is_known: impl Fn(f64) -> bool) -> Vec<Attractor> {
        let directions = Icosphere::get(2).directions.iter().filter(|d| is_known(d.z));
        directions
            .map(|d| {
                let sense = if d.z > 0.6 { Sense::Vision } else { Sense::Touch };
                Attractor::new(Point::new(0.4, 0.1, 0.2) + d.into_inner() * radius_m, 0.0, sense)
            })
            .collect()
    }

    #[test]
    fn a_ball_touched_all_around_is_a_ball() {
        let attractors = on_ball(0.05, |_| true);
        let object =
            ImplicitObject::fit(&attractors, &FreeSpace::default(), Some(&Point::new(0.4, 0.1, 1.0)));
        let mesh = object.mesh(32);
        assert!(mesh.vertices.len() > 500, "{}", mesh.vertices.len());
        let centre = Point::new(0.4, 0.1, 0.2);
        let worst = mesh.vertices.iter().map(|v| ((v - centre).norm() - 0.05).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-3, "{worst}");
        assert!((mesh.volume() / (4.0 / 3.0 * std::f64::consts::PI * 0.05_f64.powi(3)) - 1.0).abs() < 0.05);
        assert!(SurfaceIndex::new(&mesh).is_some());
        assert!(object.residual_m(&attractors) < 1e-3, "{}", object.residual_m(&attractors));
    }

    #[test]
    fn points_that_nearly_coincide_give_a_sound_surface() {
        let at = |x: f64| Attractor::new(Point::new(x, 0.0, 0.0), 0.4, Sense::Vision);
        let attractors = [at(0.0), at(1e-200), at(2e-200), at(3e-200)];
        let mesh = ImplicitObject::fit(&attractors, &FreeSpace::default(), None).mesh(8);
        assert!(!mesh.faces.is_empty() && mesh.vertices.iter().all(|vertex| vertex.coords.norm() < 1e-5));
    }

    #[test]
    fn what_nothing_was_seen_or_touched_of_is_unsure() {
        let attractors = on_ball(0.05, |z| z > 0.3);
        let object =
            ImplicitObject::fit(&attractors, &FreeSpace::default(), Some(&Point::new(0.4, 0.1, 1.0)));
        let mesh = object.mesh(32);
        let uncertainty = object.uncertainty(&mesh.vertices);
        let mut by_height: Vec<(f64, f64)> =
            mesh.vertices.iter().zip(&uncertainty).map(|(vertex, u)| (vertex.z, *u)).collect();
        by_height.sort_by(|a, b| a.0.total_cmp(&b.0));
        let quarter = by_height.len() / 4;
        let mean = |part: &[(f64, f64)]| part.iter().map(|(_, u)| u).sum::<f64>() / part.len() as f64;
        let (hidden, seen) = (mean(&by_height[..quarter]), mean(&by_height[by_height.len() - quarter..]));
        assert!(seen < 0.3 && hidden > 2.0 * seen, "{seen} {hidden}");
        assert!(uncertainty.iter().all(|u| (0.0..=1.0).contains(u)));
    }
}
