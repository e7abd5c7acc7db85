//! How far the confidence of an attractor spreads over the mesh.

use crate::config::Config;

/// Vertices of the mesh for which the paper counts edges.
const REFERENCE_VERTICES: f64 = 2562.0;
/// The length of METHOD_PAPER over which confidence halves, in metres; the paper does not give it.
pub const PAPER_LENGTH_M: f64 = 0.020;

/// How far an attractor's confidence spreads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Edges, on the mesh with 2562 vertices.
    pub hops: u32,
    /// Over this length confidence halves, in metres.
    pub length_m: f64,
}

impl Reach {
    /// The configured reach; over a method's `own_length_m` where no length is configured.
    pub(crate) fn of(config: &Config, own_length_m: f64) -> Self {
        Self { hops: config.propagation_hops, length_m: config.propagation_length_m.unwrap_or(own_length_m) }
    }

    /// Uncertainty at a distance in metres from an attractor of uncertainty `u`.
    pub(super) fn spread(&self, u: f64, distance_m: f64) -> f64 {
        let t = distance_m / self.length_m;
        1.0 - (1.0 - u) / (1.0 + t * t)
    }

    /// The same over a share of the length.
    pub(super) fn shortened(self, share: f64) -> Self {
        Self { length_m: self.length_m * share, ..self }
    }
}

/// The reach of an attractor on a mesh with another tessellation than the paper's, in edges.
pub fn scaled_hops(hops: u32, vertices: usize) -> usize {
    (f64::from(hops) * (vertices as f64 / REFERENCE_VERTICES).sqrt()).round().max(1.0) as usize
}

/// The budget of touches where none is configured.
const BUDGET: u32 = 50;
/// Discs with the step length as radius, one for each touch of the budget, have this many times the
/// area of the object: they overlap enough to leave no gap.
const OVERLAP: f64 = 2.5;
/// The step length is never less or more, in metres.
const STEP_LENGTHS_M: (f64, f64) = (0.010, 0.035);

/// The length over which confidence halves so that the budget of touches covers a surface of the
/// given area, in metres.
pub(crate) fn step_length_m(area_m2: f64, config: &Config) -> f64 {
    if !config.stages.step_length {
        return PAPER_LENGTH_M;
    }
    let budget = f64::from(config.stop.max_attempts.unwrap_or(BUDGET));
    (OVERLAP * area_m2 / (budget * std::f64::consts::PI)).sqrt().clamp(STEP_LENGTHS_M.0, STEP_LENGTHS_M.1)
}
