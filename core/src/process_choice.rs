//! What the measurements say about the process that explains them: how large displacements are, how
//! noisy the senses, and which symmetry the object has.
//!
//! Each is chosen by the marginal likelihood of the measurements. Noise and symmetry are asked for
//! in their turns only and kept in between: they do not change with every touch.

use nalgebra::Rotation3;

use crate::attractor::{Attractor, Sense};
use crate::config::{Stages, Symmetry as Declared};
use crate::displacement::{Displacement, Observation, Prior};
use crate::noise::Noise;
use crate::symmetry::{Fold, Symmetry};
use crate::template::Compound;
use crate::turn::Turn;

/// Displacements are expected to be this large, in metres, as if seen so many times.
const EXPECTED_M: f64 = 0.008;
const EXPECTED_COUNT: f64 = 4.0;
/// As if seen so many times where processes are compared: each may have the size that it asks for,
/// or one that makes displacements smaller would win for that alone.
const COMPARED_COUNT: f64 = 0.5;
/// However far off a touch may be, displacements are not expected to be larger, in metres: the
/// system stays regular.
const LARGEST_M: f64 = 0.1;
/// The evidence for a symmetry has to be this much better, in nats: 20 to 1, where one of ten may
/// come out best by chance.
const CLEARLY_BETTER: f64 = 5.3;
/// So many touches are needed before noise is asked for, and before symmetry is.
const TOUCHES_FOR_NOISE: usize = 5;
const TOUCHES_FOR_SYMMETRY: usize = 8;
/// A template has a symmetry if what the symmetry brings together lies this close on average, in
/// sizes of its body.
const ASYMMETRY: f64 = 0.03;
/// A symmetry whose axes have turned by more than this is another one, in radians.
const TURNED: f64 = 0.2;

/// What was chosen, from which the next choice goes on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// Of the senses.
    pub(crate) noise: Noise,
    /// Of the object.
    pub(crate) symmetry: Symmetry,
    /// The directions of the template's axes, which the symmetry is about.
    axes: Rotation3<f64>,
}

/// What the choice is made for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Question<'a> {
    /// The measured attractors.
    pub(crate) attractors: &'a [Attractor],
    /// Over what length displacements are alike, in metres.
    pub(crate) length_m: f64,
    /// The template.
    pub(crate) shape: &'a Compound,
    /// How many fits there were, this one included.
    pub(crate) fits: usize,
    /// What the caller vouches for.
    pub(crate) declared: Option<Declared>,
    /// Whether noise and symmetry are asked for at all.
    pub(crate) stages: &'a Stages,
}

impl Question<'_> {
    fn fold(&self, symmetry: Symmetry) -> Fold {
        let body = &self.shape.body;
        Fold { centre: body.centre, axes: body.base_from_template, symmetry }
    }

    /// Conditions the process on the attractors' observations, whose noise is set here.
    pub(crate) fn answer(
        &self,
        observations: &mut [Observation],
        before: Option<&Choice>,
    ) -> (Displacement, Choice) {
        let touches = self.attractors.iter().filter(|a| a.sense == Sense::Touch).count();
        let prior =
            Prior { length_m: self.length_m, amplitude_m: EXPECTED_M, fold: self.fold(Symmetry::None) };

        let mut noise = before.map_or_else(Noise::default, |before| before.noise);
        self.set_noise(observations, &noise);
        let first = Displacement::fit(prior, observations);
        if self.stages.noise && touches >= TOUCHES_FOR_NOISE && Turn::of(self.fits) == Turn::Noise {
            noise = noise.improved(|guess| {
                let mut guessed = observations.to_vec();
                self.set_noise(&mut guessed, guess);
                let fitted = first.refit(EXPECTED_M, &guessed);
                self.rescaled(&fitted, EXPECTED_COUNT, &guessed).evidence()
            });
            self.set_noise(observations, &noise);
        }

        let alone = first.refit(EXPECTED_M, observations);
        let alone = self.rescaled(&alone, EXPECTED_COUNT, observations);
        let alone = self.rescaled(&alone, EXPECTED_COUNT, observations);
        let process = self.with_symmetry(alone, touches, observations, before);
        let symmetry = process.prior().fold.symmetry;
        (process, Choice { noise, symmetry, axes: self.shape.body.base_from_template })
    }

    fn set_noise(&self, observations: &mut [Observation], noise: &Noise) {
        for (observation, attractor) in observations.iter_mut().zip(self.attractors) {
            observation.noise_m = noise.of_m(attractor.sense, attractor.uncertainty);
        }
    }

    /// The same process with the amplitude that its touches ask for, where what is expected of it
    /// counts like so many of them. What was seen lies close together, and the template follows it:
    /// that it is hardly displaced there says nothing about the other side.
    fn rescaled(
        &self,
        process: &Displacement,
        expected_count: f64,
        observations: &[Observation],
    ) -> Displacement {
        let shares = self.attractors.iter().zip(process.determined(observations));
        let touches = shares.filter(|(a, _)| a.sense == Sense::Touch).map(|(_, share)| share);
        let (squares, count) = touches.fold((0.0, 0.0), |sum, share| (sum.0 + share.0, sum.1 + share.1));
        let squares_m2 = f64::max(squares, 0.0) * process.prior().amplitude_m.powi(2);
        let expected_m2 = expected_count * EXPECTED_M.powi(2);
        let variance_m2 = (expected_m2 + squares_m2) / (expected_count + count);
        process.refit(variance_m2.sqrt().min(LARGEST_M), observations)
    }

    /// Whether the template has the symmetry, or the caller vouches for it: what is alike on a body
    /// that is not is so by chance.
    fn is_possible(&self, symmetry: Symmetry) -> bool {
        self.declared.is_some() || self.shape.asymmetry_m(symmetry) < ASYMMETRY * self.shape.body.size_m()
    }

    /// The process with the symmetry under which the measurements are clearly the most likely.
    fn with_symmetry(
        &self,
        alone: Displacement,
        touches: usize,
        observations: &[Observation],
        before: Option<&Choice>,
    ) -> Displacement {
        let is_asked_for = self.stages.symmetry || self.declared.is_some();
        if !is_asked_for || touches < TOUCHES_FOR_SYMMETRY {
            return alone;
        }
        let same = before
            .filter(|before| !has_turned(before, &self.shape.body.base_from_template))
            .map(|before| before.symmetry);
        let candidates = match same {
            Some(symmetry) if Turn::of(self.fits) != Turn::Symmetry => vec![symmetry],
            _ => Symmetry::candidates(self.declared),
        };
        // What the caller vouches for needs no further evidence.
        let margin = if self.declared.is_some() { f64::NEG_INFINITY } else { CLEARLY_BETTER };
        let compared = |process: &Displacement| self.rescaled(process, COMPARED_COUNT, observations);
        let plain = compared(&compared(&alone));
        let processes = candidates
            .into_iter()
            .filter(|symmetry| *symmetry != Symmetry::None && self.is_possible(*symmetry))
            .map(|symmetry| plain.with_fold(self.fold(symmetry), observations));
        match processes.max_by(|a, b| a.evidence().total_cmp(&b.evidence())) {
            Some(best) => {
                let best = compared(&compared(&best));
                if best.evidence() > plain.evidence() + margin {
                    self.rescaled(&best, EXPECTED_COUNT, observations)
                } else {
                    alone
                }
            }
            None => alone,
        }
    }
}

/// Whether an axis that the symmetry is about has turned: about its own axis a bottle may turn.
fn has_turned(before: &Choice, axes: &Rotation3<f64>) -> bool {
    let turn = |axis: usize| {
        let cosine = before.axes.matrix().column(axis).dot(&axes.matrix().column(axis));
        cosine.abs().min(1.0).acos()
    };
    (0..3).any(|axis| before.symmetry.is_about(axis) && turn(axis) > TURNED)
}
