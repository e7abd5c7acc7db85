//! Local displacement as a Gaussian process over the template's surface, with its uncertainty.
//!
//! The kernel sees where on the template two places lie and which way they face, so that the two
//! sides of a thin plate do not pull each other. Far from all evidence the displacement returns to
//! zero, the template itself: nothing is extrapolated without bound, as a thin plate does.

use std::sync::Arc;

use faer::linalg::solvers::Solve;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Col, Mat, Par, Side};
use wide::f64x4;

use crate::geometry::{Direction, Point, Vector};
use crate::symmetry::{Fold, Place, Symmetry};

/// How strongly a turn of the normal separates two places.
const TURN: f64 = 1.5;
/// The share of the variance that places have in common which a symmetry makes alike.
const SHARE: f64 = 0.9;
/// Added to the variance of every measurement, in square metres: keeps the system regular.
const JITTER: f64 = 1e-10;

/// A measured displacement of the template.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// Where on the template.
    pub place: Place,
    /// The height of the surface over the template there, in metres.
    pub displacement_m: f64,
    /// Standard deviation of the measurement, in metres.
    pub noise_m: f64,
}

/// What is expected of a displacement before any measurement.
#[derive(Clone, Copy, Debug)]
pub struct Prior {
    /// Over what length displacements are alike, in metres.
    pub length_m: f64,
    /// Their standard deviation, in metres.
    pub amplitude_m: f64,
    /// What else is alike.
    pub fold: Fold,
}

impl Prior {
    /// The shares of the variance that are a place's own and that of all places alike.
    fn shares(&self) -> (f64, f64) {
        let share = if self.fold.symmetry == Symmetry::None { 0.0 } else { SHARE };
        (1.0 - share, share)
    }

    /// The same as variances, in square metres.
    fn variances(&self) -> (f64, f64) {
        let (own, shared) = self.shares();
        (own * self.amplitude_m.powi(2), shared * self.amplitude_m.powi(2))
    }
}

/// The places of some measurements and how alike they are: it depends neither on how large
/// displacements are nor on how noisy the measurements.
#[derive(Debug)]
struct Gram {
    places: Vec<Place>,
    folded: Vec<Place>,
    /// Correlations, of which the lower triangle is filled.
    correlation: Mat<f64>,
}

impl Gram {
    fn new(prior: &Prior, observations: &[Observation]) -> Self {
        let places: Vec<Place> = observations.iter().map(|o| o.place).collect();
        let folded: Vec<Place> = places.iter().map(|place| prior.fold.apply(place)).collect();
        let (own, shared) = prior.shares();
        let mut correlation = Mat::zeros(places.len(), places.len());
        for row in 0..places.len() {
            for column in 0..=row {
                let alike =
                    if shared > 0.0 { kernel(&folded[row], &folded[column], prior.length_m) } else { 0.0 };
                correlation[(row, column)] =
                    own * kernel(&places[row], &places[column], prior.length_m) + shared * alike;
            }
        }
        Self { places, folded, correlation }
    }
}

/// The displacement given all measurements.
#[derive(Clone, Debug)]
pub struct Displacement {
    prior: Prior,
    gram: Arc<Gram>,
    weights: Vec<f64>,
    factor: Mat<f64>,
    surprise: f64,
}

impl Displacement {
    /// Conditions the process on measurements.
    pub fn fit(prior: Prior, observations: &[Observation]) -> Self {
        Self::conditioned(prior, Arc::new(Gram::new(&prior, observations)), observations)
    }

    /// The same process for displacements of another size, or for measurements at the same places
    /// with another noise.
    pub fn refit(&self, amplitude_m: f64, observations: &[Observation]) -> Self {
        Self::conditioned(Prior { amplitude_m, ..self.prior }, Arc::clone(&self.gram), observations)
    }

    fn conditioned(prior: Prior, gram: Arc<Gram>, observations: &[Observation]) -> Self {
        let count = observations.len();
        let variance = prior.amplitude_m * prior.amplitude_m;
        let mut system = Mat::zeros(count, count);
        for column in 0..count {
            for row in column..count {
                system[(row, column)] = variance * gram.correlation[(row, column)];
            }
            system[(column, column)] += observations[column].noise_m.powi(2) + JITTER;
        }
        let factor = system.llt(Side::Lower).expect("a kernel matrix with noise is positive definite");
        let measured = Col::from_fn(count, |row| observations[row].displacement_m);
        let solution = factor.solve(&measured);
        Self {
            prior,
            gram,
            weights: solution.iter().copied().collect(),
            factor: factor.L().to_owned(),
            surprise: measured.iter().zip(solution.iter()).map(|(d, w)| d * w).sum(),
        }
    }

    /// What it was conditioned with.
    pub fn prior(&self) -> &Prior {
        &self.prior
    }

    /// `dᵀ K⁻¹ d`: the squared size of the measurements in units of what was expected.
    pub fn surprise(&self) -> f64 {
        self.surprise
    }

    /// The logarithm of the marginal likelihood, up to a constant: how well the prior foresaw the
    /// measurements.
    pub fn evidence(&self) -> f64 {
        let log_pivots: f64 = self.factor.diagonal().column_vector().iter().map(|pivot| pivot.ln()).sum();
        -0.5 * self.surprise - log_pivots
    }

    /// Root mean square of what is left of the measurements it was conditioned with, in metres.
    pub fn residual_m(&self, observations: &[Observation]) -> f64 {
        // The noise term is exactly what separates the process from its measurements.
        let left = observations.iter().zip(&self.weights).map(|(o, w)| w * (o.noise_m.powi(2) + JITTER));
        (left.map(|m| m * m).sum::<f64>() / observations.len().max(1) as f64).sqrt()
    }

    /// How far each measurement is from what all others foresee, in metres.
    pub fn left_out_m(&self) -> Vec<f64> {
        let count = self.weights.len();
        let mut inverse = Mat::<f64>::identity(count, count);
        solve_lower_triangular_in_place(self.factor.as_ref(), inverse.as_mut(), Par::Seq);
        (0..count).map(|k| self.weights[k] / inverse.col(k).squared_norm_l2()).collect()
    }

    /// A lower bound of the condition number, from the extreme pivots.
    pub fn condition(&self) -> f64 {
        let pivots = self.factor.diagonal().column_vector();
        let (low, high) =
            pivots.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), p| (low.min(*p), high.max(*p)));
        (high / low).powi(2)
    }

    /// The expected displacement at one place, in metres.
    pub fn mean_m(&self, place: &Place) -> f64 {
        let (own, shared) = self.prior.variances();
        let folded = self.prior.fold.apply(place);
        let covariance = |k: usize| {
            let alike = if shared > 0.0 {
                shared * kernel(&folded, &self.gram.folded[k], self.prior.length_m)
            } else {
                0.0
            };
            own * kernel(place, &self.gram.places[k], self.prior.length_m) + alike
        };
        (0..self.weights.len()).map(|k| self.weights[k] * covariance(k)).sum()
    }

    /// Covariances that are left between the displacements at some places (rows) and at others
    /// (columns), in square metres: what a touch at one place says about another.
    pub fn covariance(&self, rows: &[Place], columns: &[Place]) -> Mat<f64> {
        let (own, shared) = self.prior.variances();
        let fold = |places: &[Place]| -> Vec<Place> {
            places.iter().map(|place| self.prior.fold.apply(place)).collect()
        };
        let before = |from: &[Place], from_folded: &[Place], to: &[Place]| {
            let mut covariance = Mat::zeros(from.len(), to.len());
            add_covariances(&mut covariance, from, to, self.prior.length_m, own);
            if shared > 0.0 {
                add_covariances(&mut covariance, from_folded, &fold(to), self.prior.length_m, shared);
            }
            covariance
        };
        let explained = |places: &[Place]| {
            let mut cross = before(&self.gram.places, &self.gram.folded, places);
            solve_lower_triangular_in_place(self.factor.as_ref(), cross.as_mut(), Par::Seq);
            cross
        };
        before(rows, &fold(rows), columns) - explained(rows).transpose() * explained(columns)
    }

    /// Expected displacements and their standard deviations at many places, in metres.
    pub fn predict(&self, points: &[Point], normals: &[Direction]) -> (Vec<f64>, Vec<f64>) {
        let places: Vec<Place> = points.iter().zip(normals).map(|(p, n)| Place::new(p, n)).collect();
        let (own, shared) = self.prior.variances();
        let mut cross = Mat::zeros(self.gram.places.len(), places.len());
        add_covariances(&mut cross, &self.gram.places, &places, self.prior.length_m, own);
        if shared > 0.0 {
            let folded: Vec<Place> = places.iter().map(|place| self.prior.fold.apply(place)).collect();
            add_covariances(&mut cross, &self.gram.folded, &folded, self.prior.length_m, shared);
        }
        let mean = |column: usize| cross.col(column).iter().zip(&self.weights).map(|(k, w)| k * w).sum();
        let means = (0..places.len()).map(mean).collect();
        solve_lower_triangular_in_place(self.factor.as_ref(), cross.as_mut(), Par::Seq);
        let left = |column: usize| own + shared - cross.col(column).squared_norm_l2();
        let deviations = (0..places.len()).map(|column| left(column).max(0.0).sqrt()).collect();
        (means, deviations)
    }
}

/// The process at the vertices of an estimate.
#[derive(Clone, Debug)]
pub struct VertexProcess {
    process: Displacement,
    places: Vec<Place>,
    deviations_m: Vec<f64>,
}

impl VertexProcess {
    /// The process with, for each vertex, the place on the template that it was displaced from and
    /// the process's deviation there, in metres.
    pub fn new(process: Displacement, places: Vec<Place>, deviations_m: Vec<f64>) -> Self {
        Self { process, places, deviations_m }
    }

    /// Correlations that are left between some vertices (rows) and others (columns), in [-1, 1].
    pub fn correlation(&self, rows: &[u32], columns: &[u32]) -> Mat<f64> {
        let places = |vertices: &[u32]| -> Vec<Place> {
            vertices.iter().map(|&vertex| self.places[vertex as usize]).collect()
        };
        let mut correlation = self.process.covariance(&places(rows), &places(columns));
        let deviation_m = |vertex: u32| self.deviations_m[vertex as usize];
        for (row, &from) in rows.iter().enumerate() {
            for (column, &to) in columns.iter().enumerate() {
                // Where nothing is left to learn nothing is said about others.
                let scale = (deviation_m(from) * deviation_m(to)).max(JITTER);
                correlation[(row, column)] = (correlation[(row, column)] / scale).clamp(-1.0, 1.0);
            }
        }
        correlation
    }
}

/// Correlation of two displacements: Matern 3/2 of the distance, damped by the turn of the normals.
fn kernel(a: &Place, b: &Place, length_m: f64) -> f64 {
    let r = 3.0_f64.sqrt() * (a.point - b.point).norm() / length_m;
    (1.0 + r) * (TURN * (a.normal.dot(&b.normal) - 1.0) - r).exp()
}

/// Adds `variance * kernel` for every known place (row) and queried place (column), four at a time.
fn add_covariances(cross: &mut Mat<f64>, known: &[Place], queried: &[Place], length_m: f64, variance: f64) {
    let per_length = 3.0_f64.sqrt() / length_m;
    for (block, queries) in queried.chunks(4).enumerate() {
        let lanes = |value: fn(&Place) -> &Vector, axis: usize| {
            f64x4::from(std::array::from_fn(|lane| value(&queries[lane.min(queries.len() - 1)])[axis]))
        };
        let points = [0, 1, 2].map(|axis| lanes(|place| &place.point, axis));
        let normals = [0, 1, 2].map(|axis| lanes(|place| &place.normal, axis));
        for (row, place) in known.iter().enumerate() {
            let [dx, dy, dz] = [0, 1, 2].map(|axis| points[axis] - place.point[axis]);
            let [nx, ny, nz] = [0, 1, 2].map(|axis| normals[axis] * place.normal[axis]);
            let r = (dx * dx + dy * dy + dz * dz).sqrt() * per_length;
            let values = (r + 1.0) * ((nx + ny + nz - 1.0) * TURN - r).exp() * variance;
            for (lane, value) in values.to_array().into_iter().enumerate().take(queries.len()) {
                cross[(row, 4 * block + lane)] += value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Icosphere;
    use nalgebra::Rotation3;

    fn prior(symmetry: Symmetry) -> Prior {
        let fold = Fold { centre: Point::origin(), axes: Rotation3::identity(), symmetry };
        Prior { length_m: 0.03, amplitude_m: 0.005, fold }
    }

    fn observation(direction: &Direction, displacement_m: f64) -> Observation {
        let place = Place { point: direction.into_inner() * 0.05, normal: direction.into_inner() };
        Observation { place, displacement_m, noise_m: 1e-5 }
    }

    fn sphere() -> (Vec<Point>, Vec<Direction>) {
        let directions = Icosphere::get(3).directions.clone();
        (directions.iter().map(|d| Point::from(d.into_inner() * 0.05)).collect(), directions)
    }

    #[test]
    fn measurements_are_met_and_far_from_them_the_template_returns() {
        let process = Displacement::fit(prior(Symmetry::None), &[observation(&Vector::x_axis(), 0.004)]);
        let at = |d: Direction| process.predict(&[Point::from(d.into_inner() * 0.05)], &[d]);
        let (mean, deviation) = at(Vector::x_axis());
        assert!((mean[0] - 0.004).abs() < 1e-6 && deviation[0] < 2e-5);
        let (mean, deviation) = at(-Vector::x_axis());
        assert!(mean[0].abs() < 1e-4 && (deviation[0] - 0.005).abs() < 1e-5);
    }

    #[test]
    fn one_place_and_many_places_are_answered_alike() {
        let seen: Vec<Observation> =
            sphere().1.iter().step_by(40).enumerate().map(|(k, d)| observation(d, 1e-4 * k as f64)).collect();
        for symmetry in [Symmetry::None, Symmetry::Revolution(2), Symmetry::Mirror([true, false, true])] {
            let process = Displacement::fit(prior(symmetry), &seen);
            let (points, normals) = sphere();
            let (means, _) = process.predict(&points, &normals);
            for ((point, normal), mean) in points.iter().zip(&normals).zip(means) {
                assert!((process.mean_m(&Place::new(point, normal)) - mean).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn covariances_of_places_with_themselves_are_their_variances() {
        let seen: Vec<Observation> = sphere().1.iter().step_by(40).map(|d| observation(d, 0.001)).collect();
        let (points, normals) = sphere();
        let places: Vec<Place> = points.iter().zip(&normals).map(|(p, n)| Place::new(p, n)).collect();
        for symmetry in [Symmetry::None, Symmetry::Revolution(2), Symmetry::Mirror([true, false, true])] {
            let process = Displacement::fit(prior(symmetry), &seen);
            let (_, deviations) = process.predict(&points, &normals);
            let covariance = process.covariance(&places[..30], &places);
            for row in 0..30 {
                assert!((covariance[(row, row)] - deviations[row].powi(2)).abs() < 1e-12);
                assert!((covariance[(row, 7)] - covariance[(7, row)]).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn what_others_foresee_is_what_a_fit_without_a_measurement_says() {
        let mut seen: Vec<Observation> =
            sphere().1.iter().step_by(60).map(|d| observation(d, 0.003 * d.x)).collect();
        let process = Displacement::fit(prior(Symmetry::None), &seen);
        let off_m = process.left_out_m()[3];
        let left_out = seen.remove(3);
        let foreseen_m = Displacement::fit(prior(Symmetry::None), &seen).mean_m(&left_out.place);
        assert!((off_m - (left_out.displacement_m - foreseen_m)).abs() < 1e-9);
    }

    #[test]
    fn a_refit_is_a_fit() {
        let seen: Vec<Observation> =
            sphere().1.iter().step_by(60).map(|d| observation(d, 0.003 * d.x)).collect();
        let noisier: Vec<Observation> = seen.iter().map(|o| Observation { noise_m: 0.001, ..*o }).collect();
        let larger = Prior { amplitude_m: 0.02, ..prior(Symmetry::Revolution(0)) };
        let fresh = Displacement::fit(larger, &noisier);
        let again = Displacement::fit(prior(Symmetry::Revolution(0)), &seen).refit(0.02, &noisier);
        assert_eq!((fresh.evidence(), &fresh.weights), (again.evidence(), &again.weights));
    }

    #[test]
    fn more_measurements_never_widen_the_uncertainty() {
        let (points, normals) = sphere();
        let mut seen = Vec::new();
        let mut before = vec![f64::INFINITY; points.len()];
        for direction in normals.iter().step_by(30) {
            seen.push(observation(direction, 0.001));
            let (_, after) = Displacement::fit(prior(Symmetry::None), &seen).predict(&points, &normals);
            assert!(before.iter().zip(&after).all(|(before, after)| *after <= before + 1e-9));
            before = after;
        }
    }

    #[test]
    fn evidence_finds_the_symmetry_that_the_measurements_have() {
        // Bumps that depend on the height alone.
        let seen: Vec<Observation> =
            sphere().1.iter().step_by(9).map(|d| observation(d, 0.004 * (4.0 * d.z).sin())).collect();
        let evidence = |symmetry| Displacement::fit(prior(symmetry), &seen).evidence();
        let revolution = evidence(Symmetry::Revolution(2));
        assert!(revolution > evidence(Symmetry::None) + 5.0);
        assert!(revolution > evidence(Symmetry::Revolution(0)) + 5.0);
    }
}
