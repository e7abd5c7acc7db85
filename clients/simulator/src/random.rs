//! Random numbers in separate streams, so that one more draw here changes nothing there.

use palpate_core::geometry::{Direction, Vector};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What the numbers are for. A new one goes to the end: a stream's place is its number.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stream {
    View,
    Patch,
    DepthNoise,
    Offset,
    TactileNoise,
    NormalNoise,
    Shape,
    WrenchNoise,
    FalseContact,
    Motion,
    HandEye,
    Pixels,
    Table,
    FlyingPixels,
    HandEyeTurn,
}

/// The generator of one stream of a seed.
pub(crate) fn generator(seed: u64, stream: Stream) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream as u64);
    rng
}

/// A number from the standard normal distribution (Box and Muller).
pub(crate) fn standard_normal(rng: &mut impl Rng) -> f64 {
    // One minus a number in [0, 1) is never zero, which the logarithm could not bear.
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}

/// A direction, uniform over the sphere.
pub(crate) fn any_direction(rng: &mut impl Rng) -> Direction {
    Direction::new_normalize(Vector::from_fn(|_, _| standard_normal(rng)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let mut rng = generator(1, Stream::View);
        let numbers: Vec<f64> = (0..50_000).map(|_| standard_normal(&mut rng)).collect();
        let mean = numbers.iter().sum::<f64>() / 50_000.0;
        let variance = numbers.iter().map(|x| x * x).sum::<f64>() / 50_000.0;
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03, "{mean} {variance}");
    }

    #[test]
    fn streams_of_one_seed_differ() {
        let first = |stream| generator(7, stream).random::<u64>();
        assert_ne!(first(Stream::View), first(Stream::Patch));
        assert_eq!(first(Stream::View), first(Stream::View));
    }
}
