//! The kernel: the correlation of the displacements of two points of the template,
//!
//! ```text
//! k = (1 + r) exp(-r + 1.5 (n·n' - 1)),   r = √3 d / l
//! ```
//!
//! with `d` their distance, `l` the correlation length and `n`, `n'` their normals: Matérn 3/2 in the
//! distance, damped by the angle between the normals.

use faer::Mat;

use crate::geometry::{SurfacePoint, Vector};
use crate::vectorised::{exp_f32, widest};

/// Weight of the angle between normals in the kernel.
const NORMAL_WEIGHT: f32 = 1.5;
/// Known points whose kernels are evaluated at a time.
const LANES: usize = 32;

/// The coordinates of some points, then those of their normals, each for a block of points.
type Block = [[f32; LANES]; 6];

/// Points whose correlations with others are asked for, in single precision and relative to one of them, so
/// that nothing is lost far from the frame's origin.
#[derive(Debug)]
pub(super) struct Known {
    origin: Vector,
    blocks: Vec<Block>,
}

impl Known {
    /// Prepares some points.
    pub(super) fn new(points: &[SurfacePoint]) -> Self {
        let origin = points.first().map_or_else(Vector::zeros, |first| first.point);
        let block = |points: &[SurfacePoint]| {
            let mut block = [[0.0; LANES]; 6];
            for (lane, point) in points.iter().enumerate() {
                narrow(point, &origin).iter().zip(&mut block).for_each(|(value, lanes)| lanes[lane] = *value);
            }
            block
        };
        Self { origin, blocks: points.chunks(LANES).map(block).collect() }
    }

    /// Adds `variance` times the correlation of every known point (row) with every queried one (column).
    pub(super) fn add_covariances(
        &self,
        cross: &mut Mat<f32>,
        queried: &[SurfacePoint],
        length_m: f64,
        variance: f64,
    ) {
        let per_length = (3.0_f64.sqrt() / length_m) as f32;
        let variance = variance as f32;
        let Self { origin, blocks } = self;
        widest(
            #[inline(always)]
            || {
                for (column, query) in queried.iter().enumerate() {
                    let query = narrow(query, origin);
                    let sums = cross.col_as_slice_mut(column).chunks_mut(LANES);
                    for (block, sums) in blocks.iter().zip(sums) {
                        let values = correlations(block, &query, per_length);
                        for (sum, value) in sums.iter_mut().zip(&values) {
                            *sum += variance * value;
                        }
                    }
                }
            },
        );
    }
}

/// A point seen from an origin, and its normal.
#[inline(always)]
fn narrow(place: &SurfacePoint, origin: &Vector) -> [f32; 6] {
    let (point, normal) = (place.point - origin, place.normal);
    [point.x, point.y, point.z, normal.x, normal.y, normal.z].map(|value| value as f32)
}

/// The correlations of a block of points with one other.
#[inline(always)]
fn correlations(block: &Block, query: &[f32; 6], per_length: f32) -> [f32; LANES] {
    let [xs, ys, zs, us, vs, ws] = block;
    let [x, y, z, u, v, w] = *query;
    let mut values = [0.0; LANES];
    for lane in 0..LANES {
        let (dx, dy, dz) = (xs[lane] - x, ys[lane] - y, zs[lane] - z);
        let r = per_length * (dx * dx + dy * dy + dz * dz).sqrt();
        let cosine = us[lane] * u + vs[lane] * v + ws[lane] * w;
        values[lane] = (r + 1.0) * exp_f32(NORMAL_WEIGHT * (cosine - 1.0) - r);
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Icosphere;

    #[test]
    fn covariances_are_those_of_the_formula_in_double_precision() {
        let formula = |a: &SurfacePoint, b: &SurfacePoint| {
            let r = 3.0_f64.sqrt() * (a.point - b.point).norm() / 0.03;
            (1.0 + r) * (-r + 1.5 * (a.normal.dot(&b.normal) - 1.0)).exp()
        };
        // As far from the frame's origin as a workspace may reach.
        let far = Vector::new(9e3, -8e3, 7e3);
        let directions = Icosphere::get(3).directions.iter().map(|direction| direction.into_inner());
        let places: Vec<SurfacePoint> =
            directions.map(|normal| SurfacePoint { point: far + normal * 0.05, normal }).collect();
        let mut covariances = Mat::zeros(5, places.len());
        Known::new(&places[..5]).add_covariances(&mut covariances, &places, 0.03, 2.0);
        for (row, known) in places[..5].iter().enumerate() {
            for (column, queried) in places.iter().enumerate() {
                assert!((f64::from(covariances[(row, column)]) - 2.0 * formula(known, queried)).abs() < 1e-6);
            }
        }
    }
}
