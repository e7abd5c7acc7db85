//! Randomness that is part of the configuration: one seed, one independent stream for each use.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What a stream of random numbers is for.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Use {
    /// Ties between equally uncertain vertices.
    Ties,
    /// The order of directions of the uniform strategy.
    Directions,
    /// The picks of the random strategy.
    Picks,
}

/// The generator for one use at one attempt; the same arguments always give the same numbers.
pub(crate) fn generator(seed: u64, purpose: Use, attempt: u32) -> ChaCha8Rng {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(u64::from(attempt) << 8 | purpose as u64);
    generator
}
