//! One superquadric of a compound template, as parameters that can be fitted.
//!
//! Residuals are metric, so the far side of an object weighs like its near side. Their loss is
//! Huber's, so that a handle or a label does not bend the body. What the probe has swept freely
//! must not lie inside, whatever was touched: that keeps a template from growing past what is
//! known, and is the "repulsor" of the paper's future work.

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector};

use super::fit_data::{Distances, FitData, HUBER};
use super::limb::Along;
use super::superquadric::Superquadric;
use super::{LOG_SIZE, PatchFrame, clamp_log_size};
use crate::geometry::Vector;
use crate::least_squares::{Minimum, NormalEquations, minimise};

/// Derivatives by centre, logarithmic semi-axes, a rotation applied on the right, and exponents.
pub(super) type Row = SVector<f64, 11>;
/// What of a step is left to a part that is not free.
pub(super) type Freedom = SMatrix<f64, 11, 11>;

/// Strength of the prior on size; on position it is half of it.
const SIZE_PRIOR: f64 = 0.3;
/// Strength of the prior that draws the exponents to those of an ellipsoid.
const EXPONENT_PRIOR: f64 = 0.1;
/// Sharper edges than the lower bound cannot be told by touch.
const EXPONENTS: (f64, f64) = (0.1, 1.2);
/// A new shape starts somewhat smaller: an overestimate is probed in vain.
const SHRINK: f64 = -0.15;

/// A superquadric in the frame of the patch.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) centre: Vector,
    pub(super) log_axes: Vector,
    pub(super) rotation: Rotation3<f64>,
    pub(super) exponents: [f64; 2],
    /// How it is held by the first part of its union; nothing for a part that is free.
    pub(super) along: Option<Along>,
}

impl Part {
    pub(super) fn of(shape: &Superquadric, frame: &PatchFrame) -> Self {
        Self {
            centre: frame.local(&shape.centre),
            log_axes: shape.semi_axes.map(|a| clamp_log_size((a / frame.length_m).ln())),
            rotation: shape.base_from_template,
            exponents: shape.exponents,
            along: None,
        }
    }

    /// The same part in another frame.
    pub(super) fn moved(&self, from: &PatchFrame, to: &PatchFrame) -> Self {
        Self { along: self.along, ..Self::of(&self.shape(from), to) }
    }

    pub(super) fn shape(&self, frame: &PatchFrame) -> Superquadric {
        Superquadric {
            centre: frame.base(&self.centre),
            semi_axes: self.log_axes.map(f64::exp) * frame.length_m,
            base_from_template: self.rotation,
            exponents: self.exponents,
        }
    }

    /// The directions of its axes as columns, with another of them as the third.
    pub(super) fn axes_with_third(&self, axis: usize) -> Rotation3<f64> {
        let columns = cycle(axis).map(|k| self.rotation.matrix().column(k).into_owned());
        Rotation3::from_matrix_unchecked(Matrix3::from_columns(&columns))
    }

    /// The same body with another of its axes as the third, and other exponents.
    pub(super) fn squared(&self, axis: usize, exponents: [f64; 2]) -> Self {
        let order = cycle(axis);
        Self {
            centre: self.centre,
            log_axes: Vector::from_fn(|row, _| self.log_axes[order[row]] + SHRINK),
            rotation: self.axes_with_third(axis),
            exponents,
            along: None,
        }
    }

    pub(super) fn is_unbounded(&self) -> bool {
        self.log_axes.max() >= LOG_SIZE.1
    }

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

    /// The normal equations of all data and of the priors.
    pub(super) fn linearise(
        &self,
        limbs: &[Self],
        data: &FitData,
        others: &Distances,
    ) -> NormalEquations<11> {
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

    pub(super) fn retract(&self, step: &Row) -> Self {
        let part = |from: usize| Vector::new(step[from], step[from + 1], step[from + 2]);
        Self {
            centre: self.centre + part(0),
            log_axes: (self.log_axes + part(3)).map(clamp_log_size),
            rotation: self.rotation * Rotation3::new(part(6)),
            exponents: [0, 1].map(|k| (self.exponents[k] + step[9 + k]).clamp(EXPONENTS.0, EXPONENTS.1)),
            along: self.along,
        }
    }
}

/// The three axes in their order, the given one last.
pub(super) fn cycle(axis: usize) -> [usize; 3] {
    [(axis + 1) % 3, (axis + 2) % 3, axis]
}
