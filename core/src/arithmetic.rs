//! Which arithmetic this process computes with.
//!
//! Sums of the same numbers differ in their last bits with the width of a processor's vectors, and functions such as
//! the exponential with the C library. On one machine every result is the same each time; on another it may not be. A
//! tag made of some results tells whether two machines compute alike.

use std::sync::LazyLock;

use faer::Side;
use faer::linalg::solvers::{Llt, Solve};
use faer::{Col, Mat};

use crate::fingerprint::Fingerprint;

/// Sizes of the systems that are solved: below and above what is solved block by block.
const SIZES: [usize; 3] = [7, 48, 400];
/// Length of the sums of a product: longer than what is summed in one go.
const LONG: usize = 4096;

/// A tag of the arithmetic, as eight hexadecimal digits.
pub(crate) static TAG: LazyLock<String> =
    LazyLock::new(|| results()[..4].iter().map(|byte| format!("{byte:02x}")).collect());

fn results() -> [u8; 32] {
    let mut fingerprint = Fingerprint::default();
    for size in SIZES {
        let numbers =
            |seed: usize| Mat::from_fn(size, size, |row, column| number(seed + size * row + column));
        let (a, b) = (numbers(1), numbers(2));
        let mut system = &a * a.transpose();
        (0..size).for_each(|at| system[(at, at)] += 1.0);
        let right = Col::from_fn(size, |row| b[(row, 0)]);
        if let Ok(factor) = Llt::new(system.as_ref(), Side::Lower) {
            fingerprint.numbers(&factor.solve(&right).iter().copied().collect::<Vec<f64>>());
        }
    }
    let wide = Mat::from_fn(16, LONG, |row, column| number(LONG * row + column) as f32);
    let product = &wide * wide.transpose();
    fingerprint.numbers(
        &product.col_iter().flat_map(|sums| sums.iter().map(|sum| f64::from(*sum))).collect::<Vec<f64>>(),
    );
    for at in 0..200 {
        let x = 3.0 * number(at);
        let functions =
            [x.exp(), x.abs().ln(), x.sin(), x.cos(), x.tan(), x.atan2(0.7), x.abs().powf(0.37), x.cbrt()];
        fingerprint.numbers(&functions);
    }
    fingerprint.finish()
}

/// Numbers in (-1, 1) that are the same everywhere.
fn number(at: usize) -> f64 {
    let mixed = (at as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_machine_computes_alike_each_time() {
        let first = results();
        let others: Vec<_> = (0..4).map(|_| std::thread::spawn(results)).collect();
        assert!(others.into_iter().all(|other| other.join().unwrap() == first));
        assert_eq!(TAG.len(), 8);
    }
}
