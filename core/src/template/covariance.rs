//! How sure a fitted template is of its parameters, and of its surface.
//!
//! Where touches lie all around, a cylinder is known to a fraction of a millimetre; an end that
//! nothing has touched may be anywhere, however well the sides fit.

use nalgebra::SMatrix;

use super::fit_data::{Distances, FitData, HUBER};
use super::part::{Freedom, Part, Row};
use crate::geometry::Vector;
use crate::least_squares::NormalEquations;

/// Of centre, logarithmic semi-axes, a rotation applied on the right, and the exponents; lengths
/// in those of the patch.
pub type Covariance = SMatrix<f64, 11, 11>;

/// Deviations of the parameters before any data: centre and logarithmic sizes in lengths of the
/// patch, rotation in radians, exponents.
const EXPECTED_DEVIATION: [f64; 11] = [1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 0.3, 0.3];

impl Part {
    /// What the points of the surface that this part is nearest to say about its parameters.
    fn information(&self, data: &FitData, others: &Distances) -> Freedom {
        let mut equations = NormalEquations::zero();
        for ((point, weight), other) in data.surface.iter().zip(&others.surface) {
            let (residual, row) = self.residual(point);
            if residual <= *other {
                equations.add_huber(residual, &row, *weight, HUBER);
            }
        }
        equations.hessian
    }

    /// Covariance of the parameters after a fit whose residuals have the given variance, in the
    /// order of [`Row`]; nothing for what a limb is not free to do.
    pub(super) fn covariance(&self, data: &FitData, others: &Distances, variance: f64) -> Covariance {
        let expected = Freedom::from_diagonal(&Row::from(EXPECTED_DEVIATION.map(|d| d.powi(-2))));
        let information = self.information(data, others) / variance + expected;
        let freedom = self.freedom();
        // What is not free gets an information so large that nothing of it comes back.
        let held = (Freedom::identity() - freedom) * 1e9;
        let inverse = (freedom * information * freedom + held).cholesky().map(|factor| factor.inverse());
        inverse.map_or(Freedom::zeros(), |covariance| freedom * covariance * freedom)
    }

    /// The signed distance of a point, and the variance of the surface next to it.
    pub(super) fn variance_at(&self, point: &Vector, covariance: &Covariance) -> (f64, f64) {
        let (residual, row) = self.residual(point);
        (residual, row.dot(&(covariance * row)))
    }
}
