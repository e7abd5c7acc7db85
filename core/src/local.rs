//! The local stage: how far the surface lies from the template, between and at the attractors
//! (Section III-E).
//!
//! Takes the template's surface and the evidence; gives a height along the normal for each vertex.
//! METHOD_PAPER bends a [`thin_plate`]. METHOD_PALPATE conditions a Gaussian [`process`], chooses
//! its [`hyperparameters`], holds it back from what the probe has swept, and gives a calibrated
//! standard deviation beside each height: one [`Raised`] for all of it.

mod doubts;
pub(crate) mod hyperparameters;
mod kernel;
mod noise;
pub mod process;
pub mod thin_plate;
mod vertex_process;

pub use vertex_process::VertexProcess;

use std::collections::BTreeMap;

pub(crate) use self::hyperparameters::Hyperparameters;
use self::process::{Displacement, Observation};
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
    let observe = |point: &Point, noise_m| {
        let projection = surface.project(point);
        Observation::new(projection.foot, projection.height_m, noise_m)
    };
    // The noise is among what is chosen, and a correction among what is estimated.
    let observed = |attractor: &Attractor| {
        let observation = observe(&attractor.point, 0.0);
        let Provenance { correction, rigid, .. } = attractor.provenance;
        let height_m = observation.height_m - observation.at.normal.dot(&correction);
        Observation { height_m, rigid, ..observation }
    };
    let mut observations: Vec<Observation> = evidence.measured.iter().map(observed).collect();
    let others = evidence.others.iter().map(|(kept, other)| (*kept, observed(other)));
    take_together(&mut observations, others);
    let problem = |attractors| hyperparameters::Problem {
        attractors,
        length_m: hyperparameters::correlation_length_m(surface.mesh().area()),
        shape,
        extras,
        declared: config.symmetry,
        stages: &config.stages,
    };
    let first = problem(&evidence.measured).first(&mut observations);
    let attractors = if config.stages.doubts {
        doubts::found(&problem(&evidence.measured), &first, &mut observations)
    } else {
        evidence.measured.clone()
    };
    let (process, hyperparameters) = problem(&attractors).choose(&first, &mut observations, before);
    let log_likelihood = process.evidence() - hyperparameters.cost();

    let free: Vec<Observation> =
        evidence.free_space.outside().iter().map(|point| observe(point, FREE_NOISE_M)).collect();
    let process = held_back(process, &mut observations, &free);
    Conditioned {
        residual_m: process.residual_m(&observations[..evidence.measured.len()]),
        judged: attractors,
        rigid: rigid_offsets(&process, &observations),
        process,
        hyperparameters,
        log_likelihood,
    }
}

impl Conditioned {
    /// The template's surface raised by it. Every fit is judged without; only what is kept is raised.
    pub(crate) fn raise(self, surface: &TemplateSurface) -> Raised {
        let Self { process, residual_m, hyperparameters, .. } = self;
        let vertices = surface.vertices();
        let (heights_m, deviations_m) = process.predict(&vertices);
        Raised {
            heights_m,
            std_m: deviations_m.iter().map(|m| Calibration::FITTED.stated_m(*m)).collect(),
            residual_m,
            process: VertexProcess::new(process, vertices, deviations_m),
            hyperparameters,
        }
    }
}

/// Replaces observations by their means with others that they stand for, each given with its index among them:
/// heights over the template are averaged, in which no curvature of the object is lost.
fn take_together(observations: &mut [Observation], others: impl Iterator<Item = (usize, Observation)>) {
    let mut counts = vec![1.0_f64; observations.len()];
    for (kept, other) in others {
        let Observation { at, height_m, .. } = &mut observations[kept];
        counts[kept] += 1.0;
        let share = 1.0 / counts[kept];
        at.point += (other.at.point - at.point) * share;
        at.normal += (other.at.normal - at.normal) * share;
        *height_m += (other.height_m - *height_m) * share;
    }
    let together = observations.iter_mut().zip(&counts).filter(|(_, count)| **count > 1.0);
    for (Observation { at, .. }, _) in together {
        at.normal = at.normal.try_normalize(0.0).unwrap_or(at.normal);
    }
}

/// What each group of measurements is off by.
fn rigid_offsets(process: &Displacement, observations: &[Observation]) -> Vec<(Group, RigidOffset)> {
    let groups: BTreeMap<Group, Rigid> =
        observations.iter().flat_map(|o| o.rigid).flatten().map(|rigid| (rigid.group, rigid)).collect();
    groups.into_values().map(|rigid| (rigid.group, process.rigid_offset(observations, rigid))).collect()
}

/// The process with the surface pulled back to the free points that it would cover; one that is still
/// covered afterwards counts twice.
fn held_back(
    process: Displacement,
    observations: &mut Vec<Observation>,
    free: &[Observation],
) -> Displacement {
    let places: Vec<SurfacePoint> = free.iter().map(|o| o.at).collect();
    (0..HOLD_BACKS).fold(process, |process, _| {
        let covers = |(o, height_m): &(&Observation, f64)| *height_m > o.height_m + COVERED_M;
        let heights_m = process.means_m(&places);
        let covered: Vec<Observation> = free.iter().zip(heights_m).filter(covers).map(|(o, _)| *o).collect();
        if covered.is_empty() {
            return process;
        }
        observations.extend(covered);
        Displacement::fit(*process.prior(), observations)
    })
}
