//! An exploration in process: the simulated camera and probe in front of the method itself, without
//! a server. For studies of the method, and to see a change of it quickly.

use palpate_core::config::{Config, Settings};
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Outcome, Sweep, Target, VisualPrior, Wrench,
};
use palpate_core::exploration::{Candidate, ProposalRequest};
use palpate_core::reconstruction::Reconstruction;

use crate::body::Body;
use crate::camera::Camera;
use crate::probe::{self, Approach, PAD_HALF_SIDE_M, Probe, ProbeSettings, Touch};

/// What is explored, and how.
#[derive(Clone, Debug)]
pub struct Exploration<'a> {
    /// What is seen and touched.
    pub body: &'a Body,
    /// Decides the view, the patch, the offsets on the pad and all noise.
    pub seed: u64,
    /// Parameters of the method.
    pub settings: Settings,
    /// Failures included.
    pub attempts: u32,
    /// How much is seen before the first touch, and how well.
    pub camera: Camera,
    /// Standard deviation of a touched position along each axis, in metres.
    pub tactile_noise_m: f64,
}

/// One attempt: what was proposed, what became of it, and the state after it.
#[derive(Debug)]
pub struct Step<'a> {
    /// What was proposed.
    pub candidate: &'a Candidate,
    /// What became of it, as simulated.
    pub outcome: &'a probe::Outcome,
    /// What was reported.
    pub evidence: &'a Evidence,
    /// The state after the report.
    pub state: &'a Reconstruction,
}

impl Exploration<'_> {
    /// The cloud that the camera sees.
    ///
    /// # Errors
    /// The camera sees too little.
    pub fn view(&self) -> Result<Evidence, palpate_core::error::Error> {
        let view = self.camera.look(self.body, self.seed);
        Ok(Evidence::VisualPrior(VisualPrior::new(view.points, None, Some(view.viewpoint))?))
    }

    /// Looks, then touches what is proposed until the attempts are spent or nothing is proposed; each
    /// attempt is shown to `watch`. Returns the last state.
    ///
    /// # Errors
    /// A setting that is refused, or a view that shows too little.
    pub fn run(
        &self,
        mut watch: impl FnMut(&Step<'_>),
    ) -> Result<Reconstruction, palpate_core::error::Error> {
        let config = Config::new(Settings { seed: self.seed, ..self.settings.clone() })?;
        let settings = ProbeSettings { tactile_noise_m: self.tactile_noise_m, ..ProbeSettings::default() };
        let mut probe = Probe::new(settings, self.seed);
        let (mut state, _) = Reconstruction::new(config).absorb(&self.view()?)?;
        for _ in 0..self.attempts {
            let proposal = state.propose(&ProposalRequest::best(1));
            let Some(candidate) = proposal.candidates.first() else { break };
            let approach = Approach { start: candidate.probe_start, end: candidate.probe_end };
            let outcome = probe.touch(self.body, approach);
            let evidence = report(&outcome, candidate)?;
            state = state.absorb(&evidence)?.0;
            watch(&Step { candidate, outcome: &outcome, evidence: &evidence, state: &state });
        }
        Ok(state)
    }
}

/// What the robot says of an approach.
fn report(outcome: &probe::Outcome, candidate: &Candidate) -> Result<Evidence, palpate_core::error::Error> {
    let outcome = match outcome {
        probe::Outcome::Hit(touch) | probe::Outcome::Early(touch) => Outcome::Contact(contact(touch)?),
        probe::Outcome::Miss => {
            Outcome::NoContact(Sweep::new(candidate.probe_start, candidate.probe_end, 0.0)?)
        }
    };
    let target = Target::new(candidate.point, candidate.normal.into_inner())?;
    Ok(Evidence::Attempt(Attempt { target: Some(target), outcome }))
}

fn contact(touch: &Touch) -> Result<Contact, palpate_core::error::Error> {
    let wrench = Wrench { force: touch.force_n, torque: touch.torque_nm };
    let detail = ContactDetail { swept_from: Some(touch.swept_from), ..ContactDetail::default() };
    Ok(Contact::new(touch.base_from_sensor, wrench, PAD_HALF_SIDE_M, detail)?)
}
