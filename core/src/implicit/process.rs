//! A Gaussian process over space with the thin-plate covariance (Williams and Fitzgibbon 2007).
//!
//! Within a support `R`, at least the longest distance between two points: `k(r) = 2 r^3 - 3 R r^2 + R^3`,
//! here divided by `R^3` so that the variance before any measurement is 1.

use faer::linalg::solvers::Solve;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Col, Mat, Par, Side};

use crate::geometry::{Point, Vector};

/// Added to the variance of every measurement, tenfold until the system can be factorised.
const JITTER: f64 = 1e-9;
/// So many times at most: correlations are at most 1, so that by then the diagonal prevails.
const JITTERS: usize = 15;

/// A value of the field that is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    /// Where, in metres.
    pub(super) point: Point,
    /// The value, without unit.
    pub(super) value: f64,
    /// Its standard deviation.
    pub(super) deviation: f64,
}

/// The field given all that is known.
#[derive(Clone, Debug)]
pub(super) struct Process {
    support_m: f64,
    points: Vec<Point>,
    weights: Vec<f64>,
    factor: Mat<f64>,
}

impl Process {
    /// Conditions the process; all points lie within `support_m` of each other.
    pub(super) fn fit(known: &[Known], support_m: f64) -> Self {
        let covariance = |row: usize, column: usize| {
            let variance = if row == column { known[row].deviation.powi(2) } else { 0.0 };
            kernel((known[row].point - known[column].point).norm() / support_m) + variance
        };
        let count = known.len();
        let system = |jitter: f64| {
            Mat::from_fn(count, count, |row, column| {
                covariance(row, column) + if row == column { jitter } else { 0.0 }
            })
        };
        let jitters = std::iter::successors(Some(JITTER), |jitter| Some(jitter * 10.0)).take(JITTERS);
        let points = known.iter().map(|known| known.point).collect();
        let Some(factor) = jitters.map(|jitter| system(jitter).llt(Side::Lower)).find_map(Result::ok) else {
            // Numbers that cannot be computed with say nothing.
            return Self {
                support_m,
                points,
                weights: vec![0.0; count],
                factor: Mat::identity(count, count),
            };
        };
        let solution = factor.solve(Col::from_fn(count, |row| known[row].value));
        let weights = (0..count).map(|row| solution[row]).collect();
        Self { support_m, points, weights, factor: factor.L().to_owned() }
    }

    /// The expected value of the field.
    pub(super) fn value(&self, point: &Point) -> f64 {
        let terms = self.points.iter().zip(&self.weights);
        terms.map(|(at, weight)| weight * kernel((point - at).norm() / self.support_m)).sum()
    }

    /// The expected value of the field and its gradient, in 1/m.
    pub(super) fn at(&self, point: &Point) -> (f64, Vector) {
        let (mut value, mut gradient) = (0.0, Vector::zeros());
        for (at, weight) in self.points.iter().zip(&self.weights) {
            let offset = point - at;
            let r = offset.norm() / self.support_m;
            value += weight * kernel(r);
            if r < 1.0 {
                gradient += offset * (weight * 6.0 * (r - 1.0) / self.support_m.powi(2));
            }
        }
        (value, gradient)
    }

    /// Standard deviations of the field at some points, at most 1.
    pub(super) fn deviations(&self, points: &[Point]) -> Vec<f64> {
        let mut solved = Mat::from_fn(self.points.len(), points.len(), |row, column| {
            kernel((self.points[row] - points[column]).norm() / self.support_m)
        });
        solve_lower_triangular_in_place(self.factor.as_ref(), solved.as_mut(), Par::Seq);
        (0..points.len()).map(|column| (1.0 - solved.col(column).squared_norm_l2()).max(0.0).sqrt()).collect()
    }
}

/// The covariance at a distance in supports; nothing beyond one.
fn kernel(r: f64) -> f64 {
    if r < 1.0 { 1.0 + r * r * (2.0 * r - 3.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(x: f64, value: f64) -> Known {
        Known { point: Point::new(x, 0.02 * x, -x), value, deviation: 1e-4 }
    }

    #[test]
    fn it_meets_what_is_known_and_is_sure_there() {
        let all = [known(0.0, -1.0), known(0.05, 0.0), known(0.1, 1.0)];
        let process = Process::fit(&all, 0.4);
        for Known { point, value, .. } in all {
            assert!((process.value(&point) - value).abs() < 1e-3);
            assert!(process.deviations(&[point])[0] < 1e-3);
        }
        assert!(process.deviations(&[Point::new(0.0, 0.2, 0.0)])[0] > 0.1);
    }

    #[test]
    fn the_gradient_is_that_of_the_value() {
        let process = Process::fit(&[known(0.0, -1.0), known(0.05, 0.0), known(0.1, 1.0)], 0.4);
        let at = Point::new(0.03, 0.04, -0.02);
        let (value, gradient) = process.at(&at);
        assert_eq!(value, process.value(&at));
        for axis in 0..3 {
            let step = Vector::from_fn(|row, _| if row == axis { 1e-6 } else { 0.0 });
            let slope = (process.value(&(at + step)) - process.value(&(at - step))) / 2e-6;
            assert!((gradient[axis] - slope).abs() < 1e-5 * gradient.norm(), "{axis}");
        }
    }

    #[test]
    fn what_is_no_number_says_nothing_and_comes_to_an_end() {
        let unknown = Known { deviation: f64::NAN, ..known(0.0, 0.0) };
        let process = Process::fit(&[unknown, known(0.1, 1.0)], 0.4);
        assert_eq!(process.value(&Point::origin()).abs(), 0.0);
    }

    #[test]
    fn the_same_point_twice_can_be_known() {
        let process = Process::fit(&[known(0.0, 0.0), known(0.0, 0.0), known(0.1, 1.0)], 0.4);
        assert!(process.value(&Point::origin()).abs() < 1e-3);
    }
}
