//! Levenberg-Marquardt for a handful of parameters on a manifold.
//!
//! The damping is a multiple of the identity, not of the diagonal: a rotation of the data then
//! rotates every step with it.

use nalgebra::{SMatrix, SVector};

use crate::vectorised::widest;

/// The normal equations of a least-squares cost `0.5 * |r|²` at one set of parameters.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations<const N: usize> {
    /// `0.5 * |r|²`.
    pub cost: f64,
    /// `Jᵀ r`.
    pub gradient: SVector<f64, N>,
    /// `Jᵀ J`.
    pub hessian: SMatrix<f64, N, N>,
}

impl<const N: usize> NormalEquations<N> {
    /// No residual yet.
    pub(crate) fn zero() -> Self {
        Self { cost: 0.0, gradient: SVector::zeros(), hessian: SMatrix::zeros() }
    }

    /// Adds one residual and its row of the Jacobian.
    pub(crate) fn add(&mut self, residual: f64, row: &SVector<f64, N>) {
        self.cost += 0.5 * residual * residual;
        self.gradient.axpy(residual, row, 1.0);
        self.hessian.ger(1.0, row, row, 1.0);
    }

    /// The same where only steps within a subspace are allowed, given by its projection.
    pub(crate) fn within(self, subspace: &SMatrix<f64, N, N>) -> Self {
        Self {
            cost: self.cost,
            gradient: subspace * self.gradient,
            hessian: subspace * self.hessian * subspace,
        }
    }

    /// Adds the slopes of many residuals: `Jᵀ W r` and `Jᵀ W J`, but not their cost.
    pub(crate) fn add_slopes(&mut self, slopes: &Slopes<N>) {
        let sum = |[a, b, c, d]: [f64; LANES]| (a + b) + (c + d);
        for first in 0..N {
            self.gradient[first] += sum(slopes.gradient[first]);
            for second in first..N {
                let product = sum(slopes.hessian[first][second]);
                self.hessian[(second, first)] += product;
                if second > first {
                    self.hessian[(first, second)] += product;
                }
            }
        }
    }
}

/// Sums that are made side by side.
const LANES: usize = 4;

/// `Jᵀ W r` and `Jᵀ W J` of many residuals, each number still in as many sums as are made side by side: they are
/// added to each other once for all residuals, not for each block of them.
#[derive(Clone, Debug)]
pub(crate) struct Slopes<const N: usize> {
    gradient: [[f64; LANES]; N],
    /// On the diagonal and right of it.
    hessian: [[[f64; LANES]; N]; N],
}

impl<const N: usize> Slopes<N> {
    /// No residual yet.
    pub(crate) fn zero() -> Self {
        Self { gradient: [[0.0; LANES]; N], hessian: [[[0.0; LANES]; N]; N] }
    }

    /// Adds a block of residuals with their rows of the Jacobian, each with its factor.
    pub(crate) fn add<const L: usize>(
        &mut self,
        residuals: &[f64; L],
        rows: &[[f64; L]; N],
        factors: &[f64; L],
    ) {
        widest(
            #[inline(always)]
            || {
                for (first, row) in rows.iter().enumerate() {
                    let mut weighted = [0.0; L];
                    for lane in 0..L {
                        weighted[lane] = row[lane] * factors[lane];
                    }
                    add_products(&mut self.gradient[first], &weighted, residuals);
                    for (sums, other) in self.hessian[first].iter_mut().zip(rows).skip(first) {
                        add_products(sums, &weighted, other);
                    }
                }
            },
        );
    }
}

/// Adds products, as many at a time as there are sums.
#[inline(always)]
fn add_products<const L: usize>(sums: &mut [f64; LANES], a: &[f64; L], b: &[f64; L]) {
    let mut added = *sums;
    for from in (0..L).step_by(LANES) {
        for lane in 0..LANES {
            added[lane] = a[from + lane].mul_add(b[from + lane], added[lane]);
        }
    }
    *sums = added;
}

/// Huber's loss of a residual: half its square up to `threshold`, linear beyond.
pub(crate) fn huber(residual: f64, threshold: f64) -> f64 {
    let size = residual.abs();
    if size <= threshold { 0.5 * size * size } else { threshold * (size - 0.5 * threshold) }
}

/// How a minimisation went.
#[derive(Clone, Debug)]
pub(crate) struct Minimum<T> {
    /// The parameters found.
    pub parameters: T,
    /// `0.5 * |r|²` there.
    pub cost: f64,
}

const RELATIVE_DECREASE: f64 = 1e-9;
const DAMPING: f64 = 1e-3;

/// Minimises a sum of squares from `start` in at most `max_iterations` steps.
///
/// `linearise` gives the normal equations at a set of parameters, `retract` applies a step to it.
pub(crate) fn minimise<T: Clone, const N: usize>(
    start: T,
    max_iterations: usize,
    linearise: impl Fn(&T) -> NormalEquations<N>,
    retract: impl Fn(&T, &SVector<f64, N>) -> T,
) -> Minimum<T> {
    let mut parameters = start;
    let mut here = linearise(&parameters);
    let mut damping = DAMPING;
    for _ in 0..max_iterations {
        let damped = here.hessian + SMatrix::identity() * damping;
        let Some(step) = damped.cholesky().map(|factor| -factor.solve(&here.gradient)) else {
            damping *= 4.0;
            continue;
        };
        let trial = retract(&parameters, &step);
        let there = linearise(&trial);
        if there.cost < here.cost {
            let decrease = (here.cost - there.cost) / here.cost;
            parameters = trial;
            here = there;
            damping = (damping * 0.3).max(1e-12);
            if decrease < RELATIVE_DECREASE {
                break;
            }
        } else {
            // Not lower, or not a number: a shorter step, unless there was nothing to gain.
            if -here.gradient.dot(&step) <= RELATIVE_DECREASE * here.cost {
                break;
            }
            damping *= 4.0;
        }
    }
    Minimum { parameters, cost: here.cost }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rosenbrock_valley_is_followed_to_its_end() {
        let minimum = minimise(
            SVector::<f64, 2>::new(-1.2, 1.0),
            200,
            |p| {
                let mut equations = NormalEquations::zero();
                equations.add(10.0 * (p[1] - p[0] * p[0]), &SVector::<f64, 2>::new(-20.0 * p[0], 10.0));
                equations.add(1.0 - p[0], &SVector::<f64, 2>::new(-1.0, 0.0));
                equations
            },
            |p, step| p + step,
        );
        assert!((minimum.parameters - SVector::<f64, 2>::new(1.0, 1.0)).norm() < 1e-6);
    }

    #[test]
    fn slopes_that_are_summed_side_by_side_are_those_of_residual_after_residual() {
        let number = |seed: usize| f64::from(((seed * 7919) % 101) as u8) / 50.0 - 1.0;
        let mut slopes = Slopes::<3>::zero();
        let mut expected = NormalEquations::<3>::zero();
        for block in 0..5 {
            let residuals: [f64; 8] = std::array::from_fn(|lane| number(8 * block + lane));
            let rows: [[f64; 8]; 3] = std::array::from_fn(|row| {
                std::array::from_fn(|lane| number(1000 + 100 * row + 8 * block + lane))
            });
            let factors: [f64; 8] = std::array::from_fn(|lane| number(5000 + 8 * block + lane).powi(2));
            slopes.add(&residuals, &rows, &factors);
            for lane in 0..8 {
                let weight = factors[lane].sqrt();
                let row = SVector::<f64, 3>::from_fn(|row, _| weight * rows[row][lane]);
                expected.add(weight * residuals[lane], &row);
            }
        }
        let mut equations = NormalEquations::zero();
        equations.add_slopes(&slopes);
        assert!((equations.gradient - expected.gradient).norm() < 1e-12);
        assert!((equations.hessian - expected.hessian).norm() < 1e-12);
    }
}
