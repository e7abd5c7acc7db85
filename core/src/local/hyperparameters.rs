//! The hyperparameters of the process: its amplitude, the noise of the sensors and the symmetry of
//! the object, each chosen by the marginal likelihood of the measurements.
//!
//! Noise and symmetry are chosen anew in some fits only ([`Extras`]) and kept in between.

use std::cell::RefCell;

use nalgebra::Rotation3;
use serde::{Deserialize, Serialize};

use super::noise::Noise;
use super::observation::Observation;
use super::prepared::Prepared;
use super::prior::Prior;
use super::process::Displacement;
use crate::config::{DeclaredSymmetry, Stages};
use crate::evidence::attractor::{Attractor, Provenance, Sense};
use crate::fingerprint::Fingerprint;
use crate::schedule::Extras;
use crate::symmetry::{Symmetry, SymmetryFrame};
use crate::template::{Compound, PatchFrame};

/// Correlation length, as a share of the object's mean radius.
const CORRELATION: f64 = 0.6;
/// Prior on the amplitude: 8 mm, or this share of the visible patch's length where that is more, since
/// the hidden side is the deeper the larger an object looks. It has the weight of four touches; that is
/// a scaled inverse chi-square prior on the variance, with four degrees of freedom.
const EXPECTED_M: f64 = 0.008;
const EXPECTED_SHARE: f64 = 0.2;
const EXPECTED_COUNT: f64 = 4.0;
/// Weaker prior while symmetries are compared; otherwise a symmetry would win merely by shrinking
/// the amplitude.
const COMPARED_COUNT: f64 = 0.5;
/// The amplitude is never larger, in metres, however far off a touch may be: the system stays
/// regular.
const LARGEST_M: f64 = 0.1;
/// Bayes factor in favour of a symmetry that is asked of it, where one of ten hypotheses may come
/// out best by chance.
const BAYES_FACTOR: f64 = 20.0;
const HYPOTHESES: f64 = 10.0;
/// No measurement is trusted less than this: the system stays regular.
const LEAST_TRUST: f64 = 1e-4;
/// Fewer touches say nothing about the noise, or about a symmetry.
const TOUCHES_FOR_NOISE: usize = 5;
const TOUCHES_FOR_SYMMETRY: usize = 8;
/// A template has a symmetry if what the symmetry brings together lies this close on average, in
/// sizes of its body.
const ASYMMETRY: f64 = 0.03;
/// A symmetry whose axes were rotated by more than this is another one, in radians.
const ROTATED: f64 = 0.2;

/// The correlation length on a template of some area, in metres.
pub(crate) fn correlation_length_m(area_m2: f64) -> f64 {
    CORRELATION * (area_m2 / (4.0 * std::f64::consts::PI)).sqrt()
}

/// What was chosen, from which the next choice goes on.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Hyperparameters {
    /// Of the sensors.
    pub(crate) noise: Noise,
    /// Of the object.
    pub(crate) symmetry: Symmetry,
    /// The directions of the template's axes, which the symmetry is about.
    axes: Rotation3<f64>,
}

impl Hyperparameters {
    /// What the chosen noise costs, in nats.
    pub(super) fn cost(&self) -> f64 {
        self.noise.cost()
    }

    /// Adds itself to a fingerprint.
    pub(crate) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self { noise, symmetry, axes } = self;
        noise.fingerprint(fingerprint);
        match symmetry {
            Symmetry::None => fingerprint.count(0),
            Symmetry::Mirror(planes) => {
                planes.iter().for_each(|plane| fingerprint.count(1 + usize::from(*plane)));
            }
            Symmetry::Revolution(axis) => fingerprint.count(3 + axis),
        }
        fingerprint.rotation(axes);
    }
}

/// A process without symmetry that is prepared for its measurements, with what was found for it so far.
#[derive(Debug)]
pub(super) struct First {
    prepared: Prepared,
    /// Processes with the amplitude that the touches support, by the noise of the measurements and the amplitude that
    /// was expected: the same noise is tried while doubts are found, while noises are compared, and at last.
    supported: RefCell<Vec<(Vec<f64>, Displacement)>>,
}

/// What the hyperparameters are chosen for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Problem<'a> {
    /// The measured attractors.
    pub(crate) attractors: &'a [Attractor],
    /// The correlation length, in metres.
    pub(crate) length_m: f64,
    /// The template.
    pub(crate) shape: &'a Compound,
    /// What is chosen anew in this fit.
    pub(crate) extras: Extras,
    /// What the caller vouches for.
    pub(crate) declared: Option<DeclaredSymmetry>,
    /// Whether noise and symmetry are estimated at all.
    pub(crate) stages: &'a Stages,
}

impl Problem<'_> {
    /// The amplitude that is expected before any touch, in metres.
    fn expected_m(&self) -> f64 {
        (EXPECTED_SHARE * PatchFrame::of(self.attractors, None).length_m).max(EXPECTED_M)
    }

    fn frame(&self, symmetry: Symmetry) -> SymmetryFrame {
        let body = &self.shape.body;
        SymmetryFrame { centre: body.centre, axes: body.base_from_template, symmetry }
    }

    /// How many touches there are.
    pub(crate) fn touches(&self) -> usize {
        self.attractors.iter().filter(|a| a.sense == Sense::Touch).count()
    }

    /// The process without symmetry, for measurements at some points.
    pub(super) fn first(&self, observations: &[Observation]) -> First {
        let prior = Prior {
            length_m: self.length_m,
            amplitude_m: self.expected_m(),
            frame: self.frame(Symmetry::None),
        };
        First { prepared: Prepared::new(prior, observations), supported: RefCell::default() }
    }

    /// The process where sensors are as good as expected, with the amplitude that the touches support.
    pub(super) fn with_default_noise(&self, first: &First, observations: &mut [Observation]) -> Displacement {
        self.set_noise(observations, &Noise::default());
        self.supported(first, observations)
    }

    /// The process with the amplitude that the touches support; where that was computed before, it is what it was.
    fn supported(&self, first: &First, observations: &[Observation]) -> Displacement {
        let expected_m = self.expected_m();
        let question: Vec<f64> =
            observations.iter().map(|observation| observation.noise_m).chain([expected_m]).collect();
        let answered = first.supported.borrow().iter().find(|(other, _)| *other == question).cloned();
        if let Some((_, process)) = answered {
            return process;
        }
        let expected = first.prepared.given(expected_m, observations);
        let process = self.with_amplitude(&first.prepared, &expected, EXPECTED_COUNT, observations);
        first.supported.borrow_mut().push((question, process.clone()));
        process
    }

    /// Conditions the process on the attractors' observations, whose noise is set here.
    pub(super) fn choose(
        &self,
        first: &First,
        observations: &mut [Observation],
        before: Option<&Hyperparameters>,
    ) -> (Displacement, Hyperparameters) {
        let touches = self.touches();
        let mut noise = before.map_or_else(Noise::default, |before| before.noise);
        self.set_noise(observations, &noise);
        if self.stages.noise && touches >= TOUCHES_FOR_NOISE && self.extras.noise {
            noise = noise.improved(|guess| {
                let mut guessed = observations.to_vec();
                self.set_noise(&mut guessed, guess);
                self.supported(first, &guessed).evidence()
            });
            self.set_noise(observations, &noise);
        }

        let alone = self.supported(first, observations);
        let alone = self.with_amplitude(&first.prepared, &alone, EXPECTED_COUNT, observations);
        let process = self.with_symmetry(&first.prepared, alone, touches, observations, before);
        let symmetry = process.prior().frame.symmetry;
        (process, Hyperparameters { noise, symmetry, axes: self.shape.body.base_from_template })
    }

    fn set_noise(&self, observations: &mut [Observation], noise: &Noise) {
        for (observation, attractor) in observations.iter_mut().zip(self.attractors) {
            let noise_m = nominal_m(noise, attractor, observation);
            // A touch that is doubted weighs by the probability that it is one.
            let trust = (1.0 - attractor.provenance.doubt).max(LEAST_TRUST);
            observation.noise_m = noise_m / trust.sqrt();
        }
    }

    /// The same process with the amplitude that its touches support, beside a prior with the weight of
    /// `expected_count` of them. Visual points lie close together, and the template follows them: that
    /// it is hardly displaced there says nothing about the other side.
    fn with_amplitude(
        &self,
        prepared: &Prepared,
        process: &Displacement,
        expected_count: f64,
        observations: &[Observation],
    ) -> Displacement {
        // What was seen comes first, and is the larger part.
        let first = self.attractors.iter().position(|a| a.sense == Sense::Touch);
        let first = first.unwrap_or(self.attractors.len());
        let shares = self.attractors[first..].iter().zip(process.determined(observations, first));
        let touches = shares.filter(|(a, _)| a.sense == Sense::Touch).map(|(_, share)| share);
        let (squares, count) = touches.fold((0.0, 0.0), |sum, share| (sum.0 + share.0, sum.1 + share.1));
        let squares_m2 = f64::max(squares, 0.0) * process.prior().amplitude_m.powi(2);
        let expected_m2 = expected_count * self.expected_m().powi(2);
        let variance_m2 = (expected_m2 + squares_m2) / (expected_count + count);
        prepared.given(variance_m2.sqrt().min(LARGEST_M), observations)
    }

    /// Whether the template has the symmetry, or the caller vouches for it: on a body that has not,
    /// displacements are correlated by chance only.
    fn is_possible(&self, symmetry: Symmetry) -> bool {
        self.declared.is_some() || self.shape.asymmetry_m(symmetry) < ASYMMETRY * self.shape.body.size_m()
    }

    /// The process with the symmetry under which the measurements are clearly the most likely.
    fn with_symmetry(
        &self,
        prepared: &Prepared,
        alone: Displacement,
        touches: usize,
        observations: &[Observation],
        before: Option<&Hyperparameters>,
    ) -> Displacement {
        let is_estimated = self.stages.symmetry || self.declared.is_some();
        if !is_estimated || touches < TOUCHES_FOR_SYMMETRY {
            return alone;
        }
        let same = before
            .filter(|before| !has_rotated(before, &self.shape.body.base_from_template))
            .map(|before| before.symmetry);
        let candidates = match same {
            Some(symmetry) if !self.extras.symmetry => vec![symmetry],
            _ => Symmetry::candidates(self.declared),
        };
        // A declared symmetry needs no further evidence.
        let margin =
            if self.declared.is_some() { f64::NEG_INFINITY } else { (BAYES_FACTOR * HYPOTHESES).ln() };
        let is_possible = |symmetry: &Symmetry| *symmetry != Symmetry::None && self.is_possible(*symmetry);
        let possible: Vec<Symmetry> = candidates.into_iter().filter(is_possible).collect();
        if possible.is_empty() {
            return alone;
        }
        let compared = |prepared: &Prepared, process: &Displacement| {
            self.with_amplitude(prepared, process, COMPARED_COUNT, observations)
        };
        let plain = compared(prepared, &compared(prepared, &alone));
        let amplitude_m = plain.prior().amplitude_m;
        let processes = possible.into_iter().map(|symmetry| {
            let symmetric = prepared.with_symmetry(self.frame(symmetry));
            let process = symmetric.given(amplitude_m, observations);
            (symmetric, process)
        });
        match processes.max_by(|(_, a), (_, b)| a.evidence().total_cmp(&b.evidence())) {
            Some((symmetric, best)) => {
                let best = compared(&symmetric, &compared(&symmetric, &best));
                if best.evidence() > plain.evidence() + margin {
                    self.with_amplitude(&symmetric, &best, EXPECTED_COUNT, observations)
                } else {
                    alone
                }
            }
            None => alone,
        }
    }
}

/// The noise of a measurement that is believed, in metres: that of its sensor, and across the approach that
/// of the place on the pad, as far as the surface is inclined to it.
pub(crate) fn nominal_m(noise: &Noise, attractor: &Attractor, observation: &Observation) -> f64 {
    let Provenance { lateral_m, approach, .. } = attractor.provenance;
    let normal = observation.at.normal;
    let inclination = (normal - approach * normal.dot(&approach)).norm();
    noise.of_m(attractor.sense, attractor.uncertainty).hypot(lateral_m * inclination)
}

/// Whether an axis that the symmetry is about has turned: about its own axis a bottle may turn.
fn has_rotated(before: &Hyperparameters, axes: &Rotation3<f64>) -> bool {
    let turn = |axis: usize| {
        let cosine = before.axes.matrix().column(axis).dot(&axes.matrix().column(axis));
        cosine.abs().min(1.0).acos()
    };
    (0..3).any(|axis| before.symmetry.is_about(axis) && turn(axis) > ROTATED)
}
