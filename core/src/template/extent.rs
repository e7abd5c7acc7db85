//! How far the object reaches, by what was measured: templates that just hold all of it, and what it costs a
//! template to reach beyond.
//!
//! A fit that goes on from the one before does not come back from a template that has grown far past everything
//! known, nor from one whose axes lie askew: both follow from a patch on one side, before the first touches. Of two
//! templates that meet the measurements alike, the one that adds less to them is probed less in vain.

use nalgebra::Rotation3;

use super::fit_data::FitData;
use super::least_squares::NormalEquations;
use super::part::{Part, Row};
use super::patch_frame::{clamp_log_size, principal_axis};
use super::superquadric::{BOX, CYLINDER, ELLIPSOID};
use crate::geometry::Vector;

/// Weight of a length of the patch that a template reaches beyond all that was measured, along one of its axes: a
/// tenth of what it costs to miss one touch by as much.
const OVERREACH: f64 = 0.3;
/// So far an end may lie beyond it without cost, in lengths of the patch: an object is not over where nothing was
/// seen or touched yet.
const UNSEEN: f64 = 1.0;
/// What was measured may lie in a plane: a template is at least this thick, in lengths of the patch.
const LEAST_HALF: f64 = 1e-3;

/// A box, a plate, a rod and an ellipsoid about the principal axes of what was measured, that just hold it.
pub(super) fn holding(data: &FitData) -> [Part; 4] {
    let mean =
        data.surface.iter().map(|(point, weight)| point * weight.powi(2)).sum::<Vector>() / data.weight();
    let offsets: Vec<Vector> = data.surface.iter().map(|(point, weight)| (point - mean) * *weight).collect();
    let [thinnest, middle, longest] = [0, 1, 2].map(|rank| principal_axis(&offsets, rank));
    [
        around(data, [longest, middle, thinnest], BOX),
        around(data, [longest, middle, thinnest], CYLINDER),
        around(data, [middle, thinnest, longest], CYLINDER),
        around(data, [longest, middle, thinnest], ELLIPSOID),
    ]
}

/// The part with some axes that just holds what was measured.
fn around(data: &FitData, [first, second, third]: [Vector; 3], exponents: [f64; 2]) -> Part {
    let is_mirrored = first.cross(&second).dot(&third) < 0.0;
    let rotation =
        Rotation3::from_basis_unchecked(&[first, second, if is_mirrored { -third } else { third }]);
    let local = || data.surface.iter().map(|(point, _)| rotation.inverse_transform_vector(point));
    let low = local().fold(Vector::repeat(f64::INFINITY), |low, y| low.inf(&y));
    let high = local().fold(Vector::repeat(f64::NEG_INFINITY), |high, y| high.sup(&y));
    Part {
        centre: rotation * ((low + high) * 0.5),
        log_axes: ((high - low) * 0.5).map(|half| clamp_log_size(half.max(LEAST_HALF).ln())),
        rotation,
        exponents,
        along: None,
    }
}

impl Part {
    /// Adds what it costs that an end of an axis lies beyond all that was measured.
    pub(super) fn add_overreach(&self, equations: &mut NormalEquations<11>, data: &FitData) {
        let from =
            |(point, _): &(Vector, f64)| self.rotation.inverse_transform_vector(&(self.centre - point));
        // The centre, seen from each point.
        let centres: Vec<Vector> = data.surface.iter().map(from).collect();
        for axis in 0..3 {
            let half = self.log_axes[axis].exp();
            for side in [-1.0, 1.0] {
                let outermost = centres.iter().min_by(|a, b| (side * a[axis]).total_cmp(&(side * b[axis])));
                let Some(centre) = outermost else { continue };
                let beyond = side * centre[axis] + half - UNSEEN;
                if beyond > 0.0 {
                    let towards = Vector::ith(axis, side);
                    let mut row = Row::zeros();
                    row.fixed_rows_mut::<3>(0).copy_from(&(self.rotation * towards));
                    row[3 + axis] = half;
                    row.fixed_rows_mut::<3>(6).copy_from(&towards.cross(centre));
                    equations.add(OVERREACH * beyond, &(row * OVERREACH));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Icosphere, Point};
    use crate::template::PatchFrame;

    /// The corners of a box that lies askew, of 0.6 by 1 by 3 lengths of the patch.
    fn corners() -> (FitData, Vector, Rotation3<f64>) {
        let (centre, rotation) = (Vector::new(0.4, -0.7, 0.2), Rotation3::from_euler_angles(0.4, -0.8, 1.1));
        let half = Vector::new(0.3, 0.5, 1.5);
        let corner = |k: u32| {
            let signs = Vector::from_fn(|axis, _| if k >> axis & 1 == 1 { 1.0 } else { -1.0 });
            (centre + rotation * half.component_mul(&signs), 1.0)
        };
        let frame = PatchFrame {
            origin: Point::origin(),
            length_m: 0.03,
            visual_points: 1.0,
            centre: Vector::zeros(),
        };
        (FitData::of(frame, (0..8).map(corner).collect(), &[], &[]), centre, rotation)
    }

    fn overreach(part: &Part, data: &FitData) -> NormalEquations<11> {
        let mut equations = NormalEquations::zero();
        part.add_overreach(&mut equations, data);
        equations
    }

    fn cost(part: &Part, data: &FitData) -> f64 {
        overreach(part, data).cost
    }

    #[test]
    fn what_holds_the_corners_of_a_box_is_the_box() {
        let (data, centre, rotation) = corners();
        for part in holding(&data) {
            assert!((part.centre - centre).norm() < 1e-9, "{part:?}");
            let mut half: Vec<f64> = part.log_axes.iter().map(|log| log.exp()).collect();
            let longest = part.log_axes.imax();
            let axis = part.rotation.matrix().column(longest).dot(&rotation.matrix().column(2));
            assert!((axis.abs() - 1.0).abs() < 1e-9, "{part:?}");
            half.sort_by(f64::total_cmp);
            for (found, expected) in half.iter().zip([0.3, 0.5, 1.5]) {
                assert!((found - expected).abs() < 1e-9, "{part:?}");
            }
            assert!((part.rotation.matrix().determinant() - 1.0).abs() < 1e-9);
            assert!(cost(&part, &data) < 1e-12);
        }
    }

    #[test]
    fn every_end_beyond_what_was_measured_costs_by_the_square_of_how_far() {
        let (data, ..) = corners();
        let part = &holding(&data)[0];
        let longer = |by: f64| {
            let mut longer = part.clone();
            longer.log_axes[0] = (part.log_axes[0].exp() + UNSEEN + by).ln();
            longer
        };
        // Both ends of the axis.
        assert!((cost(&longer(2.0), &data) - OVERREACH.powi(2) * 4.0).abs() < 1e-9);
        assert!((cost(&longer(1.0), &data) - OVERREACH.powi(2)).abs() < 1e-9);
        assert!(cost(&longer(-UNSEEN - 0.5), &data) < 1e-12);
        // Moved along its axis, one end lies beyond and the other inside.
        let mut moved = longer(0.0);
        moved.centre += part.rotation.matrix().column(0);
        assert!((cost(&moved, &data) - 0.5 * OVERREACH.powi(2)).abs() < 1e-9);
    }

    #[test]
    fn the_cost_falls_along_its_gradient() {
        let (data, ..) = corners();
        let mut part = holding(&data)[0].clone();
        part.centre += Vector::new(0.3, -0.2, 0.4);
        part.rotation *= Rotation3::from_euler_angles(0.2, -0.1, 0.3);
        part.log_axes += Vector::repeat(1.2);
        let gradient = overreach(&part, &data).gradient;
        assert!(gradient.norm() > 0.1);
        for k in 0..11 {
            let moved =
                |by: f64| cost(&part.retract(&Row::from_fn(|row, _| if row == k { by } else { 0.0 })), &data);
            let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((slope - gradient[k]).abs() < 1e-6, "{k}: {slope} {}", gradient[k]);
        }
    }

    #[test]
    fn what_lies_in_a_plane_is_held_by_something_thin() {
        let (data, ..) = corners();
        let flat = |direction: &crate::geometry::Direction| (Vector::new(direction.x, direction.y, 0.0), 1.0);
        let flat: Vec<_> = Icosphere::get(1).directions.iter().map(flat).collect();
        for part in holding(&FitData::of(data.frame, flat, &[], &[])) {
            assert!((part.log_axes.min() - clamp_log_size(LEAST_HALF.ln())).abs() < 1e-9);
            assert!((part.log_axes.max().exp() - 1.0).abs() < 0.06, "{part:?}");
        }
    }
}
