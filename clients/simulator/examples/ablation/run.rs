//! One exploration, from the view to the last attempt.

use palpate_core::config::{Settings, Stages};
use palpate_simulator::camera::Camera;
use palpate_simulator::in_process::Exploration;
use palpate_simulator::objects::{Object, Problem};
use palpate_simulator::probe::{Outcome, ProbeSettings};

/// What is explored, and how.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plan<'a> {
    pub(crate) object: &'a Object,
    /// Decides the view, the patch, the offsets on the pad and all noise.
    pub(crate) seed: u64,
    /// The ideas in use.
    pub(crate) stages: Stages,
    /// Failures included.
    pub(crate) attempts: u32,
    pub(crate) camera: Camera,
    /// Standard deviation of the probe.
    pub(crate) tactile_noise_m: f64,
}

/// What came of it.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    /// The object's name.
    pub(crate) object: String,
    pub(crate) seed: u64,
    /// Of the last estimate.
    pub(crate) surface_distance_mm: f64,
    /// Attempts that missed or touched early.
    pub(crate) failures: u32,
}

impl Plan<'_> {
    /// Looks, then touches what is proposed until the attempts are spent.
    pub(crate) fn run(&self) -> Result<Run, Problem> {
        let Object { name, body, reference } = self.object;
        let exploration = Exploration {
            settings: Settings { stages: self.stages, ..Settings::default() },
            attempts: self.attempts,
            camera: self.camera,
            probe: ProbeSettings { tactile_noise_m: self.tactile_noise_m, ..ProbeSettings::default() },
            ..Exploration::new(body, self.seed)
        };
        let mut failures = 0;
        let state =
            exploration.run(|step| failures += u32::from(!matches!(step.outcome, Outcome::Hit(_))))?;
        let surface = state.surface().ok_or("nothing was seen")?;
        let surface_distance_mm = 1e3 * reference.surface_distance_m(&surface.mesh)?;
        Ok(Run { object: name.clone(), seed: self.seed, surface_distance_mm, failures })
    }
}
