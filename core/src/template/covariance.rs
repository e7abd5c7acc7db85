//! How sure a fitted template is of its parameters.
//!
//! Where touches lie all around, a radius is known to a fraction of a millimetre; the length of a
//! part whose end nothing has touched may be anything, however well its sides fit.

use nalgebra::SMatrix;

use super::distances::Distances;
use super::fit_data::FitData;
use super::least_squares::{NormalEquations, Slopes};
use super::part::{Freedom, Part, Row};
use super::samples::Side;

/// Of centre, logarithmic semi-axes, a rotation applied on the right, and the exponents; lengths
/// in those of the patch.
pub(super) type Covariance = SMatrix<f64, 11, 11>;

/// Deviations of the parameters before any data: centre in lengths of the patch, logarithmic sizes,
/// rotation in radians, exponents.
const EXPECTED_DEVIATION: [f64; 11] = [1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 0.3, 0.3];

/// Information about what a limb is not free to do: so much that nothing of it comes back.
const HELD: f64 = 1e9;

impl Part {
    /// What the points of the surface that this part is nearest to say about its parameters.
    fn information(&self, data: &FitData, others: &Distances) -> Freedom {
        let (mut equations, mut slopes, field) = (NormalEquations::zero(), Slopes::zero(), self.field());
        for (block, others) in data.blocks.iter().zip(&others.blocks).filter(|(b, _)| b.side == Side::Surface)
        {
            slopes.add_nearest(block, &field.linearised(&block.points), others);
        }
        equations.add_slopes(&slopes);
        equations.hessian
    }

    /// Covariance of the parameters after a fit whose residuals have the given variance, in the
    /// order of [`Row`]; nothing for what a limb is not free to do.
    pub(super) fn covariance(&self, data: &FitData, others: &Distances, variance: f64) -> Covariance {
        let expected = Freedom::from_diagonal(&Row::from(EXPECTED_DEVIATION.map(|d| d.powi(-2))));
        let information = self.information(data, others) / variance + expected;
        let freedom = self.freedom();
        let held = (Freedom::identity() - freedom) * HELD;
        let inverse = (freedom * information * freedom + held).cholesky().map(|factor| factor.inverse());
        inverse.map_or(Freedom::zeros(), |covariance| freedom * covariance * freedom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Icosphere, Point, Vector};
    use crate::template::patch_frame::PatchFrame;
    use crate::template::superquadric::Superquadric;
    use nalgebra::Rotation3;

    #[test]
    fn an_end_that_nothing_has_touched_is_unsure_and_a_touched_radius_is_sure() {
        let frame = PatchFrame {
            origin: Point::origin(),
            length_m: 1.0,
            visual_points: 1.0,
            centre: Vector::zeros(),
        };
        let can = Superquadric {
            centre: Point::origin(),
            semi_axes: Vector::new(0.7, 0.7, 1.5),
            base_from_template: Rotation3::identity(),
            exponents: [0.2, 1.0],
        };
        let surface = Icosphere::get(3).directions.iter().map(|d| can.offset_towards(d));
        // Nothing but the sides is known.
        let sides = surface.filter(|p| p.z.abs() < 0.8).map(|p| (p, 1.0)).collect();
        let data = FitData::of(frame, sides, &[], &[]);
        let part = Part::of(&can, &frame);
        let nothing = Distances::to(std::iter::empty(), &data);
        let covariance = part.covariance(&data, &nothing, 1e-4);
        let deviation = |parameter: usize| covariance[(parameter, parameter)].sqrt();
        assert!(deviation(3) < 0.02 && deviation(4) < 0.02, "{} {}", deviation(3), deviation(4));
        assert!(deviation(5) > 0.2, "{}", deviation(5));
        assert!((covariance - covariance.transpose()).norm() < 1e-9);
    }
}
