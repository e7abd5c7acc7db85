//! Fitting one part, with the limbs that it holds, while the others of its template stand still.
//!
//! Residuals are metric, so the far side of an object weighs like its near side. Their loss is
//! Huber's, so that a handle or a label does not bend the body. What the probe has swept freely
//! must not lie inside, whatever was touched: that keeps a template from growing past what is
//! known, and is the "repulsor" of the paper's future work.

use super::distances::{Distances, HUBER};
use super::fit_data::FitData;
use super::least_squares::{Minimum, NormalEquations, minimise};
use super::part::{Freedom, Part, Row};
use crate::geometry::Vector;

/// Strength of the prior on size; on position it is half of it.
const SIZE_PRIOR: f64 = 0.3;
/// Strength of the prior that draws the exponents to those of an ellipsoid.
const EXPONENT_PRIOR: f64 = 0.1;

impl Part {
    /// Fits this part, with the limbs that it holds, while the others of its template stand still
    /// at the given distances.
    pub(super) fn fit(
        self,
        limbs: &[Self],
        data: &FitData,
        others: &Distances,
        steps: usize,
    ) -> Minimum<Self> {
        minimise(self, steps, |part| part.linearise(limbs, data, others), Self::retract)
    }

    /// Fits it as an ellipsoid: with exponents that stand still.
    pub(super) fn fit_ellipsoid(self, data: &FitData, others: &Distances, steps: usize) -> Minimum<Self> {
        let mut freedom = Freedom::identity();
        freedom[(9, 9)] = 0.0;
        freedom[(10, 10)] = 0.0;
        let linearise = |part: &Self| part.linearise(&[], data, others).within(&freedom);
        minimise(self, steps, linearise, Self::retract)
    }

    /// Fits a limb while its host and the others stand still.
    pub(super) fn fit_limb(
        self,
        host: &Self,
        data: &FitData,
        others: &Distances,
        steps: usize,
    ) -> Minimum<Self> {
        let linearise = |limb: &Self| limb.linearise(&[], data, others).within(&limb.freedom());
        let retract = |limb: &Self, step: &Row| limb.retract(&(limb.freedom() * step)).held_by(host);
        minimise(self, steps, linearise, retract)
    }

    /// The normal equations of all data and of the priors.
    fn linearise(&self, limbs: &[Self], data: &FitData, others: &Distances) -> NormalEquations<11> {
        let limbs: Vec<Self> = limbs.iter().map(|limb| limb.clone().held_by(self)).collect();
        let (own, limb_fields) = (self.field(), limbs.iter().map(Self::field).collect::<Vec<_>>());
        // A union is as near as its nearest part; where that is another, this one changes nothing.
        let at = |point: &Vector, other: f64| {
            let mut nearest = own.residual(point);
            for limb in &limb_fields {
                let (residual, row) = limb.residual(point);
                if residual < nearest.0 {
                    nearest = (residual, limb.part.row_of_host(self, &row));
                }
            }
            if nearest.0 <= other { nearest } else { (other, Row::zeros()) }
        };
        let mut equations = NormalEquations::zero();
        for ((point, weight), other) in data.surface.iter().zip(&others.surface) {
            let (residual, row) = at(point, *other);
            equations.add_huber(residual, &row, *weight, HUBER);
        }
        for (point, other) in data.free.iter().zip(&others.free) {
            let is_beyond = own.is_beyond(point) && limb_fields.iter().all(|limb| limb.is_beyond(point));
            let (residual, row) = if is_beyond { (*other, Row::zeros()) } else { at(point, *other) };
            if residual < 0.0 {
                equations.add(residual, &row);
            }
        }
        for (point, other) in data.occupied.iter().zip(&others.occupied) {
            let (residual, row) = at(point, *other);
            if residual > 0.0 {
                equations.add(residual, &row);
            }
        }
        self.add_priors(&mut equations, &data.frame.centre);
        equations
    }

    fn add_priors(&self, equations: &mut NormalEquations<11>, expected_centre: &Vector) {
        let mut prior = |parameter: usize, weight: f64, value: f64| {
            let mut row = Row::zeros();
            row[parameter] = weight;
            equations.add(weight * value, &row);
        };
        for axis in 0..3 {
            prior(axis, 0.5 * SIZE_PRIOR, self.centre[axis] - expected_centre[axis]);
            prior(3 + axis, SIZE_PRIOR, self.log_axes[axis]);
        }
        for k in 0..2 {
            prior(9 + k, EXPONENT_PRIOR, self.exponents[k] - 1.0);
        }
    }
}
