//! The displacement of the template as a Gaussian process over its surface, with its uncertainty.
//!
//! The kernel looks at where on the template two points lie and at their normals, so that the two
//! sides of a thin plate do not pull each other. Far from all evidence the displacement returns to
//! zero, the template itself: nothing is extrapolated without bound, as a thin plate does.

use std::sync::Arc;

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, Mat, Par, Scale};

use nalgebra::{DMatrix, DVector, Matrix3};

use super::cholesky;
use super::kernel::Known;
use crate::evidence::RigidOffset;
use crate::evidence::attractor::Rigid;
use crate::geometry::{SurfacePoint, Vector};
use crate::symmetry::{Symmetry, SymmetryFrame};
use crate::vectorised::widest;

/// Share of the prior variance common to symmetric points.
const SYMMETRIC_SHARE: f64 = 0.9;
/// This share of the prior's variance is added to that of every measurement: the system stays
/// regular, whatever its kernels are rounded to.
const JITTER: f64 = 1e-5;
/// Points that are predicted at a time, and rows of the inverse factor that are applied to them at a time: the
/// covariances of a block stay in the cache.
const BLOCK: usize = 256;
const PANEL: usize = 48;
/// Where that does not do, this share of the largest variance is added, then ten times as much, so many times.
const FIRST_ADDED: f64 = 1e-9;
const ADDITIONS: usize = 14;

/// A measured displacement of the template.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// Where on the template.
    pub at: SurfacePoint,
    /// The height of the surface over the template there, in metres.
    pub height_m: f64,
    /// Standard deviation of the measurement, in metres.
    pub noise_m: f64,
    /// The rigid offsets that it shares with others: measured where a group of points is moved by `b` and turned
    /// by `w`, a height is less by `n · (b + w × r)`, `r` being the point's lever.
    pub rigid: [Option<Rigid>; 2],
}

impl Observation {
    /// A measurement with an error of its own only.
    pub fn new(at: SurfacePoint, height_m: f64, noise_m: f64) -> Self {
        Self { at, height_m, noise_m, rigid: [None; 2] }
    }

    /// Covariance of two measurements by the rigid offsets that they share, in square metres.
    fn shared_variance(&self, other: &Self) -> f64 {
        let (n, m) = (&self.at.normal, &other.at.normal);
        let shared = |(a, b): (&Option<Rigid>, &Option<Rigid>)| match (a, b) {
            (Some(a), Some(b)) if a.group == b.group => {
                a.std_m * b.std_m * n.dot(m) + a.turn_std * b.turn_std * a.turned(n).dot(&b.turned(m))
            }
            _ => 0.0,
        };
        self.rigid.iter().zip(&other.rigid).map(shared).sum()
    }
}

/// What is expected of a displacement before any measurement.
#[derive(Clone, Copy, Debug)]
pub struct Prior {
    /// Correlation length, in metres.
    pub length_m: f64,
    /// Amplitude: the standard deviation of a displacement, in metres.
    pub amplitude_m: f64,
    /// The symmetry, if any.
    pub frame: SymmetryFrame,
}

impl Prior {
    /// The shares of the variance that are a point's own and that are common to symmetric points.
    fn shares(&self) -> (f64, f64) {
        let share = if self.frame.symmetry == Symmetry::None { 0.0 } else { SYMMETRIC_SHARE };
        (1.0 - share, share)
    }

    /// The same as variances, in square metres.
    fn variances(&self) -> (f64, f64) {
        let (own, shared) = self.shares();
        (own * self.amplitude_m.powi(2), shared * self.amplitude_m.powi(2))
    }

    /// What is added to the variance of every measurement, in square metres.
    pub(super) fn jitter(&self) -> f64 {
        JITTER * self.amplitude_m.powi(2)
    }
}

/// Points with their representatives, prepared for covariances with others.
#[derive(Debug)]
struct Places {
    points: Known,
    representatives: Known,
}

impl Places {
    fn new(prior: &Prior, points: &[SurfacePoint]) -> Self {
        let representatives = prior.frame.representatives(points);
        Self { points: Known::new(points), representatives: Known::new(&representatives) }
    }

    /// Covariances of displacements at these points (rows) and at others (columns), in square metres.
    fn covariance(&self, prior: &Prior, rows: usize, columns: &[SurfacePoint]) -> Mat<f32> {
        let (own, shared) = prior.variances();
        let mut covariance = Mat::zeros(rows, columns.len());
        self.points.add_covariances(&mut covariance, columns, prior.length_m, own);
        if shared > 0.0 {
            let columns = prior.frame.representatives(columns);
            self.representatives.add_covariances(&mut covariance, &columns, prior.length_m, shared);
        }
        covariance
    }
}

/// A process for some measurements before they are weighed: what depends neither on its amplitude nor on their noise
/// is computed once, and it is conditioned with many of both.
#[derive(Clone, Debug)]
pub struct Prepared {
    prior: Prior,
    points: Arc<Vec<SurfacePoint>>,
    places: Arc<Places>,
    /// Correlations of the points themselves, whatever the symmetry.
    plain: Arc<Mat<f32>>,
    /// Correlations with the share of the symmetry.
    correlation: Arc<Mat<f32>>,
    /// Covariances by rigid offsets, below the diagonal and on it, in square metres.
    rigid: Arc<Mat<f64>>,
}

impl Prepared {
    /// Prepares the points of some measurements; the prior's amplitude does not matter.
    pub fn new(prior: Prior, observations: &[Observation]) -> Self {
        let points: Vec<SurfacePoint> = observations.iter().map(|o| o.at).collect();
        let count = points.len();
        let mut plain = Mat::zeros(count, count);
        Known::new(&points).add_covariances(&mut plain, &points, prior.length_m, 1.0);
        let mut rigid = Mat::zeros(count, count);
        for (column, other) in observations.iter().enumerate().filter(|(_, o)| o.rigid != [None; 2]) {
            for row in column..count {
                rigid[(row, column)] = observations[row].shared_variance(other);
            }
        }
        Self::symmetric(prior, Arc::new(points), Arc::new(plain), Arc::new(rigid))
    }

    /// The same under another symmetry.
    pub fn with_symmetry(&self, frame: SymmetryFrame) -> Self {
        let Self { prior, points, plain, rigid, .. } = self;
        let prior = Prior { frame, ..*prior };
        Self::symmetric(prior, Arc::clone(points), Arc::clone(plain), Arc::clone(rigid))
    }

    fn symmetric(
        prior: Prior,
        points: Arc<Vec<SurfacePoint>>,
        plain: Arc<Mat<f32>>,
        rigid: Arc<Mat<f64>>,
    ) -> Self {
        let places = Arc::new(Places::new(&prior, &points));
        let (own, shared) = prior.shares();
        let correlation = if shared > 0.0 {
            let representatives = prior.frame.representatives(&points);
            let mut correlation = plain.as_ref() * Scale(own as f32);
            places.representatives.add_covariances(
                &mut correlation,
                &representatives,
                prior.length_m,
                shared,
            );
            Arc::new(correlation)
        } else {
            Arc::clone(&plain)
        };
        Self { prior, points, places, plain, correlation, rigid }
    }

    /// Conditions the process with an amplitude, in metres, on the measurements with the noise that they have now.
    pub fn given(&self, amplitude_m: f64, observations: &[Observation]) -> Displacement {
        let (prior, places) = (Prior { amplitude_m, ..self.prior }, Arc::clone(&self.places));
        let count = observations.len();
        let variance = amplitude_m * amplitude_m;
        let system = || {
            let mut system = Mat::zeros(count, count);
            for column in 0..count {
                let below =
                    (self.correlation.col_as_slice(column).iter().zip(self.rigid.col_as_slice(column)))
                        .zip(system.col_as_slice_mut(column));
                for ((correlation, rigid), entry) in below.skip(column) {
                    *entry = variance * f64::from(*correlation) + rigid;
                }
                system[(column, column)] += observations[column].noise_m.powi(2) + prior.jitter();
            }
            system
        };
        match factorised(system) {
            Some(factor) => Displacement::of_factor(prior, places, factor, observations),
            None => Displacement::unconditioned(prior, places, count),
        }
    }
}

/// The displacement given all measurements.
#[derive(Clone, Debug)]
pub struct Displacement {
    prior: Prior,
    places: Arc<Places>,
    weights: Vec<f64>,
    /// `L`, where `L Lᵀ` is the matrix of the measurements' covariances.
    factor: Arc<Mat<f64>>,
    /// `dᵀ K⁻¹ d`: the squared size of the measurements in units of what was expected.
    squared_size: f64,
}

impl Displacement {
    /// Conditions the process on measurements.
    pub fn fit(prior: Prior, observations: &[Observation]) -> Self {
        Prepared::new(prior, observations).given(prior.amplitude_m, observations)
    }

    /// The process that is also conditioned on further measurements, the last of all that are given; none of them
    /// has an offset that it shares with others. Its factor is this one's with more rows.
    pub fn extended(&self, observations: &[Observation]) -> Self {
        let (known, count) = (self.weights.len(), observations.len());
        let points: Vec<SurfacePoint> = observations.iter().map(|o| o.at).collect();
        let places = Places::new(&self.prior, &points);
        let cross = places.covariance(&self.prior, count, &points[known..]);
        let mut beside = Mat::from_fn(known, count - known, |row, column| f64::from(cross[(row, column)]));
        solve_lower_triangular_in_place((*self.factor).as_ref(), beside.as_mut(), Par::Seq);
        let mut left =
            Mat::from_fn(count - known, count - known, |row, column| f64::from(cross[(known + row, column)]));
        for (at, observation) in observations[known..].iter().enumerate() {
            left[(at, at)] += self.noise_variance(observation);
        }
        matmul(left.as_mut(), Accum::Add, beside.transpose(), beside.as_ref(), -1.0, Par::Seq);
        let Some(corner) = cholesky::factor(left) else { return Self::fit(self.prior, observations) };
        let mut factor = Mat::zeros(count, count);
        factor.as_mut().submatrix_mut(0, 0, known, known).copy_from(&*self.factor);
        factor.as_mut().submatrix_mut(known, 0, count - known, known).copy_from(beside.transpose());
        factor.as_mut().submatrix_mut(known, known, count - known, count - known).copy_from(&corner);
        Self::of_factor(self.prior, Arc::new(places), factor, observations)
    }

    fn of_factor(prior: Prior, places: Arc<Places>, factor: Mat<f64>, observations: &[Observation]) -> Self {
        let mut solution = Mat::from_fn(observations.len(), 1, |row, _| observations[row].height_m);
        solve_lower_triangular_in_place(factor.as_ref(), solution.as_mut(), Par::Seq);
        let squared_size = solution.col(0).squared_norm_l2();
        if !squared_size.is_finite() {
            return Self::unconditioned(prior, places, observations.len());
        }
        solve_upper_triangular_in_place(factor.transpose(), solution.as_mut(), Par::Seq);
        let weights = solution.col_as_slice(0).to_vec();
        Self { prior, places, weights, factor: Arc::new(factor), squared_size }
    }

    /// The process that its measurements say nothing about, as they are no numbers that can be computed with: the
    /// template stays what it is, and nothing is less likely.
    fn unconditioned(prior: Prior, places: Arc<Places>, count: usize) -> Self {
        let factor = Arc::new(Mat::identity(count, count));
        Self { prior, places, weights: vec![0.0; count], factor, squared_size: f64::INFINITY }
    }

    /// What its factor takes in memory, in bytes.
    pub(crate) fn bytes(&self) -> usize {
        self.weights.len().pow(2) * size_of::<f64>()
    }

    /// What it was conditioned with.
    pub fn prior(&self) -> &Prior {
        &self.prior
    }

    /// The logarithm of the marginal likelihood, up to a constant: how well the prior foresaw the
    /// measurements.
    pub fn evidence(&self) -> f64 {
        let log_pivots: f64 = self.factor.diagonal().column_vector().iter().map(|pivot| pivot.ln()).sum();
        -0.5 * self.squared_size - log_pivots
    }

    /// Root mean square of what is left of the measurements it was conditioned with, in metres.
    pub fn residual_m(&self, observations: &[Observation]) -> f64 {
        // The noise term is exactly what separates the process from its measurements.
        let left = observations.iter().zip(&self.weights).map(|(o, w)| w * self.noise_variance(o));
        (left.map(|m| m * m).sum::<f64>() / observations.len().max(1) as f64).sqrt()
    }

    /// For each measurement from a first one on its share in how large the displacements are, squared and in
    /// units of the prior's variance, and in how many of them the measurements determine against their noise:
    /// the most likely amplitude is the one with which both sums are the same (MacKay's evidence
    /// framework).
    pub fn determined(&self, observations: &[Observation], first: usize) -> Vec<(f64, f64)> {
        let measurements = observations.iter().zip(&self.weights).skip(first).zip(self.precisions(first));
        let share = |((o, weight), precision): ((&Observation, &f64), f64)| {
            let variance = self.noise_variance(o);
            (weight * (o.height_m - variance * weight), 1.0 - variance * precision)
        };
        measurements.map(share).collect()
    }

    /// For the first measurement of each group what all outside of the group say of it: how far it lies from what
    /// they expect, in metres, and the variance of their expectation without the measurement's own noise, in square
    /// metres.
    pub fn left_out(&self, observations: &[Observation], groups: &[Vec<usize>]) -> Vec<(f64, f64)> {
        let inverse = self.inverse_factor(0);
        let precision = |a: usize, b: usize| {
            let from = a.max(b);
            let (a, b) = (&inverse.col_as_slice(a)[from..], &inverse.col_as_slice(b)[from..]);
            a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()
        };
        let of_first = |group: &Vec<usize>| {
            let among = |i: usize, j: usize| precision(group[i], group[j]);
            let covariances = DMatrix::from_fn(group.len(), group.len(), among).try_inverse()?;
            let weights = DVector::from_fn(group.len(), |i, _| self.weights[group[i]]);
            let own = self.noise_variance(&observations[group[0]]);
            Some(((&covariances * weights)[0], (covariances[(0, 0)] - own).max(0.0)))
        };
        // Where nothing is left to compare with, nothing is expected.
        let nothing = (0.0, self.prior.amplitude_m.powi(2));
        groups.iter().map(|group| of_first(group).unwrap_or(nothing)).collect()
    }

    /// What a group of measurements is off by as a whole.
    pub fn rigid_offset(&self, observations: &[Observation], rigid: Rigid) -> RigidOffset {
        let count = observations.len();
        let member = |o: &Observation| o.rigid.into_iter().flatten().find(|other| other.group == rigid.group);
        let variances = [rigid.std_m, rigid.turn_std].map(|std| std * std);
        // Covariances of translation and rotation with the measurements.
        let mut cross = [Mat::<f64>::zeros(count, 3), Mat::zeros(count, 3)];
        let mut means = [Vector::zeros(); 2];
        for (row, (o, weight)) in observations.iter().zip(&self.weights).enumerate() {
            let Some(member) = member(o) else { continue };
            let slopes = [o.at.normal, member.turned(&o.at.normal)];
            for part in 0..2 {
                let covariance = slopes[part] * -variances[part];
                means[part] += covariance * *weight;
                (0..3).for_each(|axis| cross[part][(row, axis)] = covariance[axis]);
            }
        }
        let deviation = |mut cross: Mat<f64>, variance: f64| {
            solve_lower_triangular_in_place((*self.factor).as_ref(), cross.as_mut(), Par::Seq);
            let product = |i, j| cross.col(i).iter().zip(cross.col(j).iter()).map(|(a, b)| a * b).sum();
            let left = Matrix3::identity() * variance - Matrix3::from_fn(product);
            left.symmetric_eigenvalues().max().max(0.0).sqrt()
        };
        let [mean, turn] = means;
        let [with_translation, with_turn] = cross;
        RigidOffset {
            mean,
            std_m: deviation(with_translation, variances[0]),
            turn,
            turn_std: deviation(with_turn, variances[1]),
        }
    }

    /// The diagonal of `K⁻¹` from a first measurement on.
    fn precisions(&self, first: usize) -> Vec<f64> {
        let inverse = self.inverse_factor(first);
        (0..inverse.ncols()).map(|column| inverse.col(column).squared_norm_l2()).collect()
    }

    /// The part of `L⁻¹` from a first measurement on, where `K = L Lᵀ`: the products of its columns are `K⁻¹`
    /// there.
    fn inverse_factor(&self, first: usize) -> Mat<f64> {
        let count = self.weights.len() - first;
        let mut inverse = Mat::<f64>::zeros(count, count);
        let factor = self.factor.submatrix(first, first, count, count);
        invert_lower_triangular(inverse.as_mut(), factor, Par::Seq);
        inverse
    }

    /// The variance of a measurement, jitter included, in square metres.
    fn noise_variance(&self, observation: &Observation) -> f64 {
        observation.noise_m.powi(2) + self.prior.jitter()
    }

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

/// The Cholesky factor of a kernel matrix with noise. It is positive definite but for rounding, against which more
/// and more is added to its diagonal; nothing where its entries are no numbers.
fn factorised(system: impl Fn() -> Mat<f64>) -> Option<Mat<f64>> {
    if let Some(factor) = cholesky::factor(system()) {
        return Some(factor);
    }
    let system = system();
    let diagonal = || system.diagonal().column_vector();
    let largest = diagonal().iter().fold(0.0, |most, entry| f64::max(most, *entry));
    let mut added = 0.0;
    let mut more = FIRST_ADDED * largest.max(f64::MIN_POSITIVE);
    for _ in 0..ADDITIONS {
        added += more;
        let mut raised = system.clone();
        (0..system.nrows()).for_each(|at| raised[(at, at)] += added);
        if let Some(factor) = cholesky::factor(raised) {
            return Some(factor);
        }
        more *= 10.0;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::attractor::Group;
    use crate::geometry::{Direction, Icosphere, Point};
    use nalgebra::Rotation3;

    fn prior(symmetry: Symmetry) -> Prior {
        let frame = SymmetryFrame { centre: Point::origin(), axes: Rotation3::identity(), symmetry };
        Prior { length_m: 0.03, amplitude_m: 0.005, frame }
    }

    fn observation(direction: &Direction, height_m: f64) -> Observation {
        Observation::new(place(direction), height_m, 1e-5)
    }

    fn place(direction: &Direction) -> SurfacePoint {
        SurfacePoint { point: direction.into_inner() * 0.05, normal: direction.into_inner() }
    }

    fn directions() -> &'static [Direction] {
        &Icosphere::get(3).directions
    }

    fn places() -> Vec<SurfacePoint> {
        directions().iter().map(place).collect()
    }

    #[test]
    fn measurements_are_met_and_far_from_them_the_template_returns() {
        let process = Displacement::fit(prior(Symmetry::None), &[observation(&Vector::x_axis(), 0.004)]);
        let at = |d: Direction| process.predict(&[place(&d)], 1);
        let (mean, deviation) = at(Vector::x_axis());
        assert!((mean[0] - 0.004).abs() < 1e-6 && deviation[0] < 2e-5);
        let (mean, deviation) = at(-Vector::x_axis());
        assert!(mean[0].abs() < 1e-4 && (deviation[0] - 0.005).abs() < 1e-5);
    }

    #[test]
    fn numbers_that_cannot_be_computed_with_leave_the_template_as_it_is() {
        let elsewhere = Vector::y_axis();
        for (height_m, length_m) in [(f64::NAN, 0.03), (0.004, f64::NAN), (1e200, 0.03), (0.004, 0.0)] {
            let prior = Prior { length_m, ..prior(Symmetry::None) };
            let seen = [observation(&Vector::x_axis(), height_m), observation(&elsewhere, height_m)];
            let process = Displacement::fit(prior, &seen);
            assert!(process.evidence() < 0.0, "{height_m} {length_m}");
            if length_m > 0.0 {
                let (mean, deviation) = process.predict(&[place(&Vector::z_axis())], 1);
                assert_eq!((mean[0], deviation[0].is_finite()), (0.0, true), "{height_m} {length_m}");
            }
        }
    }

    #[test]
    fn a_matrix_that_rounding_has_spoilt_is_mended_by_its_diagonal() {
        // Its eigenvalues are 2 and -1e-7.
        let spoilt = Mat::from_fn(2, 2, |row, column| if row == column { 1.0 } else { 1.0 + 1e-7 });
        assert!(cholesky::factor(spoilt.clone()).is_none() && factorised(|| spoilt.clone()).is_some());
        assert!(factorised(|| Mat::from_fn(2, 2, |_, _| f64::NAN)).is_none());
    }

    #[test]
    fn covariances_of_places_with_themselves_are_their_variances() {
        let seen: Vec<Observation> = directions().iter().step_by(40).map(|d| observation(d, 0.001)).collect();
        let places = places();
        for symmetry in [Symmetry::None, Symmetry::Revolution(2), Symmetry::Mirror([true, false, true])] {
            let process = Displacement::fit(prior(symmetry), &seen);
            let (_, deviations) = process.predict(&places, places.len());
            let covariance = process.covariance(&places[..30], &places);
            for row in 0..30 {
                assert!((f64::from(covariance[(row, row)]) - deviations[row].powi(2)).abs() < 1e-10);
                assert!((covariance[(row, 7)] - covariance[(7, row)]).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn both_sums_are_the_same_where_the_amplitude_is_the_most_likely() {
        let seen: Vec<Observation> = directions()
            .iter()
            .step_by(12)
            .enumerate()
            .map(|(k, d)| {
                let scatter_m = 0.0005 * ((k * 7 % 11) as f64 - 5.0) / 3.0;
                Observation { noise_m: 0.0005, ..observation(d, 0.002 * (5.0 * d.x + d.z).sin() + scatter_m) }
            })
            .collect();
        let first = Prepared::new(prior(Symmetry::None), &seen);
        let amplitudes_m = (0..400).map(|step| 0.0003 * 1.01_f64.powi(step));
        let most_likely = amplitudes_m
            .map(|amplitude_m| first.given(amplitude_m, &seen))
            .max_by(|a, b| a.evidence().total_cmp(&b.evidence()))
            .unwrap();
        let shares = most_likely.determined(&seen, 0);
        let (squares, count) = shares.iter().fold((0.0, 0.0), |sum, s| (sum.0 + s.0, sum.1 + s.1));
        assert!((squares / count - 1.0).abs() < 0.02, "{squares} of {count}");
        assert!(count > 5.0 && count < seen.len() as f64);
    }

    #[test]
    fn a_rigid_offset_is_found_with_its_rotation_where_the_surface_is_known() {
        let (translation, turn) = (Vector::new(0.002, -0.001, 0.003), Vector::new(0.004, -0.008, 0.006));
        // The three faces of a corner, 60 mm wide: each shows two axes of the rotation.
        let face = |axis: usize| {
            (0..36).map(move |k| {
                let (u, v) = (0.01 * f64::from(k % 6), 0.01 * f64::from(k / 6));
                let mut lever = Vector::zeros();
                (lever[(axis + 1) % 3], lever[(axis + 2) % 3]) = (u - 0.025, v - 0.025);
                let normal = Vector::ith(axis, 1.0);
                let moved = translation + turn.cross(&lever);
                let rigid = Rigid { group: Group::View(0), std_m: 0.003, turn_std: 0.01, lever };
                Observation {
                    rigid: [Some(rigid), None],
                    ..Observation::new(SurfacePoint { point: lever, normal }, -normal.dot(&moved), 1e-5)
                }
            })
        };
        let seen: Vec<Observation> = (0..3).flat_map(face).collect();
        let known = Prior { amplitude_m: 1e-5, ..prior(Symmetry::None) };
        let offset = Displacement::fit(known, &seen).rigid_offset(&seen, seen[0].rigid[0].unwrap());
        assert!((offset.mean - translation).norm() < 1e-5 && offset.std_m < 1e-4, "{offset:?}");
        assert!((offset.turn - turn).norm() < 1e-4 && offset.turn_std < 1e-3, "{offset:?}");
        // A plane alone does not say how it is turned about its normal, nor how it is moved along itself.
        let plane = &seen[..36];
        let offset = Displacement::fit(known, plane).rigid_offset(plane, plane[0].rigid[0].unwrap());
        assert!((offset.std_m - 0.003).abs() < 1e-9 && (offset.turn_std - 0.01).abs() < 1e-9, "{offset:?}");
    }

    #[test]
    fn what_was_prepared_gives_what_a_fit_does() {
        let seen: Vec<Observation> =
            directions().iter().step_by(60).map(|d| observation(d, 0.003 * d.x)).collect();
        let noisier: Vec<Observation> = seen.iter().map(|o| Observation { noise_m: 0.001, ..*o }).collect();
        let larger = Prior { amplitude_m: 0.02, ..prior(Symmetry::Revolution(0)) };
        let fresh = Displacement::fit(larger, &noisier);
        let again = Prepared::new(prior(Symmetry::Revolution(0)), &seen).given(0.02, &noisier);
        assert_eq!((fresh.evidence(), &fresh.weights), (again.evidence(), &again.weights));
        let symmetric = Prepared::new(prior(Symmetry::None), &seen).with_symmetry(larger.frame);
        let symmetric = symmetric.given(0.02, &noisier);
        assert_eq!((fresh.evidence(), &fresh.weights), (symmetric.evidence(), &symmetric.weights));
    }

    #[test]
    fn a_process_that_is_extended_is_the_one_of_all_measurements() {
        let seen: Vec<Observation> = directions()
            .iter()
            .step_by(7)
            .map(|d| Observation { noise_m: 0.0005, ..observation(d, 0.003 * (4.0 * d.x + d.y).sin()) })
            .collect();
        let places = places();
        for symmetry in [Symmetry::None, Symmetry::Revolution(2)] {
            let all = Displacement::fit(prior(symmetry), &seen);
            for known in [seen.len() - 1, seen.len() / 2, 1] {
                let extended = Displacement::fit(prior(symmetry), &seen[..known]).extended(&seen);
                assert!((extended.evidence() / all.evidence() - 1.0).abs() < 1e-5);
                let (means, deviations) = extended.predict(&places, places.len());
                let (expected, expected_deviations) = all.predict(&places, places.len());
                let differ =
                    |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(differ(&means, &expected) < 1e-7 && differ(&deviations, &expected_deviations) < 1e-6);
            }
        }
    }

    #[test]
    fn more_measurements_never_widen_the_uncertainty() {
        let places = places();
        let mut seen = Vec::new();
        let mut before = vec![f64::INFINITY; places.len()];
        for direction in directions().iter().step_by(30) {
            seen.push(observation(direction, 0.001));
            let (_, after) = Displacement::fit(prior(Symmetry::None), &seen).predict(&places, places.len());
            assert!(before.iter().zip(&after).all(|(before, after)| *after <= before + 5e-6));
            before = after;
        }
    }

    #[test]
    fn evidence_finds_the_symmetry_that_the_measurements_have() {
        // Bumps that depend on the height alone.
        let seen: Vec<Observation> =
            directions().iter().step_by(9).map(|d| observation(d, 0.004 * (4.0 * d.z).sin())).collect();
        let evidence = |symmetry| Displacement::fit(prior(symmetry), &seen).evidence();
        let revolution = evidence(Symmetry::Revolution(2));
        assert!(revolution > evidence(Symmetry::None) + 5.0);
        assert!(revolution > evidence(Symmetry::Revolution(0)) + 5.0);
    }
}
