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

    /// Adds the slopes of some residuals, each with its factor: `Jᵀ W r` and `Jᵀ W J`, but not their cost.
    pub(crate) fn add_weighted<const L: usize>(
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
                    self.gradient[first] += product(&weighted, residuals);
                    for (second, other) in rows.iter().enumerate().skip(first) {
                        let sum = product(&weighted, other);
                        self.hessian[(second, first)] += sum;
                        if second > first {
                            self.hessian[(first, second)] += sum;
                        }
                    }
                }
            },
        );
    }
}

/// The sum of products, four at a time.
#[inline(always)]
fn product<const L: usize>(a: &[f64; L], b: &[f64; L]) -> f64 {
    let mut sums = [0.0; 4];
    for four in 0..L / 4 {
        for lane in 0..4 {
            sums[lane] += a[4 * four + lane] * b[4 * four + lane];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
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
}
