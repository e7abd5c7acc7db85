//! The affine functions of space, as far as some centres tell them apart: what a thin plate follows without bending.

use faer::Mat;

use crate::geometry::Vector;

/// A function that lies this near to the others at the centres, root mean square, cannot be told from them: where
/// the centres lie in a plane nothing is known of the slope across it.
const LEAST: f64 = 1e-6;

/// An orthonormal basis of the affine functions at some centres.
#[derive(Debug)]
pub(super) struct Affine {
    /// The value of each function of the basis (column) at each centre (row).
    pub(super) basis: Mat<f64>,
    /// For each of them its coefficients of `1, x, y, z`.
    coefficients: Vec<[f64; 4]>,
}

impl Affine {
    /// The basis at some centres: `1, x, y, z` in turn, made orthogonal to those before.
    pub(super) fn at(centres: &[Vector]) -> Self {
        let mut functions: Vec<(Vec<f64>, [f64; 4])> = Vec::new();
        for power in 0..4 {
            let mut values: Vec<f64> =
                centres.iter().map(|centre| if power == 0 { 1.0 } else { centre[power - 1] }).collect();
            let mut coefficients = [0.0; 4];
            coefficients[power] = 1.0;
            // What rounding leaves of the others after one turn is gone after two.
            for _ in 0..2 {
                for (others, of_other) in &functions {
                    let along: f64 = values.iter().zip(others).map(|(value, other)| value * other).sum();
                    values.iter_mut().zip(others).for_each(|(value, other)| *value -= along * other);
                    coefficients.iter_mut().zip(of_other).for_each(|(value, other)| *value -= along * other);
                }
            }
            let norm = values.iter().map(|value| value * value).sum::<f64>().sqrt();
            if norm > LEAST * (centres.len() as f64).sqrt() {
                values.iter_mut().chain(&mut coefficients).for_each(|value| *value /= norm);
                functions.push((values, coefficients));
            }
        }
        let basis = Mat::from_fn(centres.len(), functions.len(), |row, column| functions[column].0[row]);
        Self { basis, coefficients: functions.into_iter().map(|(_, coefficients)| coefficients).collect() }
    }

    /// The coefficients of `1, x, y, z` of a sum of the functions of the basis.
    pub(super) fn coefficients(&self, shares: impl Iterator<Item = f64>) -> [f64; 4] {
        let mut sum = [0.0; 4];
        for (share, coefficients) in shares.zip(&self.coefficients) {
            sum.iter_mut().zip(coefficients).for_each(|(sum, value)| *sum += share * value);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn centres(height: f64) -> Vec<Vector> {
        (0..40)
            .map(f64::from)
            .map(|k| Vector::new(k.sin(), (1.7 * k).cos(), height * (2.3 * k).sin()))
            .collect()
    }

    #[test]
    fn the_basis_is_orthonormal_and_its_coefficients_give_its_values() {
        let centres = centres(0.01);
        let affine = Affine::at(&centres);
        let products = affine.basis.transpose() * &affine.basis;
        assert!((products - Mat::<f64>::identity(4, 4)).norm_l2() < 1e-14);
        for column in 0..4 {
            let [a, b, c, d] = affine.coefficients((0..4).map(|other| f64::from(u8::from(other == column))));
            for (row, centre) in centres.iter().enumerate() {
                let value = a + b * centre.x + c * centre.y + d * centre.z;
                assert!((value - affine.basis[(row, column)]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn slopes_that_the_centres_do_not_tell_are_left_out() {
        assert_eq!(Affine::at(&centres(0.0)).basis.ncols(), 3);
        assert_eq!(Affine::at(&centres(0.0)[..2]).basis.ncols(), 2);
        assert_eq!(Affine::at(&[Vector::zeros(); 5]).basis.ncols(), 1);
    }
}
