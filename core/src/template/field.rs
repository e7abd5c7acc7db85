//! The signed distance of a part, evaluated at many points.

use super::part::Part;
use super::samples::{LANES, Lanes};
use super::superquadric::gauge;
use crate::geometry::Vector;
use crate::vectorised::{exp, ln, widest};

/// A part with what every evaluation of its distance needs.
#[derive(Clone, Debug)]
pub(super) struct Field<'a> {
    pub(super) part: &'a Part,
    axes: Vector,
    inverse_axes: Vector,
}

/// The signed distances of a block of points, with their derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Linearised {
    /// The signed distance to first order, in lengths of the patch.
    pub(super) residual: Lanes,
    /// Its derivatives by centre, logarithmic semi-axes, a rotation applied on the right, and the exponents.
    pub(super) rows: [Lanes; 11],
}

impl Part {
    /// Its signed distance, to be evaluated at many points.
    pub(super) fn field(&self) -> Field<'_> {
        let inverse_axes = self.log_axes.map(|p| (-p).exp());
        Field { part: self, axes: self.log_axes.map(f64::exp), inverse_axes }
    }
}

impl Field<'_> {
    /// The signed distances of a block of points to first order, with their derivatives.
    ///
    /// The derivative of the slope in the denominator is left out: it vanishes on the surface.
    pub(super) fn linearised(&self, points: &[Lanes; 3]) -> Linearised {
        let mut found = Linearised { residual: [0.0; LANES], rows: [[0.0; LANES]; 11] };
        let (rotation, centre) = (rows_of(self.part), [0, 1, 2].map(|axis| self.part.centre[axis]));
        let inverse_axes = [0, 1, 2].map(|axis| self.inverse_axes[axis]);
        let exponents = self.part.exponents;
        widest(
            #[inline(always)]
            || {
                for lane in 0..LANES {
                    let point = [points[0][lane], points[1][lane], points[2][lane]];
                    let (residual, row) = residual_at(&rotation, &centre, &inverse_axes, exponents, point);
                    found.residual[lane] = residual;
                    for (derivatives, derivative) in found.rows.iter_mut().zip(row) {
                        derivatives[lane] = derivative;
                    }
                }
            },
        );
        found
    }

    /// The signed distances of a block of points to first order, in lengths of the patch.
    pub(super) fn distances(&self, points: &[Lanes; 3]) -> Lanes {
        let mut found = [0.0; LANES];
        let (rotation, centre) = (rows_of(self.part), [0, 1, 2].map(|axis| self.part.centre[axis]));
        let inverse_axes = [0, 1, 2].map(|axis| self.inverse_axes[axis]);
        let exponents = self.part.exponents;
        widest(
            #[inline(always)]
            || {
                for lane in 0..LANES {
                    let point = [points[0][lane], points[1][lane], points[2][lane]];
                    found[lane] = residual_at(&rotation, &centre, &inverse_axes, exponents, point).0;
                }
            },
        );
        found
    }

    /// Which points of a block are outside the box around the part, and so outside: cheaper than their distances.
    pub(super) fn beyond(&self, points: &[Lanes; 3]) -> [bool; LANES] {
        let mut found = [false; LANES];
        let (rotation, centre) = (rows_of(self.part), [0, 1, 2].map(|axis| self.part.centre[axis]));
        let half = [0, 1, 2].map(|axis| self.axes[axis]);
        widest(
            #[inline(always)]
            || {
                for lane in 0..LANES {
                    let point = [points[0][lane], points[1][lane], points[2][lane]];
                    let local = local(&rotation, &centre, point);
                    let is_beyond = |axis: usize| local[axis].abs() > half[axis];
                    found[lane] = is_beyond(0) | is_beyond(1) | is_beyond(2);
                }
            },
        );
        found
    }
}

/// The rows of the rotation from a part's axes.
fn rows_of(part: &Part) -> [[f64; 3]; 3] {
    let matrix = part.rotation.matrix();
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

/// A point along a part's axes, seen from its centre.
#[inline(always)]
fn local([r0, r1, r2]: &[[f64; 3]; 3], centre: &[f64; 3], point: [f64; 3]) -> [f64; 3] {
    let [px, py, pz] = [point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]];
    [
        r0[0] * px + r1[0] * py + r2[0] * pz,
        r0[1] * px + r1[1] * py + r2[1] * pz,
        r0[2] * px + r1[2] * py + r2[2] * pz,
    ]
}

/// The residual of one point with its derivatives, in the order of [`Linearised::rows`].
#[inline(always)]
fn residual_at(
    rotation: &[[f64; 3]; 3],
    centre: &[f64; 3],
    inverse_axes: &[f64; 3],
    exponents: [f64; 2],
    point: [f64; 3],
) -> (f64, [f64; 11]) {
    let [r0, r1, r2] = rotation;
    let local = local(rotation, centre, point);
    let y = [local[0] * inverse_axes[0], local[1] * inverse_axes[1], local[2] * inverse_axes[2]];
    let [value, by_x, by_y, by_z, by_e1, by_e2] = gauge(y, exponents, exp, ln);
    let slope = [by_x * inverse_axes[0], by_y * inverse_axes[1], by_z * inverse_axes[2]];
    let norm = (slope[0] * slope[0] + slope[1] * slope[1] + slope[2] * slope[2]).sqrt();
    let per_slope = 1.0 / norm.max(1e-12);
    let row = [
        -per_slope * (r0[0] * slope[0] + r0[1] * slope[1] + r0[2] * slope[2]),
        -per_slope * (r1[0] * slope[0] + r1[1] * slope[1] + r1[2] * slope[2]),
        -per_slope * (r2[0] * slope[0] + r2[1] * slope[1] + r2[2] * slope[2]),
        -per_slope * by_x * y[0],
        -per_slope * by_y * y[1],
        -per_slope * by_z * y[2],
        per_slope * (slope[1] * local[2] - slope[2] * local[1]),
        per_slope * (slope[2] * local[0] - slope[0] * local[2]),
        per_slope * (slope[0] * local[1] - slope[1] * local[0]),
        per_slope * by_e1,
        per_slope * by_e2,
    ];
    ((value - 1.0) * per_slope, row)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Icosphere, Point};
    use crate::template::part::Row;
    use crate::template::patch_frame::PatchFrame;
    use nalgebra::Rotation3;

    #[test]
    fn distances_are_those_of_the_shape_and_on_it_their_derivatives_are_those_of_differences() {
        let part = Part {
            centre: Vector::new(0.3, -0.2, 0.5),
            log_axes: Vector::new(-0.2, -0.4, 0.3),
            rotation: Rotation3::from_euler_angles(0.3, -0.5, 0.9),
            exponents: [0.3, 0.8],
            along: None,
        };
        let unit = PatchFrame {
            origin: Point::origin(),
            length_m: 1.0,
            visual_points: 1.0,
            centre: Vector::zeros(),
        };
        let shape = part.shape(&unit);
        for (k, direction) in Icosphere::get(1).directions.iter().enumerate() {
            // On the surface, inside and outside in turn.
            let offset = shape.offset_towards(direction) * [1.0, 0.6, 1.5][k % 3];
            let block = [0, 1, 2].map(|axis| [part.centre[axis] + offset[axis]; LANES]);
            let found = part.field().linearised(&block);
            let expected = shape.distance_m(&(shape.centre + offset));
            assert!((found.residual[k % LANES] - expected).abs() < 1e-12, "{} {expected}", found.residual[0]);
            assert_eq!(found.residual, part.field().distances(&block));
            for parameter in (0..11).filter(|_| k % 3 == 0) {
                let step = Row::from_fn(|row, _| if row == parameter { 1e-7 } else { 0.0 });
                let moved = part.retract(&step).field().distances(&block)[0];
                let difference = (moved - found.residual[0]) / 1e-7;
                assert!((difference - found.rows[parameter][0]).abs() < 1e-4, "{parameter}: {difference}");
            }
        }
    }
}
