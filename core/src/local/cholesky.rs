//! The Cholesky factor of a positive definite matrix in the place of the matrix: at the size of these systems a copy
//! costs almost as much as the factor.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Mat, MatMut, Par, Spec};

/// Where a matrix is no longer positive definite once it is rounded, this share of its largest variance is added, then ten
/// times as much, so many times.
const FIRST_ADDED: f64 = 1e-9;
const ADDITIONS: usize = 14;

/// `L` of `L Lᵀ`. Only what lies on the diagonal and below is read, and what lies above becomes zero. Nothing where the
/// matrix is not positive definite.
pub(super) fn factor(mut system: Mat<f64>) -> Option<Mat<f64>> {
    let count = system.nrows();
    let scratch = cholesky_in_place_scratch::<f64>(count, Par::Seq, Spec::default());
    let mut buffer = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut buffer);
    let regularization = LltRegularization::default();
    cholesky_in_place(system.as_mut(), regularization, Par::Seq, stack, Spec::default()).ok()?;
    (1..count).for_each(|column| system.col_as_slice_mut(column)[..column].fill(0.0));
    Some(system)
}

/// The Cholesky factor of a kernel matrix with noise. It is positive definite but for rounding, against which more
/// and more is added to its diagonal; nothing where its entries are no numbers.
pub(super) fn factor_mended(system: impl Fn() -> Mat<f64>) -> Option<Mat<f64>> {
    if let Some(factor) = factor(system()) {
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
        if let Some(factor) = factor(raised) {
            return Some(factor);
        }
        more *= 10.0;
    }
    None
}

/// The solution of `L Lᵀ x = b`, in the place of `b`.
pub(super) fn solve(factor: &Mat<f64>, mut right: MatMut<'_, f64>) {
    solve_lower_triangular_in_place(factor.as_ref(), right.as_mut(), Par::Seq);
    solve_upper_triangular_in_place(factor.transpose(), right, Par::Seq);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_product_of_the_factor_with_itself_is_the_matrix() {
        for count in [1, 7, 60, 200] {
            let number = |row: usize, column: usize| ((row * 31 + column * 17) % 23) as f64 / 23.0;
            let numbers = Mat::from_fn(count, count, number);
            let mut system = &numbers * numbers.transpose();
            (0..count).for_each(|at| system[(at, at)] += 1.0);
            let mut half = system.clone();
            (0..count).for_each(|column| half.col_as_slice_mut(column)[..column].fill(f64::NAN));
            let found = factor(half).unwrap();
            assert!((&found * found.transpose() - &system).norm_max() < 1e-9);
            let mut solution = Mat::from_fn(count, 1, |row, _| row as f64);
            solve(&found, solution.as_mut());
            let right = &system * &solution;
            assert!((0..count).all(|row| (right[(row, 0)] - row as f64).abs() < 1e-7));
        }
        assert!(factor(Mat::from_fn(2, 2, |_, _| f64::NAN)).is_none());
        assert!(factor(Mat::from_fn(2, 2, |row, column| if row == column { 1.0 } else { 2.0 })).is_none());
    }

    #[test]
    fn a_matrix_that_rounding_has_spoilt_is_mended_by_its_diagonal() {
        // Its eigenvalues are 2 and -1e-7.
        let spoilt = Mat::from_fn(2, 2, |row, column| if row == column { 1.0 } else { 1.0 + 1e-7 });
        assert!(factor(spoilt.clone()).is_none() && factor_mended(|| spoilt.clone()).is_some());
        assert!(factor_mended(|| Mat::from_fn(2, 2, |_, _| f64::NAN)).is_none());
    }
}
