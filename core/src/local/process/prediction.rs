//! What the conditioned process expects anywhere on the template, and how sure it is of that.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};

use super::Displacement;
use crate::geometry::SurfacePoint;
use crate::local::prior::Places;
use crate::vectorised::widest;

/// Points that are predicted at a time, and rows of the inverse factor that are applied to them at a time: the
/// covariances of a block stay in the cache.
const BLOCK: usize = 256;
const PANEL: usize = 48;

impl Displacement {
    /// The expected displacements at some points, in metres.
    pub fn means_m(&self, points: &[SurfacePoint]) -> Vec<f64> {
        points.chunks(BLOCK).flat_map(|points| self.weighted(&self.cross(points))).collect()
    }

    /// Expected displacements at many points, and their standard deviations at the first `deviating` of them,
    /// in metres.
    pub fn predict(&self, points: &[SurfacePoint], deviating: usize) -> (Vec<f64>, Vec<f64>) {
        let (own, shared) = self.prior.variances();
        let explaining = self.explaining();
        let (mut means, mut deviations) = (Vec::new(), Vec::new());
        let (deviating, others) = points.split_at(deviating.min(points.len()));
        for points in deviating.chunks(BLOCK) {
            let cross = self.cross(points);
            means.extend(self.weighted(&cross));
            let explained = explain(&explaining, &cross);
            let left = |column: usize| own + shared - f64::from(explained.col(column).squared_norm_l2());
            deviations.extend((0..points.len()).map(|column| left(column).max(0.0).sqrt()));
        }
        means.extend(self.means_m(others));
        (means, deviations)
    }

    /// Covariances that are left between the displacements at some points (rows) and at others
    /// (columns), in square metres: what a touch at one point says about another.
    pub fn covariance(&self, rows: &[SurfacePoint], columns: &[SurfacePoint]) -> Mat<f32> {
        let before = Places::new(&self.prior, rows).covariance(&self.prior, rows.len(), columns);
        let explaining = self.explaining();
        let explained = |points: &[SurfacePoint]| explain(&explaining, &self.cross(points));
        before - explained(rows).transpose() * explained(columns)
    }

    /// Covariances of the measurements (rows) with the displacements at some points (columns).
    fn cross(&self, points: &[SurfacePoint]) -> Mat<f32> {
        self.places.covariance(&self.prior, self.weights.len(), points)
    }

    fn weighted(&self, cross: &Mat<f32>) -> Vec<f64> {
        (0..cross.ncols()).map(|column| weighted_sum(cross.col_as_slice(column), &self.weights)).collect()
    }

    /// `L⁻¹` in single precision: by products with it, which are faster than solutions, [`explain`] finds what
    /// the measurements say.
    fn explaining(&self) -> Mat<f32> {
        let inverse = self.inverse_factor(0);
        Mat::from_fn(inverse.nrows(), inverse.ncols(), |row, column| inverse[(row, column)] as f32)
    }
}

/// The sum of products, many at a time.
fn weighted_sum(numbers: &[f32], weights: &[f64]) -> f64 {
    const LANES: usize = 16;
    widest(
        #[inline(always)]
        || {
            let mut sums = [0.0_f64; LANES];
            let (numbers, weights) = (numbers.chunks_exact(LANES), weights.chunks_exact(LANES));
            let rest = numbers.remainder().iter().zip(weights.remainder());
            let rest: f64 = rest.map(|(k, w)| f64::from(*k) * w).sum();
            for (numbers, weights) in numbers.zip(weights) {
                for lane in 0..LANES {
                    sums[lane] = f64::from(numbers[lane]).mul_add(weights[lane], sums[lane]);
                }
            }
            sums.iter().sum::<f64>() + rest
        },
    )
}

/// `L⁻¹ C`: columns whose squared length is the variance that the measurements explain.
fn explain(inverse: &Mat<f32>, cross: &Mat<f32>) -> Mat<f32> {
    let (count, points) = (cross.nrows(), cross.ncols());
    let mut explained = Mat::zeros(count, points);
    for from in (0..count).step_by(PANEL) {
        // Right of its diagonal the inverse is zero.
        let (rows, to) = (PANEL.min(count - from), (from + PANEL).min(count));
        let panel = explained.as_mut().submatrix_mut(from, 0, rows, points);
        let (inverse, cross) = (inverse.submatrix(from, 0, rows, to), cross.submatrix(0, 0, to, points));
        matmul(panel, Accum::Replace, inverse, cross, 1.0, Par::Seq);
    }
    explained
}
