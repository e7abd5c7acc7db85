//! The signed distance of a part, evaluated at many points.

use nalgebra::SVector;

use super::part::{Part, Row};
use super::superquadric::Gauge;
use crate::geometry::Vector;

/// A part with what every evaluation of its distance needs.
#[derive(Clone, Debug)]
pub(super) struct Field<'a> {
    pub(super) part: &'a Part,
    axes: Vector,
    inverse_axes: Vector,
}

impl Part {
    /// Its signed distance, to be evaluated at many points.
    pub(super) fn field(&self) -> Field<'_> {
        let inverse_axes = self.log_axes.map(|p| (-p).exp());
        Field { part: self, axes: self.log_axes.map(f64::exp), inverse_axes }
    }
}

impl Field<'_> {
    /// The signed distance to first order, with its derivatives by centre, logarithmic semi-axes, a
    /// rotation applied on the right, and the exponents.
    ///
    /// The derivative of the slope in the denominator is left out: it vanishes on the surface.
    pub(super) fn residual(&self, point: &Vector) -> (f64, Row) {
        let local = self.local(point);
        let y = local.component_mul(&self.inverse_axes);
        let gauge = Gauge::at(&y, self.part.exponents);
        let slope = gauge.by_y.component_mul(&self.inverse_axes);
        let per_slope = slope.norm().max(1e-12).recip();
        let by_centre = self.part.rotation * slope * -per_slope;
        let by_log_axes = gauge.by_y.component_mul(&y) * -per_slope;
        let by_rotation = slope.cross(&local) * per_slope;
        let row = SVector::from_fn(|k, _| match k {
            0..3 => by_centre[k],
            3..6 => by_log_axes[k - 3],
            6..9 => by_rotation[k - 6],
            _ => gauge.by_exponents[k - 9] * per_slope,
        });
        ((gauge.value - 1.0) * per_slope, row)
    }

    /// Whether a point is outside the box around the part, and so outside: cheaper than its residual.
    pub(super) fn is_beyond(&self, point: &Vector) -> bool {
        let local = self.local(point);
        (0..3).any(|axis| local[axis].abs() > self.axes[axis])
    }

    fn local(&self, point: &Vector) -> Vector {
        self.part.rotation.inverse_transform_vector(&(point - self.part.centre))
    }
}
