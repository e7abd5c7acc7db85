//! One exploration, from the view to the last attempt.

use palpate_core::config::{Config, Settings, Stages, StopRule};
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Outcome, Sweep, Target, VisualPrior, Wrench,
};
use palpate_core::exploration::{Candidate, ProposalRequest};
use palpate_core::reconstruction::Reconstruction;
use palpate_simulator::camera;
use palpate_simulator::probe::{self, Approach, PAD_HALF_SIDE_M, Probe, ProbeSettings, Touch};

use crate::Problem;
use crate::objects::Object;

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
    /// Standard deviations of the camera and of the probe.
    pub(crate) depth_noise_m: f64,
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
        let view = camera::look(body, self.seed, self.depth_noise_m);
        let settings = ProbeSettings { tactile_noise_m: self.tactile_noise_m, ..ProbeSettings::default() };
        let mut probe = Probe::new(settings, self.seed);
        let prior = VisualPrior::new(view.points, None, Some(view.viewpoint))?;
        let (mut state, _) = Reconstruction::new(self.config()?).absorb(&Evidence::VisualPrior(prior))?;
        let request = ProposalRequest { top_k: 1, ..ProposalRequest::default() };
        let mut failures = 0;
        for _ in 0..self.attempts {
            let proposal = state.propose(&request);
            let Some(candidate) = proposal.candidates.first() else { break };
            let approach = Approach { start: candidate.probe_start, end: candidate.probe_end };
            let outcome = probe.touch(body, approach);
            failures += u32::from(!matches!(outcome, probe::Outcome::Hit(_)));
            let attempt = Attempt {
                target: Some(Target::new(candidate.point, candidate.normal.into_inner())?),
                outcome: report(&outcome, candidate)?,
            };
            state = state.absorb(&Evidence::Attempt(attempt))?.0;
        }
        let surface = state.surface().ok_or("nothing was seen")?;
        let surface_distance_mm = 1e3 * reference.surface_distance_m(&surface.mesh)?;
        Ok(Run { object: name.clone(), seed: self.seed, surface_distance_mm, failures })
    }

    fn config(&self) -> Result<Config, Problem> {
        let stop = StopRule { max_attempts: Some(self.attempts), ..StopRule::default() };
        let settings = Settings { seed: self.seed, stages: self.stages, stop, ..Settings::default() };
        Ok(Config::new(settings)?)
    }
}

/// What the robot says of an approach.
fn report(outcome: &probe::Outcome, candidate: &Candidate) -> Result<Outcome, Problem> {
    Ok(match outcome {
        probe::Outcome::Hit(touch) | probe::Outcome::Early(touch) => Outcome::Contact(contact(touch)?),
        probe::Outcome::Miss => {
            Outcome::NoContact(Sweep::new(candidate.probe_start, candidate.probe_end, 0.0)?)
        }
    })
}

fn contact(touch: &Touch) -> Result<Contact, Problem> {
    let wrench = Wrench { force: touch.force_n, torque: touch.torque_nm };
    let detail = ContactDetail { swept_from: Some(touch.swept_from), ..ContactDetail::default() };
    Ok(Contact::new(touch.base_from_sensor, wrench, PAD_HALF_SIDE_M, detail)?)
}
