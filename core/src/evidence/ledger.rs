//! The ledger: evidence sorted into what pulls the surface, what failed, and how often.

use super::attempt::{Attempt, Contact, Outcome};
use super::attractor::{Attractor, Sense, contact_uncertainty, wrench_warnings};
use super::free_space::FreeSpace;
use super::visual_prior::VisualPrior;
use super::{Evidence, tangent};
use crate::config::Config;
use crate::error::Error;
use crate::fingerprint::Fingerprint;
use crate::geometry::{Direction, Point};

/// An attempt that did not end in a touch where the estimate expected one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Failure {
    /// The candidate, in metres. By position: a fit may renumber the vertices.
    pub point: Point,
    /// How many contacts had succeeded before it.
    pub contacts_before: u32,
}

/// How often what happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tallies {
    /// Points seen.
    pub visual_points: u32,
    /// Approaches, failures included.
    pub attempts: u32,
    /// Touches near their candidate, or without one.
    pub contacts: u32,
    /// Approaches that touched nothing.
    pub no_contacts: u32,
    /// Touches further than the failure distance from their candidate.
    pub early_contacts: u32,
    /// Approaches that the robot refused.
    pub rejected: u32,
    /// Touches by something other than the pad.
    pub invalid_contacts: u32,
    /// Failures since the last success.
    pub consecutive_failures: u32,
}

impl Tallies {
    /// Attempts that ended otherwise than in a touch near the candidate.
    pub fn failures(&self) -> u32 {
        self.no_contacts + self.early_contacts + self.rejected + self.invalid_contacts
    }

    fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self {
            visual_points,
            attempts,
            contacts,
            no_contacts,
            early_contacts,
            rejected,
            invalid_contacts,
            consecutive_failures,
        } = *self;
        let outcomes = [contacts, no_contacts, early_contacts, rejected, invalid_contacts];
        for count in [visual_points, attempts, consecutive_failures].into_iter().chain(outcomes) {
            fingerprint.count(count as usize);
        }
    }
}

/// All evidence of a session, sorted. Points are in the frame that the method works in.
#[derive(Clone, Debug, Default)]
pub struct Ledger {
    /// What pulls the surface, in the order of its arrival.
    pub attractors: Vec<Attractor>,
    /// What measured normals say about the surface around their touches; nothing in the paper's method.
    pub tangents: Vec<Attractor>,
    /// Where the camera stood for the first cloud that says so, in metres.
    pub viewpoint: Option<Point>,
    /// Failed attempts, in the order of their arrival.
    pub failures: Vec<Failure>,
    /// What the paths of the probe say about where the object is not.
    pub free_space: FreeSpace,
    /// How often what happened.
    pub tallies: Tallies,
}

/// What one piece of evidence meant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Entry {
    /// Whether the estimate has something new to fit.
    pub changes_estimate: bool,
    /// The uncertainty of the touch, where there was one.
    pub contact_uncertainty: Option<f64>,
    /// What the caller should know.
    pub warnings: Vec<String>,
}

impl Ledger {
    /// Enters one piece of evidence.
    ///
    /// # Errors
    /// [`Error::NoVisualPrior`] for an attempt before anything was seen.
    pub fn enter(&mut self, evidence: &Evidence, config: &Config) -> Result<Entry, Error> {
        match evidence {
            Evidence::VisualPrior(prior) => Ok(self.enter_prior(prior, config)),
            Evidence::Attempt(_) if self.tallies.visual_points == 0 => Err(Error::NoVisualPrior),
            Evidence::Attempt(attempt) => Ok(self.enter_attempt(attempt, config)),
        }
    }

    /// Adds itself to a fingerprint.
    pub(crate) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self { attractors, tangents, viewpoint, failures, free_space, tallies } = self;
        fingerprint.count(attractors.len());
        attractors.iter().chain(tangents).for_each(|attractor| attractor.fingerprint(fingerprint));
        fingerprint.points(viewpoint.as_slice());
        for Failure { point, contacts_before } in failures {
            fingerprint.vector(&point.coords);
            fingerprint.count(*contacts_before as usize);
        }
        free_space.fingerprint(fingerprint);
        tallies.fingerprint(fingerprint);
    }

    fn enter_prior(&mut self, prior: &VisualPrior, config: &Config) -> Entry {
        let uncertainty = prior.uncertainty().unwrap_or(config.visual_uncertainty);
        let seen = prior.points().iter().map(|&point| Attractor { point, uncertainty, sense: Sense::Vision });
        self.attractors.extend(seen);
        self.viewpoint = self.viewpoint.or(prior.viewpoint().copied());
        self.tallies.visual_points += prior.points().len() as u32;
        let warnings = if self.viewpoint.is_none() {
            vec!["prior.viewpoint: unknown, so the object is taken to lie evenly about the points".into()]
        } else {
            Vec::new()
        };
        Entry { changes_estimate: true, contact_uncertainty: None, warnings }
    }

    fn enter_attempt(&mut self, attempt: &Attempt, config: &Config) -> Entry {
        self.tallies.attempts += 1;
        match &attempt.outcome {
            Outcome::Contact(contact) => self.enter_contact(contact, attempt, config),
            Outcome::NoContact(sweep) => {
                self.tallies.no_contacts += 1;
                self.free_space.add_miss(sweep);
                let failure = self.enter_failure(attempt, Some(sweep.middle()));
                Entry { changes_estimate: config.method.learns_from_failures(), ..failure }
            }
            Outcome::Rejected => {
                self.tallies.rejected += 1;
                self.enter_failure(attempt, None)
            }
            Outcome::InvalidContact(base_from_sensor) => {
                self.tallies.invalid_contacts += 1;
                self.enter_failure(attempt, Some(base_from_sensor.translation.vector.into()))
            }
        }
    }

    fn enter_contact(&mut self, contact: &Contact, attempt: &Attempt, config: &Config) -> Entry {
        let uncertainty =
            contact.uncertainty().unwrap_or_else(|| contact_uncertainty(contact, config.tactile_u_max));
        let mut warnings = wrench_warnings(contact);
        let normal = usable_normal(contact, config).unwrap_or_else(|unusable| {
            warnings.push(unusable.into());
            None
        });
        let off_m = attempt.target.map_or(0.0, |target| (contact.point() - target.point()).norm());
        self.free_space.add_approach(contact, attempt.target.as_ref(), config.probe_half_travel_m);
        let is_early = off_m > config.failure_distance_m;
        if !is_early || (config.method.learns_from_failures() && config.stages.early_contacts) {
            self.attractors.push(Attractor { point: contact.point(), uncertainty, sense: Sense::Touch });
            let around = |normal| tangent::around(contact.point(), normal, uncertainty);
            self.tangents.extend(normal.into_iter().flat_map(around));
        }
        if is_early {
            self.tallies.early_contacts += 1;
            warnings.push(format!(
                "touched {:.1} mm from the candidate: counts as a failure, as more than the {:.0} mm of \
                 failure_distance_m",
                1e3 * off_m,
                1e3 * config.failure_distance_m
            ));
            self.enter_failure(attempt, None);
            return Entry {
                changes_estimate: config.method.learns_from_failures(),
                contact_uncertainty: Some(uncertainty),
                warnings,
            };
        }
        self.tallies.contacts += 1;
        self.tallies.consecutive_failures = 0;
        Entry { changes_estimate: true, contact_uncertainty: Some(uncertainty), warnings }
    }

    fn enter_failure(&mut self, attempt: &Attempt, otherwise: Option<Point>) -> Entry {
        self.tallies.consecutive_failures += 1;
        let contacts_before = self.tallies.contacts;
        let aimed_at = attempt.target.map(|target| *target.point()).or(otherwise);
        self.failures.extend(aimed_at.map(|point| Failure { point, contacts_before }));
        Entry::default()
    }
}

/// The measured normal, if there is one, or why it is ignored, in words for the caller.
fn usable_normal<'a>(contact: &'a Contact, config: &Config) -> Result<Option<&'a Direction>, &'static str> {
    let Some(normal) = contact.normal() else { return Ok(None) };
    if !config.method.uses_normals() {
        return Err("normal: recorded, but METHOD_PAPER has no use for it");
    }
    if normal.dot(&contact.approach()) > 0.0 {
        return Err("normal: ignored, as it points into the object: it must point out of the surface, \
                    against the pad's outward normal");
    }
    Ok(Some(normal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Method, Settings};
    use crate::evidence::{ContactDetail, Sweep, Target, Wrench};
    use crate::geometry::{Pose, Vector};

    fn seen() -> Ledger {
        let points = vec![
            Point::new(0.0, 0.0, 0.0),
            Point::new(0.1, 0.0, 0.0),
            Point::new(0.0, 0.1, 0.0),
            Point::new(0.1, 0.1, 0.0),
        ];
        let mut ledger = Ledger::default();
        let prior = VisualPrior::new(points, None, None).unwrap();
        ledger.enter(&Evidence::VisualPrior(prior), &paper()).unwrap();
        ledger
    }

    fn paper() -> Config {
        Config::new(Settings { method: Method::Paper, ..Settings::default() }).unwrap()
    }

    fn touch(at: Point, aimed_at: Option<Point>) -> Evidence {
        let pose = Pose::translation(at.x, at.y, at.z);
        let contact = Contact::new(pose, Wrench::default(), 0.009, ContactDetail::default()).unwrap();
        let target = aimed_at.map(|point| Target::new(point, Vector::z()).unwrap());
        Evidence::Attempt(Attempt { target, outcome: Outcome::Contact(contact) })
    }

    #[test]
    fn an_attempt_before_any_prior_is_refused_and_changes_nothing() {
        let mut ledger = Ledger::default();
        let result = ledger.enter(&touch(Point::origin(), None), &paper());
        assert_eq!(result, Err(Error::NoVisualPrior));
        assert_eq!(ledger.tallies, Tallies::default());
    }

    #[test]
    fn a_touch_far_from_its_candidate_is_a_failure_and_no_attractor() {
        let mut ledger = seen();
        let evidence = touch(Point::new(0.0, 0.0, 0.02), Some(Point::origin()));
        let entry = ledger.enter(&evidence, &paper()).unwrap();
        assert!(!entry.changes_estimate && entry.warnings.iter().any(|w| w.contains("20.0 mm")));
        assert_eq!(
            (ledger.tallies.early_contacts, ledger.tallies.failures(), ledger.attractors.len()),
            (1, 1, 4)
        );
        assert_eq!(ledger.failures[0].point, Point::origin());
    }

    #[test]
    fn a_miss_without_candidate_failed_in_the_middle_of_its_way() {
        let mut ledger = seen();
        let sweep = Sweep::new(Point::new(0.0, 0.0, 0.1), Point::new(0.0, 0.0, 0.2), 0.0).unwrap();
        let attempt = Attempt { target: None, outcome: Outcome::NoContact(sweep) };
        ledger.enter(&Evidence::Attempt(attempt), &paper()).unwrap();
        assert!((ledger.failures[0].point.z - 0.15).abs() < 1e-12);
        assert_eq!(ledger.tallies.consecutive_failures, 1);
        ledger.enter(&touch(Point::origin(), None), &paper()).unwrap();
        assert_eq!(ledger.tallies.consecutive_failures, 0);
    }

    #[test]
    fn a_normal_is_used_where_it_points_out_of_the_surface_and_the_method_has_a_use_for_it() {
        let palpate = Config::default();
        for (config, normal_z, tangents, warning) in [
            (&palpate, -1.0, 3, None),
            (&palpate, 1.0, 0, Some("into the object")),
            (&paper(), -1.0, 0, Some("METHOD_PAPER has no use for it")),
        ] {
            let mut ledger = seen();
            let detail = ContactDetail { normal: Some(Vector::z() * normal_z), ..ContactDetail::default() };
            let push = Wrench { force: Vector::new(0.0, 0.0, -2.0), torque: Vector::zeros() };
            // The pad looks and moves along z.
            let contact = Contact::new(Pose::identity(), push, 0.009, detail).unwrap();
            let attempt = Attempt { target: None, outcome: Outcome::Contact(contact) };
            let entry = ledger.enter(&Evidence::Attempt(attempt), config).unwrap();
            assert_eq!((ledger.tangents.len(), ledger.tallies.contacts), (tangents, 1));
            assert_eq!(entry.warnings.len(), usize::from(warning.is_some()), "{:?}", entry.warnings);
            assert!(warning.is_none_or(|text| entry.warnings[0].contains(text)), "{:?}", entry.warnings);
        }
    }
}
