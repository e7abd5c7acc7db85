//! What is expected of the displacement before any measurement: how far it goes, over which length it changes, and what
//! a symmetry makes alike.

use faer::Mat;

use super::kernel::Known;
use crate::geometry::SurfacePoint;
use crate::symmetry::{Symmetry, SymmetryFrame};

/// Share of the prior variance common to symmetric points.
const SYMMETRIC_SHARE: f64 = 0.9;
/// This share of the prior's variance is added to that of every measurement: the system stays
/// regular, whatever its kernels are rounded to.
const JITTER: f64 = 1e-5;

/// What is expected of a displacement before any measurement.
#[derive(Clone, Copy, Debug)]
pub struct Prior {
    /// Correlation length, in metres.
    pub length_m: f64,
    /// Amplitude: the standard deviation of a displacement, in metres.
    pub amplitude_m: f64,
    /// The symmetry, if any.
    pub frame: SymmetryFrame,
}

impl Prior {
    /// The shares of the variance that are a point's own and that are common to symmetric points.
    pub(super) fn shares(&self) -> (f64, f64) {
        let share = if self.frame.symmetry == Symmetry::None { 0.0 } else { SYMMETRIC_SHARE };
        (1.0 - share, share)
    }

    /// The same as variances, in square metres.
    pub(super) fn variances(&self) -> (f64, f64) {
        let (own, shared) = self.shares();
        (own * self.amplitude_m.powi(2), shared * self.amplitude_m.powi(2))
    }

    /// What is added to the variance of every measurement, in square metres.
    pub(super) fn jitter(&self) -> f64 {
        JITTER * self.amplitude_m.powi(2)
    }
}

/// Points with their representatives, prepared for covariances with others.
#[derive(Debug)]
pub(super) struct Places {
    points: Known,
    pub(super) representatives: Known,
}

impl Places {
    pub(super) fn new(prior: &Prior, points: &[SurfacePoint]) -> Self {
        let representatives = prior.frame.representatives(points);
        Self { points: Known::new(points), representatives: Known::new(&representatives) }
    }

    /// Covariances of displacements at these points (rows) and at others (columns), in square metres.
    pub(super) fn covariance(&self, prior: &Prior, rows: usize, columns: &[SurfacePoint]) -> Mat<f32> {
        let (own, shared) = prior.variances();
        let mut covariance = Mat::zeros(rows, columns.len());
        self.points.add_covariances(&mut covariance, columns, prior.length_m, own);
        if shared > 0.0 {
            let columns = prior.frame.representatives(columns);
            self.representatives.add_covariances(&mut covariance, &columns, prior.length_m, shared);
        }
        covariance
    }
}
