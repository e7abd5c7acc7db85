//! The displacement of the template as a Gaussian process over its surface, with its uncertainty.
//!
//! The kernel looks at where on the template two points lie and at their normals, so that the two
//! sides of a thin plate do not pull each other. Far from all evidence the displacement returns to
//! zero, the template itself: nothing is extrapolated without bound, as a thin plate does.

mod prediction;

use std::sync::Arc;

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, Mat, Par};
use nalgebra::{DMatrix, DVector, Matrix3};

use super::cholesky;
use super::observation::Observation;
use super::prior::{Places, Prior};
use crate::evidence::RigidOffset;
use crate::evidence::attractor::Rigid;
use crate::geometry::{SurfacePoint, Vector};

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

    pub(super) fn of_factor(
        prior: Prior,
        places: Arc<Places>,
        factor: Mat<f64>,
        observations: &[Observation],
    ) -> Self {
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
    pub(super) fn unconditioned(prior: Prior, places: Arc<Places>, count: usize) -> Self {
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::attractor::Group;
    use crate::geometry::{Direction, Icosphere, Point};
    use crate::local::prepared::Prepared;
    use crate::symmetry::{Symmetry, SymmetryFrame};
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
