//! An exploration in process: the simulated camera and probe in front of the method itself, without
//! a server. For studies of the method, and to see a change of it quickly.

use palpate_core::config::{Config, Settings};
use palpate_core::evidence::clutter::{self, Fate};
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Outcome, Pad, Sweep, Target, TouchedPoint, VisualPrior, Wrench,
};
use palpate_core::exploration::{Candidate, ProposalRequest};
use palpate_core::geometry::{Direction, Vector};
use palpate_core::reconstruction::Reconstruction;

use crate::body::Body;
use crate::camera::Camera;
use crate::faults::Faults;
use crate::probe::{self, Approach, PAD_HALF_SIDE_M, ProbeSettings, Touch};
use crate::scene::Scene;

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
    /// What is touched with, and what it measures.
    pub probe: ProbeSettings,
    /// Which point of the pad is declared to touch.
    pub declared: TouchedPoint,
    /// What goes wrong.
    pub faults: Faults,
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
    /// By what the object stands elsewhere than at the beginning, in metres: an estimate is compared with the
    /// unmoved object after it is moved back by this.
    pub displacement: Vector,
}

impl<'a> Exploration<'a> {
    /// Fifty attempts of the best method, of exact sensors and of a robot that does nothing wrong.
    pub fn new(body: &'a Body, seed: u64) -> Self {
        Self {
            body,
            seed,
            settings: Settings::default(),
            attempts: 50,
            camera: Camera::default(),
            probe: ProbeSettings::default(),
            declared: TouchedPoint::PadCentre,
            faults: Faults::default(),
        }
    }

    /// The object as the robot finds it.
    fn scene(&self) -> Scene<'a> {
        Scene::new(self.body, self.probe, self.faults, self.seed)
    }

    /// The cloud that the camera sees.
    ///
    /// # Errors
    /// The camera sees too little.
    pub fn view(&self) -> Result<Evidence, palpate_core::error::Error> {
        let view = self.scene().look(&self.camera);
        let sorted = clutter::sort(&view.points, Some(&view.viewpoint), None);
        let is_kept = |(_, fate): &(palpate_core::geometry::Point, Fate)| *fate == Fate::Kept;
        let kept = view.points.into_iter().zip(sorted.fates).filter(is_kept).map(|(point, _)| point);
        Ok(Evidence::VisualPrior(VisualPrior::new(kept.collect(), None, Some(view.viewpoint))?))
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
        let mut scene = self.scene();
        let pad = Pad::new(PAD_HALF_SIDE_M)?.touching_with(self.declared);
        let (mut state, _) = Reconstruction::new(config).absorb(&self.view()?)?;
        for _ in 0..self.attempts {
            let proposal = state.propose(&ProposalRequest::best(1));
            let Some(candidate) = proposal.candidates.first() else { break };
            let approach = Approach { start: candidate.probe_start, end: candidate.probe_end };
            let outcome = scene.touch(approach);
            let evidence = report(&outcome, candidate, self.probe.pad.sweep_radius_m(), pad)?;
            state = state.absorb(&evidence)?.0;
            let displacement = scene.displacement();
            watch(&Step { candidate, outcome: &outcome, evidence: &evidence, state: &state, displacement });
        }
        Ok(state)
    }
}

/// What the robot says of an approach.
fn report(
    outcome: &probe::Outcome,
    candidate: &Candidate,
    sweep_radius_m: f64,
    declared: Pad,
) -> Result<Evidence, palpate_core::error::Error> {
    let outcome = match outcome.contact() {
        Some(touch) => Outcome::Contact(contact(touch, declared)?),
        None => {
            let (from, to) = (candidate.probe_start, candidate.probe_end);
            Outcome::NoContact(Sweep::new(from, to, sweep_radius_m)?)
        }
    };
    let target = Target::new(candidate.point, candidate.normal.into_inner())?;
    Ok(Evidence::Attempt(Attempt { target: Some(target), outcome }))
}

fn contact(touch: &Touch, pad: Pad) -> Result<Contact, palpate_core::error::Error> {
    let wrench = Wrench { force: touch.force_n, torque: touch.torque_nm };
    let normal = touch.normal.map(Direction::into_inner);
    let detail = ContactDetail { swept_from: Some(touch.swept_from), normal, ..ContactDetail::default() };
    Ok(Contact::new(touch.base_from_sensor, wrench, pad, detail)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::Motion;
    use crate::probe::Pad;
    use crate::shapes;

    #[test]
    fn every_attempt_tells_where_the_object_stands_and_what_was_reported_of_it() {
        let body = shapes::generate("can").unwrap();
        let motion = Motion { attempt: 3, distance_m: 0.02 };
        let exploration = Exploration {
            attempts: 8,
            probe: ProbeSettings { pad: Pad::Flat, ..ProbeSettings::default() },
            faults: Faults { move_after: Some(motion), false_contact_share: 0.4, ..Faults::default() },
            ..Exploration::new(&body, 2)
        };
        let (mut displacements, mut reported) = (Vec::new(), Vec::new());
        exploration
            .run(|step| {
                displacements.push(step.displacement);
                let Evidence::Attempt(attempt) = step.evidence else { panic!("an attempt") };
                match (step.outcome, &attempt.outcome) {
                    (probe::Outcome::Miss, Outcome::NoContact(sweep)) => {
                        assert_eq!(sweep.radius_m(), PAD_HALF_SIDE_M);
                    }
                    (outcome, Outcome::Contact(contact)) => {
                        let touch = outcome.contact().unwrap();
                        assert_eq!(contact.wrench().force, touch.force_n);
                        reported.push(matches!(outcome, probe::Outcome::False(_)));
                    }
                    (outcome, reported) => panic!("{outcome:?} was reported as {reported:?}"),
                }
            })
            .unwrap();
        let moved = motion.displacement(2);
        assert_eq!(displacements, [[Vector::zeros(); 3].to_vec(), vec![moved; 5]].concat());
        assert!(reported.contains(&true) && reported.contains(&false), "{reported:?}");
    }
}
