//! How far the confidence of an attractor spreads over the mesh.

use crate::config::Config;

/// Vertices of the mesh for which the paper counts edges.
const REFERENCE_VERTICES: f64 = 2562.0;
/// How far an attractor's confidence spreads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Edges, on the mesh with 2562 vertices.
    pub hops: u32,
    /// Over this length confidence halves, in metres.
    pub length_m: f64,
}

impl Reach {
    /// The configured reach.
    pub(crate) fn of(config: &Config) -> Self {
        Self { hops: config.propagation_hops, length_m: config.propagation_length_m }
    }

    /// Uncertainty from an attractor of uncertainty `u`, by the square of the distance in square metres.
    pub(super) fn spread(&self, u: f64, square_m2: f64) -> f64 {
        let square = square_m2 / (self.length_m * self.length_m);
        1.0 - (1.0 - u) / (1.0 + square)
    }
}

/// The reach of an attractor on a mesh with another tessellation than the paper's, in edges.
pub fn scaled_hops(hops: u32, vertices: usize) -> usize {
    (f64::from(hops) * (vertices as f64 / REFERENCE_VERTICES).sqrt()).round().max(1.0) as usize
}
