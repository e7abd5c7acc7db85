//! The process before its measurements are weighed: correlations that many amplitudes and noises are tried with.

use std::sync::Arc;

use faer::{Mat, Scale};

use super::cholesky;
use super::kernel::Known;
use super::observation::Observation;
use super::prior::{Places, Prior};
use super::process::Displacement;
use crate::geometry::SurfacePoint;
use crate::symmetry::SymmetryFrame;

/// A process for some measurements before they are weighed: what depends neither on its amplitude nor on their noise
/// is computed once, and it is conditioned with many of both.
#[derive(Clone, Debug)]
pub(super) struct Prepared {
    prior: Prior,
    points: Arc<Vec<SurfacePoint>>,
    places: Arc<Places>,
    /// Correlations of the points themselves, whatever the symmetry.
    plain: Arc<Mat<f32>>,
    /// Correlations with the share of the symmetry.
    correlation: Arc<Mat<f32>>,
    /// Covariances by rigid offsets, below the diagonal and on it, in square metres.
    rigid: Arc<Mat<f64>>,
}

impl Prepared {
    /// Prepares the points of some measurements; the prior's amplitude does not matter.
    pub(super) fn new(prior: Prior, observations: &[Observation]) -> Self {
        let points: Vec<SurfacePoint> = observations.iter().map(|o| o.at).collect();
        let count = points.len();
        let mut plain = Mat::zeros(count, count);
        Known::new(&points).add_covariances(&mut plain, &points, prior.length_m, 1.0);
        let mut rigid = Mat::zeros(count, count);
        for (column, other) in observations.iter().enumerate().filter(|(_, o)| o.rigid != [None; 2]) {
            for row in column..count {
                rigid[(row, column)] = observations[row].shared_variance(other);
            }
        }
        Self::symmetric(prior, Arc::new(points), Arc::new(plain), Arc::new(rigid))
    }

    /// The same under another symmetry.
    pub(super) fn with_symmetry(&self, frame: SymmetryFrame) -> Self {
        let Self { prior, points, plain, rigid, .. } = self;
        let prior = Prior { frame, ..*prior };
        Self::symmetric(prior, Arc::clone(points), Arc::clone(plain), Arc::clone(rigid))
    }

    fn symmetric(
        prior: Prior,
        points: Arc<Vec<SurfacePoint>>,
        plain: Arc<Mat<f32>>,
        rigid: Arc<Mat<f64>>,
    ) -> Self {
        let places = Arc::new(Places::new(&prior, &points));
        let (own, shared) = prior.shares();
        let correlation = if shared > 0.0 {
            let representatives = prior.frame.representatives(&points);
            let mut correlation = plain.as_ref() * Scale(own as f32);
            places.representatives.add_covariances(
                &mut correlation,
                &representatives,
                prior.length_m,
                shared,
            );
            Arc::new(correlation)
        } else {
            Arc::clone(&plain)
        };
        Self { prior, points, places, plain, correlation, rigid }
    }

    /// Conditions the process with an amplitude, in metres, on the measurements with the noise that they have now.
    pub(super) fn given(&self, amplitude_m: f64, observations: &[Observation]) -> Displacement {
        let (prior, places) = (Prior { amplitude_m, ..self.prior }, Arc::clone(&self.places));
        let count = observations.len();
        let variance = amplitude_m * amplitude_m;
        let system = || {
            let mut system = Mat::zeros(count, count);
            for column in 0..count {
                let below =
                    (self.correlation.col_as_slice(column).iter().zip(self.rigid.col_as_slice(column)))
                        .zip(system.col_as_slice_mut(column));
                for ((correlation, rigid), entry) in below.skip(column) {
                    *entry = variance * f64::from(*correlation) + rigid;
                }
                system[(column, column)] += observations[column].noise_m.powi(2) + prior.jitter();
            }
            system
        };
        match cholesky::factor_mended(system) {
            Some(factor) => Displacement::of_factor(prior, places, factor, observations),
            None => Displacement::unconditioned(prior, places, count),
        }
    }
}

impl Displacement {
    /// Conditions the process on measurements.
    pub fn fit(prior: Prior, observations: &[Observation]) -> Self {
        Prepared::new(prior, observations).given(prior.amplitude_m, observations)
    }
}
