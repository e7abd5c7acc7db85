//! A measured displacement of the template, and what it shares with others.

use crate::evidence::attractor::Rigid;
use crate::geometry::SurfacePoint;

/// A measured displacement of the template.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// Where on the template.
    pub at: SurfacePoint,
    /// The height of the surface over the template there, in metres.
    pub height_m: f64,
    /// Standard deviation of the measurement, in metres.
    pub noise_m: f64,
    /// The rigid offsets that it shares with others: measured where a group of points is moved by `b` and turned
    /// by `w`, a height is less by `n · (b + w × r)`, `r` being the point's lever.
    pub rigid: [Option<Rigid>; 2],
}

impl Observation {
    /// A measurement with an error of its own only.
    pub fn new(at: SurfacePoint, height_m: f64, noise_m: f64) -> Self {
        Self { at, height_m, noise_m, rigid: [None; 2] }
    }

    /// Covariance of two measurements by the rigid offsets that they share, in square metres.
    pub(super) fn shared_variance(&self, other: &Self) -> f64 {
        let (n, m) = (&self.at.normal, &other.at.normal);
        let shared = |(a, b): (&Option<Rigid>, &Option<Rigid>)| match (a, b) {
            (Some(a), Some(b)) if a.group == b.group => {
                a.std_m * b.std_m * n.dot(m) + a.turn_std * b.turn_std * a.turned(n).dot(&b.turned(m))
            }
            _ => 0.0,
        };
        self.rigid.iter().zip(&other.rigid).map(shared).sum()
    }
}
