//! The local stage: how far the surface lies from the template, between and at the attractors
//! (Section III-E).
//!
//! Takes the template's surface and the evidence; gives a height along the normal for each vertex.
//! METHOD_PAPER bends a [`thin_plate`]. METHOD_PALPATE conditions a Gaussian [`process`], chooses
//! its [`hyperparameters`], holds it back from what the probe has swept, and gives a calibrated
//! standard deviation beside each height: one [`Raised`] for all of it.

mod affine;
mod cholesky;
mod doubts;
pub(crate) mod hyperparameters;
mod kernel;
mod noise;
pub(crate) mod observation;
mod prepared;
pub(crate) mod prior;
pub mod process;
pub mod thin_plate;
mod vertex_process;

pub use vertex_process::VertexProcess;

use std::collections::BTreeMap;

pub(crate) use self::hyperparameters::Hyperparameters;
use self::observation::Observation;
use self::process::Displacement;
use crate::config::Config;
use crate::evidence::attractor::{Attractor, Group, Provenance, Rigid};
use crate::evidence::{FitEvidence, RigidOffset};
use crate::geometry::{Point, SurfacePoint};
use crate::schedule::Extras;
use crate::template::{Compound, TemplateSurface};

/// Noise of a point that is merely known to be free, in metres.
const FREE_NOISE_M: f64 = 0.003;
/// The surface may cover a free point by this much before it is held back, in metres.
const COVERED_M: f64 = 0.0005;
/// How often the surface is held back: what is held back here bulges a little there.
const HOLD_BACKS: usize = 2;

/// How a stated deviation follows from the process's, so that 95 % of errors lie within two of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// The error of the surface, template included, against the process's deviation.
    pub scale: f64,
    /// No stated deviation is less, in metres.
    pub least_m: f64,
}

impl Calibration {
    /// The calibration in use, fitted by the simulator's example `calibrate`.
    pub const FITTED: Self = Self { scale: 1.5, least_m: 0.0003 };

    /// The stated deviation for one of the process, in metres.
    pub fn stated_m(&self, deviation_m: f64) -> f64 {
        (self.scale * deviation_m).hypot(self.least_m)
    }
}

/// The process that the local stage of METHOD_PALPATE conditioned on what was measured.
#[derive(Debug)]
pub(crate) struct Conditioned {
    process: Displacement,
    /// Root mean square of what it leaves of the attractors' heights, in metres.
    residual_m: f64,
    /// What the next fit goes on from.
    pub(crate) hyperparameters: Hyperparameters,
    /// How likely the measurements were, as a logarithm, up to a constant.
    pub(crate) log_likelihood: f64,
    /// What was measured, with the doubts that were found.
    pub(crate) judged: Vec<Attractor>,
    /// The rigid offsets of groups of measurements.
    pub(crate) rigid: Vec<(Group, RigidOffset)>,
    /// What the process was conditioned on before it was held back.
    measured: Vec<Observation>,
    /// What may hold it back.
    free: Vec<Observation>,
}

/// The surface that the local stage of METHOD_PALPATE found.
#[derive(Clone, Debug)]
pub struct Raised {
    /// Height of the surface over the template at each vertex, in metres.
    pub heights_m: Vec<f64>,
    /// Calibrated standard deviation of the surface at each vertex, in metres.
    pub std_m: Vec<f64>,
    /// Root mean square of what the surface leaves of the attractors' heights, in metres.
    pub residual_m: f64,
    /// The process at the vertices.
    pub process: VertexProcess,
    /// What the next fit goes on from.
    pub(crate) hyperparameters: Hyperparameters,
}

impl Raised {
    /// What it takes in memory, in bytes, by its largest parts.
    pub(crate) fn bytes(&self) -> usize {
        /// Height, deviations and the point of the template.
        const VERTEX: usize = 80;
        VERTEX * self.heights_m.len() + self.process.bytes()
    }
}

/// Conditions the displacement of the template's surface on what was measured, and holds it back from what was
/// swept.
pub(crate) fn condition(
    surface: &TemplateSurface,
    shape: &Compound,
    evidence: &FitEvidence,
    before: Option<&Hyperparameters>,
    extras: Extras,
    config: &Config,
) -> Conditioned {
    let mut measured: Vec<Observation> = evidence.measured.iter().map(|a| observed(surface, a)).collect();
    let problem = |attractors| hyperparameters::Problem {
        attractors,
        length_m: hyperparameters::correlation_length_m(surface.mesh().area()),
        shape,
        extras,
        declared: config.symmetry,
        stages: &config.stages,
    };
    let first = problem(&evidence.measured).first(&measured);
    let attractors = if config.stages.doubts {
        doubts::found(&problem(&evidence.measured), &first, &mut measured)
    } else {
        evidence.measured.clone()
    };
    let (process, hyperparameters) = problem(&attractors).choose(&first, &mut measured, before);
    let log_likelihood = process.evidence() - hyperparameters.cost();

    let outside = evidence.free_space.outside().iter();
    let free: Vec<Observation> = outside.map(|point| observe(surface, point, FREE_NOISE_M)).collect();
    let (process, observations) = held_back(process, &measured, &free);
    Conditioned {
        residual_m: process.residual_m(&observations[..measured.len()]),
        judged: attractors,
        rigid: rigid_offsets(&process, &observations),
        process,
        hyperparameters,
        log_likelihood,
        measured,
        free,
    }
}

fn observe(surface: &TemplateSurface, point: &Point, noise_m: f64) -> Observation {
    let projection = surface.project(point);
    Observation::new(projection.foot, projection.height_m, noise_m)
}

/// What was measured; its noise is among what is chosen, and its correction among what is estimated.
fn observed(surface: &TemplateSurface, attractor: &Attractor) -> Observation {
    let observation = observe(surface, &attractor.point, 0.0);
    let Provenance { correction, rigid, .. } = attractor.provenance;
    let height_m = observation.height_m - observation.at.normal.dot(&correction);
    Observation { height_m, rigid, ..observation }
}

impl Conditioned {
    /// The template's surface raised by it, and by further touches where it shall meet those too: they make its
    /// heights finer, and are left out of its deviations. Every fit is judged without; only what is kept is raised.
    pub(crate) fn raise(self, surface: &TemplateSurface, detail: &[Attractor]) -> Raised {
        let vertices = surface.vertices();
        let (mut heights_m, deviations_m) = self.process.predict(&vertices, vertices.len());
        if !detail.is_empty() {
            heights_m = self.detailed(surface, detail).means_m(&vertices);
        }
        let Self { process, residual_m, hyperparameters, .. } = self;
        Raised {
            heights_m,
            std_m: stated_m(&deviations_m),
            residual_m,
            process: VertexProcess::new(process, vertices, deviations_m),
            hyperparameters,
        }
    }

    /// Heights and calibrated standard deviations of the vertices as [`Self::raise`] finds them, the deviations of the
    /// first ones only.
    pub(crate) fn outline(
        &self,
        surface: &TemplateSurface,
        detail: &[Attractor],
        deviating: usize,
    ) -> (Vec<f64>, Vec<f64>) {
        let vertices = surface.vertices();
        let (mut heights_m, deviations_m) = self.process.predict(&vertices, deviating);
        if !detail.is_empty() {
            heights_m = self.detailed(surface, detail).means_m(&vertices);
        }
        (heights_m, stated_m(&deviations_m))
    }

    /// The process conditioned on further touches as well.
    fn detailed(&self, surface: &TemplateSurface, detail: &[Attractor]) -> Displacement {
        let noise = &self.hyperparameters.noise;
        let further = detail.iter().map(|attractor| {
            let observation = observed(surface, attractor);
            Observation { noise_m: hyperparameters::nominal_m(noise, attractor, &observation), ..observation }
        });
        let all: Vec<Observation> = self.measured.iter().copied().chain(further).collect();
        held_back(Displacement::fit(*self.process.prior(), &all), &all, &self.free).0
    }
}

fn stated_m(deviations_m: &[f64]) -> Vec<f64> {
    deviations_m.iter().map(|m| Calibration::FITTED.stated_m(*m)).collect()
}

/// What each group of measurements is off by.
fn rigid_offsets(process: &Displacement, observations: &[Observation]) -> Vec<(Group, RigidOffset)> {
    let groups: BTreeMap<Group, Rigid> =
        observations.iter().flat_map(|o| o.rigid).flatten().map(|rigid| (rigid.group, rigid)).collect();
    groups.into_values().map(|rigid| (rigid.group, process.rigid_offset(observations, rigid))).collect()
}

/// The process with the surface pulled back to the free points that it would cover, and all that it is then
/// conditioned on; a point that is still covered afterwards counts twice.
fn held_back(
    mut process: Displacement,
    measured: &[Observation],
    free: &[Observation],
) -> (Displacement, Vec<Observation>) {
    let mut observations = measured.to_vec();
    let places: Vec<SurfacePoint> = free.iter().map(|o| o.at).collect();
    for _ in 0..HOLD_BACKS {
        let covers = |(o, height_m): &(&Observation, f64)| *height_m > o.height_m + COVERED_M;
        let heights_m = process.means_m(&places);
        let before = observations.len();
        observations.extend(free.iter().zip(heights_m).filter(covers).map(|(o, _)| *o));
        if observations.len() == before {
            break;
        }
        process = process.extended(&observations);
    }
    (process, observations)
}
