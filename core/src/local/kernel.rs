//! The kernel: the correlation of the displacements of two points of the template,
//!
//! ```text
//! k = (1 + r) exp(-r + 1.5 (n·n' - 1)),   r = √3 d / l
//! ```
//!
//! with `d` their distance, `l` the correlation length and `n`, `n'` their normals: Matérn 3/2 in the
//! distance, damped by the angle between the normals.

use faer::Mat;
use wide::f32x8;

use crate::geometry::{SurfacePoint, Vector};

/// Weight of the angle between normals in the kernel.
const NORMAL_WEIGHT: f64 = 1.5;
/// Kernels that are evaluated at a time.
const LANES: usize = 8;

/// Adds `variance` times the correlation of every known point (row) with every queried one
/// (column).
///
/// In single precision, eight known points at a time, and relative to one of them, so that nothing
/// is lost far from the frame's origin.
pub(super) fn add_covariances(
    cross: &mut Mat<f32>,
    known: &[SurfacePoint],
    queried: &[SurfacePoint],
    length_m: f64,
    variance: f64,
) {
    let Some(origin) = known.first().map(|place| place.point) else { return };
    let narrow = |vector: &Vector| [0, 1, 2].map(|axis| vector[axis] as f32);
    let split = |place: &SurfacePoint| (narrow(&(place.point - origin)), narrow(&place.normal));
    let blocks: Vec<([f32x8; 3], [f32x8; 3])> = known
        .chunks(LANES)
        .map(|places| {
            let lanes: [_; LANES] = std::array::from_fn(|lane| split(&places[lane.min(places.len() - 1)]));
            let points = [0, 1, 2].map(|axis| f32x8::from(lanes.map(|(point, _)| point[axis])));
            let normals = [0, 1, 2].map(|axis| f32x8::from(lanes.map(|(_, normal)| normal[axis])));
            (points, normals)
        })
        .collect();
    let (per_length, normal_weight, variance) =
        ((3.0_f64.sqrt() / length_m) as f32, NORMAL_WEIGHT as f32, variance as f32);
    for (column, query) in queried.iter().enumerate() {
        let (point, normal) = split(query);
        for ((points, normals), sums) in blocks.iter().zip(cross.col_as_slice_mut(column).chunks_mut(LANES)) {
            let [dx, dy, dz] = [0, 1, 2].map(|axis| points[axis] - point[axis]);
            let [nx, ny, nz] = [0, 1, 2].map(|axis| normals[axis] * normal[axis]);
            let r = (dx * dx + dy * dy + dz * dz).sqrt() * per_length;
            let values = (r + 1.0) * ((nx + ny + nz - 1.0) * normal_weight - r).exp() * variance;
            for (sum, value) in sums.iter_mut().zip(values.to_array()) {
                *sum += value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Icosphere;

    #[test]
    fn covariances_are_those_of_the_formula_in_double_precision() {
        let formula = |a: &SurfacePoint, b: &SurfacePoint| {
            let r = 3.0_f64.sqrt() * (a.point - b.point).norm() / 0.03;
            (1.0 + r) * (-r + NORMAL_WEIGHT * (a.normal.dot(&b.normal) - 1.0)).exp()
        };
        // As far from the frame's origin as a workspace may reach.
        let far = Vector::new(9e3, -8e3, 7e3);
        let directions = Icosphere::get(3).directions.iter().map(|direction| direction.into_inner());
        let places: Vec<SurfacePoint> =
            directions.map(|normal| SurfacePoint { point: far + normal * 0.05, normal }).collect();
        let mut covariances = Mat::zeros(5, places.len());
        add_covariances(&mut covariances, &places[..5], &places, 0.03, 2.0);
        for (row, known) in places[..5].iter().enumerate() {
            for (column, queried) in places.iter().enumerate() {
                assert!((f64::from(covariances[(row, column)]) - 2.0 * formula(known, queried)).abs() < 1e-6);
            }
        }
    }
}
