//! Adam, a gradient descent whose steps do not depend on how steep the loss is (Kingma and Ba, 2015).

use nalgebra::SVector;

/// How slowly the means of the gradient and of its square change.
const DECAY: (f64, f64) = (0.9, 0.999);
/// Keeps a step finite where the gradient vanishes.
const LEAST: f64 = 1e-8;

/// The state of a descent over `N` parameters.
#[derive(Clone, Debug)]
pub(super) struct Adam<const N: usize> {
    rate: f64,
    mean: SVector<f64, N>,
    mean_square: SVector<f64, N>,
    steps: i32,
}

impl<const N: usize> Adam<N> {
    /// A descent whose steps are about `rate` in each parameter.
    pub(super) fn new(rate: f64) -> Self {
        Self { rate, mean: SVector::zeros(), mean_square: SVector::zeros(), steps: 0 }
    }

    /// What is added to the parameters where the loss has this gradient.
    pub(super) fn step(&mut self, gradient: &SVector<f64, N>) -> SVector<f64, N> {
        self.steps += 1;
        self.mean = self.mean * DECAY.0 + gradient * (1.0 - DECAY.0);
        self.mean_square = self.mean_square * DECAY.1 + gradient.component_mul(gradient) * (1.0 - DECAY.1);
        // Both means started at zero, which their sums of weights make up for.
        let mean = self.mean / (1.0 - DECAY.0.powi(self.steps));
        let mean_square = self.mean_square / (1.0 - DECAY.1.powi(self.steps));
        mean.zip_map(&mean_square, |mean, square| -self.rate * mean / (square.sqrt() + LEAST))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_step_is_the_rate_however_steep_the_loss() {
        for steep in [1e-3, 1.0, 1e3] {
            let step = Adam::new(0.01).step(&SVector::from([steep, -steep]));
            assert!((step - SVector::from([-0.01, 0.01])).norm() < 1e-6);
        }
    }

    #[test]
    fn it_goes_down_to_the_minimum_of_a_narrow_valley() {
        let mut at = SVector::from([3.0, -2.0]);
        let mut adam = Adam::new(0.01);
        for _ in 0..3000 {
            at += adam.step(&SVector::from([2.0 * at[0], 200.0 * at[1]]));
        }
        assert!(at.norm() < 1e-3, "{at}");
    }
}
