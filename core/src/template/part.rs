//! One superquadric of a compound template, as parameters that can be fitted.
//!
//! Residuals are metric, so the far side of an object weighs like its near side. Their loss is
//! Huber's, so that a handle or a label does not bend the body. What the probe has swept freely
//! must not lie inside, whatever was touched: that keeps a template from growing past what is
//! known, and is the "repulsor" of the paper's future work.

use nalgebra::{Matrix3, Rotation3, SVector};

use super::superquadric::{Gauge, Superquadric};
use super::{LOG_SIZE, PatchFrame, clamp_log_size};
use crate::geometry::Vector;
use crate::least_squares::{Minimum, NormalEquations, minimise};

/// Attractors further than this from the template count linearly, in lengths of the patch.
const HUBER: f64 = 0.1;
/// Strength of the prior on size; on position it is half of it.
const SIZE_PRIOR: f64 = 0.3;
/// Strength of the prior that draws the exponents to those of an ellipsoid.
const EXPONENT_PRIOR: f64 = 0.1;
/// Sharper edges than the lower bound cannot be told by touch.
const EXPONENTS: (f64, f64) = (0.1, 1.2);
/// A new shape starts somewhat smaller: an overestimate is probed in vain.
const SHRINK: f64 = -0.15;

/// What a template is fitted to, in the frame of the patch.
#[derive(Clone, Debug)]
pub(crate) struct FitData {
    /// The frame.
    pub(crate) frame: PatchFrame,
    /// Points of the surface, with the weights of their residuals.
    pub(crate) surface: Vec<(Vector, f64)>,
    /// Points outside the object.
    pub(crate) free: Vec<Vector>,
    /// Points inside the object.
    pub(crate) occupied: Vec<Vector>,
}

/// For every point of the data the signed distance to the nearest of some parts; infinite for none.
#[derive(Clone, Debug)]
pub(super) struct Distances {
    surface: Vec<f64>,
    free: Vec<f64>,
    occupied: Vec<f64>,
}

impl Distances {
    pub(super) fn to(parts: &[&Part], data: &FitData) -> Self {
        let nearest =
            |point: &Vector| parts.iter().map(|part| part.residual(point).0).fold(f64::INFINITY, f64::min);
        Self {
            surface: data.surface.iter().map(|(point, _)| nearest(point)).collect(),
            free: data.free.iter().map(nearest).collect(),
            occupied: data.occupied.iter().map(nearest).collect(),
        }
    }

    /// The cost of a template at these distances, without its priors.
    pub(super) fn cost(&self, data: &FitData) -> f64 {
        let huber = |r: f64| {
            let size = r.abs();
            if size <= HUBER { 0.5 * size * size } else { HUBER * (size - 0.5 * HUBER) }
        };
        let weights = data.surface.iter().map(|(_, weight)| weight * weight);
        let surface: f64 = weights.zip(&self.surface).map(|(weight, r)| weight * huber(*r)).sum();
        let free: f64 = self.free.iter().map(|r| 0.5 * r.min(0.0).powi(2)).sum();
        let occupied: f64 = self.occupied.iter().map(|r| 0.5 * r.max(0.0).powi(2)).sum();
        surface + free + occupied
    }
}

/// A superquadric in the frame of the patch.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) centre: Vector,
    pub(super) log_axes: Vector,
    pub(super) rotation: Rotation3<f64>,
    pub(super) exponents: [f64; 2],
}

impl Part {
    pub(super) fn of(shape: &Superquadric, frame: &PatchFrame) -> Self {
        Self {
            centre: frame.local(&shape.centre),
            log_axes: shape.semi_axes.map(|a| clamp_log_size((a / frame.length_m).ln())),
            rotation: shape.base_from_template,
            exponents: shape.exponents,
        }
    }

    pub(super) fn shape(&self, frame: &PatchFrame) -> Superquadric {
        Superquadric {
            centre: frame.base(&self.centre),
            semi_axes: self.log_axes.map(f64::exp) * frame.length_m,
            base_from_template: self.rotation,
            exponents: self.exponents,
        }
    }

    /// The same body with another of its axes as the third, and other exponents.
    pub(super) fn squared(&self, axis: usize, exponents: [f64; 2]) -> Self {
        let order = [(axis + 1) % 3, (axis + 2) % 3, axis];
        let columns = order.map(|k| self.rotation.matrix().column(k).into_owned());
        Self {
            centre: self.centre,
            log_axes: Vector::from_fn(|row, _| self.log_axes[order[row]] + SHRINK),
            rotation: Rotation3::from_matrix_unchecked(Matrix3::from_columns(&columns)),
            exponents,
        }
    }

    pub(super) fn is_unbounded(&self) -> bool {
        self.log_axes.max() >= LOG_SIZE.1
    }

    /// The signed distance to first order, with its derivatives by centre, logarithmic semi-axes, a
    /// rotation applied on the right, and the exponents.
    ///
    /// The derivative of the slope in the denominator is left out: it vanishes on the surface.
    fn residual(&self, point: &Vector) -> (f64, SVector<f64, 11>) {
        let inverse_axes = self.log_axes.map(|p| (-p).exp());
        let local = self.rotation.inverse_transform_vector(&(point - self.centre));
        let y = local.component_mul(&inverse_axes);
        let gauge = Gauge::at(&y, self.exponents);
        let slope = gauge.by_y.component_mul(&inverse_axes);
        let per_slope = slope.norm().max(1e-12).recip();
        let by_centre = self.rotation * slope * -per_slope;
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

    /// Fits this part while the others of its template stand still at the given distances.
    pub(super) fn fit(self, data: &FitData, others: &Distances, steps: usize) -> Minimum<Self> {
        minimise(self, steps, |part| part.linearise(data, others), Self::retract)
    }

    /// Fits it as an ellipsoid: with exponents that stand still.
    pub(super) fn fit_ellipsoid(self, data: &FitData, others: &Distances, steps: usize) -> Minimum<Self> {
        let linearise = |part: &Self| {
            let mut equations = part.linearise(data, others);
            for k in 9..11 {
                equations.gradient[k] = 0.0;
                equations.hessian.row_mut(k).fill(0.0);
                equations.hessian.column_mut(k).fill(0.0);
            }
            equations
        };
        minimise(self, steps, linearise, Self::retract)
    }

    fn linearise(&self, data: &FitData, others: &Distances) -> NormalEquations<11> {
        // A union is as near as its nearest part; where that is another, this one changes nothing.
        let at = |point: &Vector, other: f64| {
            let (mine, row) = self.residual(point);
            if mine <= other { (mine, row) } else { (other, SVector::zeros()) }
        };
        let mut equations = NormalEquations::zero();
        for ((point, weight), other) in data.surface.iter().zip(&others.surface) {
            let (residual, row) = at(point, *other);
            equations.add_huber(residual, &row, *weight, HUBER);
        }
        let free = data.free.iter().zip(&others.free).map(|(point, other)| (point, *other, -1.0));
        let occupied = data.occupied.iter().zip(&others.occupied).map(|(point, other)| (point, *other, 1.0));
        for (point, other, wrong_side) in free.chain(occupied) {
            let (residual, row) = at(point, other);
            if residual * wrong_side > 0.0 {
                equations.add(residual, &row);
            }
        }
        self.add_priors(&mut equations, &data.frame.centre);
        equations
    }

    fn add_priors(&self, equations: &mut NormalEquations<11>, expected_centre: &Vector) {
        let mut prior = |parameter: usize, weight: f64, value: f64| {
            let mut row = SVector::zeros();
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

    fn retract(&self, step: &SVector<f64, 11>) -> Self {
        let part = |from: usize| Vector::new(step[from], step[from + 1], step[from + 2]);
        Self {
            centre: self.centre + part(0),
            log_axes: (self.log_axes + part(3)).map(clamp_log_size),
            rotation: self.rotation * Rotation3::new(part(6)),
            exponents: [0, 1].map(|k| (self.exponents[k] + step[9 + k]).clamp(EXPONENTS.0, EXPONENTS.1)),
        }
    }
}
