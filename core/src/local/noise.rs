//! How noisy the sensors are, by what the measurements say about each other.
//!
//! Nobody has to know the noise of a camera at this distance, or of this pad. Of a few guesses the
//! one is kept under which the measurements are the most likely: too small a noise makes a rough
//! patch a surprise, too large a noise makes a smooth one.

use serde::{Deserialize, Serialize};

use crate::evidence::attractor::Sense;
use crate::fingerprint::Fingerprint;

/// Noise of a visual point, an average of its neighbours, and of a touch, in metres.
const VISION_M: f64 = 0.001;
const TOUCH_M: f64 = 0.0005;
/// How the noise of a touch grows with its uncertainty.
const BY_UNCERTAINTY: f64 = 2.5;
/// Noise of a point on the plane of a measured normal: five degrees, and the curvature.
const TANGENT_M: f64 = 0.001;
/// A guess is the one before times or over this.
const STEP: f64 = 2.0;
/// Neither sensor is better or worse than expected by more than these factors.
const FACTORS: (f64, f64) = (0.5, 8.0);
/// What an octave away from the expected noise costs, in nats; it grows with the square.
const OCTAVE_COST: f64 = 3.0;

/// Noise of camera and pad, as factors of what is expected of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Noise {
    vision: f64,
    touch: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self { vision: 1.0, touch: 1.0 }
    }
}

impl Noise {
    /// Standard deviation of a measured point of the surface along the normal, in metres.
    pub(crate) fn of_m(&self, sense: Sense, uncertainty: f64) -> f64 {
        match sense {
            Sense::Vision => VISION_M * self.vision,
            Sense::Touch => TOUCH_M * self.touch * (1.0 + BY_UNCERTAINTY * uncertainty),
            Sense::Tangent | Sense::Support => TANGENT_M * self.touch,
        }
    }

    /// The best of this guess and its neighbours, given the logarithm of the likelihood of the
    /// measurements.
    pub(crate) fn improved(self, evidence: impl Fn(&Self) -> f64) -> Self {
        let judge = |noise: Self| (evidence(&noise) - noise.cost(), noise);
        let better = |best: (f64, Self), guess: (f64, Self)| if guess.0 > best.0 { guess } else { best };
        self.neighbours().map(judge).fold(judge(self), better).1
    }

    /// Adds itself to a fingerprint.
    pub(super) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self { vision, touch } = *self;
        fingerprint.numbers(&[vision, touch]);
    }

    fn neighbours(self) -> impl Iterator<Item = Self> {
        let near = |factor: f64| [factor / STEP, factor * STEP].map(|f| f.clamp(FACTORS.0, FACTORS.1));
        let vision = near(self.vision).map(|vision| Self { vision, ..self });
        let touch = near(self.touch).map(|touch| Self { touch, ..self });
        vision.into_iter().chain(touch).filter(move |guess| *guess != self)
    }

    /// What it costs not to be what is expected, in nats.
    pub(super) fn cost(&self) -> f64 {
        OCTAVE_COST * (self.vision.log2().powi(2) + self.touch.log2().powi(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_under_which_measurements_are_likely_is_found() {
        // A hundred visual points that scatter by 4 mm.
        let evidence = |noise: &Noise| {
            let sigma = noise.of_m(Sense::Vision, 0.0);
            -100.0 * (sigma.ln() + 0.5 * (0.004 / sigma).powi(2))
        };
        let found = Noise::default().improved(evidence).improved(evidence);
        assert_eq!(found, Noise { vision: 4.0, touch: 1.0 });
        assert_eq!(found.improved(evidence), found);
    }

    #[test]
    fn without_evidence_the_expected_noise_stays() {
        assert_eq!(Noise::default().improved(|_| 0.0), Noise::default());
    }

    #[test]
    fn an_uncertain_touch_is_noisier() {
        let noise = Noise::default();
        assert!(noise.of_m(Sense::Touch, 0.2) > noise.of_m(Sense::Touch, 0.0));
    }
}
