//! Depth edges: a pixel there saw the object and what lies behind it at once, and its depth is of neither.
//!
//! Such flying pixels hang in the air between both. Along a plane, the inverse of the depth is linear over the image,
//! so that from one pixel to the next the depth z changes by no more than
//!
//! ```text
//! |z' - z| <= z tan(slant) / f
//! ```
//!
//! where 1 / f is the step between their rays, f being the focal length in pixels, and the slant is the angle between
//! the plane's normal and the ray. A surface that is slanted by more than 80 degrees is hardly seen by a depth camera,
//! so a pixel that differs from one of its eight neighbours by more than that lies at an edge: it is either mixed, or
//! next to one that is. Both go, which costs the object a rim of one or two pixels. What was not measured says
//! nothing.

use super::Intrinsics;
use super::values::Values;

/// The tangent of 80 degrees.
const STEEPEST: f64 = 5.671_281_819_617_71;
/// Neighbouring pixels of one surface may differ by this much in any case, in metres: a camera's noise at short range.
const NOISE_M: f64 = 0.002;
/// And by this many stored units, as each depth is rounded to one.
const NOISE_UNITS: f64 = 2.0;

/// What the depths of one surface may differ by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edges {
    /// Share of the depth to the neighbour in the row, in the column, and across.
    shares: [f64; 3],
    scale_m: f64,
    /// In metres.
    floor_m: f64,
}

impl Edges {
    pub(super) fn new(intrinsics: &Intrinsics, scale_m: f64) -> Self {
        let (along_row, along_column) = (1.0 / intrinsics.fx, 1.0 / intrinsics.fy);
        let shares = [along_row, along_column, along_row.hypot(along_column)].map(|step| STEEPEST * step);
        Self { shares, scale_m, floor_m: NOISE_M.max(NOISE_UNITS * scale_m) }
    }

    /// Whether the pixel, which was measured, differs from a neighbour by more than a surface explains.
    pub(super) fn is_at(&self, values: &Values, column: usize, row: usize) -> bool {
        let depth_m = self.scale_m * f64::from(values.at(column, row));
        let rows = row.saturating_sub(1)..=(row + 1).min(values.height - 1);
        rows.into_iter().any(|other_row| {
            let columns = column.saturating_sub(1)..=(column + 1).min(values.width - 1);
            columns.into_iter().any(|other_column| {
                let other_m = self.scale_m * f64::from(values.at(other_column, other_row));
                let share = self.shares[match (other_column == column, other_row == row) {
                    (false, true) => 0,
                    (true, false) => 1,
                    _ => 2,
                }];
                let may_m = self.floor_m.max(share * depth_m.min(other_m));
                other_m > 0.0 && (other_m - depth_m).abs() > may_m
            })
        })
    }
}
