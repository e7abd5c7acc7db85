//! What something takes, as measured: a mean that follows, and how far single ones are from it.

use std::time::Duration;

/// How much of a new measurement goes into the mean, and into the deviation: those of RFC 6298, by which TCP knows
/// how long to wait for an answer.
pub(super) const INTO_MEAN: f64 = 1.0 / 8.0;
const INTO_DEVIATION: f64 = 1.0 / 4.0;

/// Deviations above the mean that few stay above.
const CAUTION: f64 = 2.0;

/// A duration that is measured again and again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measured {
    mean_s: f64,
    deviation_s: f64,
    is_guess: bool,
}

impl Measured {
    /// What is taken to be so until it was measured once.
    pub(crate) const fn guessed(mean: Duration) -> Self {
        Self { mean_s: mean.as_secs_f64(), deviation_s: 0.0, is_guess: true }
    }

    pub(crate) fn add(&mut self, took: Duration) {
        let took_s = took.as_secs_f64();
        if self.is_guess {
            *self = Self { mean_s: took_s, deviation_s: took_s / 2.0, is_guess: false };
            return;
        }
        self.deviation_s += INTO_DEVIATION * ((took_s - self.mean_s).abs() - self.deviation_s);
        self.mean_s += INTO_MEAN * (took_s - self.mean_s);
    }

    /// What one takes on average, in seconds.
    pub(crate) fn mean_s(&self) -> f64 {
        self.mean_s
    }

    /// What hardly one takes longer than, in seconds.
    pub(crate) fn cautious_s(&self) -> f64 {
        self.mean_s + CAUTION * self.deviation_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_forgets_its_guess_and_follows_what_is_measured() {
        let ms = Duration::from_millis;
        let mut cost = Measured::guessed(ms(500));
        assert_eq!((cost.mean_s(), cost.cautious_s()), (0.5, 0.5));
        cost.add(ms(10));
        assert_eq!(cost.mean_s(), 0.01);
        (0..40).for_each(|_| cost.add(ms(10)));
        assert!(cost.cautious_s() < 0.0101, "nothing is uncertain about what is always the same: {cost:?}");
        cost.add(ms(90));
        assert!((cost.mean_s() - 0.02).abs() < 1e-9 && cost.cautious_s() > 0.05, "{cost:?}");
        (0..60).for_each(|_| cost.add(ms(90)));
        assert!((cost.mean_s() - 0.09).abs() < 1e-4, "{cost:?}");
    }
}
