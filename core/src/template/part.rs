//! One superquadric of a compound template, as parameters that can be fitted.

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector};
use serde::{Deserialize, Serialize};

use super::patch_frame::{LOG_SIZE, PatchFrame, clamp_log_size};
use super::superquadric::Superquadric;
use crate::fingerprint::Fingerprint;
use crate::geometry::Vector;

/// Derivatives by centre, logarithmic semi-axes, a rotation applied on the right, and exponents.
pub(super) type Row = SVector<f64, 11>;
/// What of a step is left to a part that is not free.
pub(super) type Freedom = SMatrix<f64, 11, 11>;

/// Sharper edges than the lower bound cannot be told by touch.
const EXPONENTS: (f64, f64) = (0.1, 1.2);
/// A new shape starts somewhat smaller: an overestimate is probed in vain.
const SHRINK: f64 = -0.15;

/// The axis of the host that a limb stays on, and the end (-1 or 1) that it comes out of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Along {
    pub(super) axis: usize,
    pub(super) side: f64,
}

/// A superquadric in the frame of the patch.
#[derive(Clone, Debug, Serialize, Deserialize)]
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

    /// Adds itself to a fingerprint.
    pub(super) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self { centre, log_axes, rotation, exponents, along } = self;
        fingerprint.vector(centre);
        fingerprint.vector(log_axes);
        fingerprint.rotation(rotation);
        fingerprint.numbers(exponents);
        let held = along.map(|along| [along.axis as f64, along.side]);
        fingerprint.numbers(held.as_ref().map_or(&[], |held| held));
    }

    pub(super) fn is_unbounded(&self) -> bool {
        self.log_axes.max() >= LOG_SIZE.1
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
