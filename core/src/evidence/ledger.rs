//! The ledger: evidence sorted into what pulls the surface, what failed, and how often.

use serde::{Deserialize, Serialize};

use super::attempt::{Attempt, Contact, Moved, Outcome, Sweep, Target};
use super::attractor::contact_uncertainty;
use super::rejection::{RejectReason, Rejection};
use super::surroundings::{FAR_M, FAR_SIZES};
use super::visual_prior::VisualPrior;
use super::wrench::Wrench;
use super::{Evidence, wrench_check};
use crate::config::Config;
use crate::error::Error;
use crate::fingerprint::Fingerprint;
use crate::geometry::{Direction, Plane, Point, Pose, Vector};
use crate::warning::{Warning, WarningKind};

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

/// A cloud of visual points.
#[derive(Clone, Debug)]
pub struct View {
    /// The number of the piece of evidence, from 0.
    pub at: usize,
    /// What was seen.
    pub prior: VisualPrior,
    /// Uncertainty of its points, in [0, 1].
    pub uncertainty: f64,
}

/// A touch by a pad.
#[derive(Clone, Debug)]
pub struct Touch {
    /// The number of the piece of evidence, from 0; touches of one approach share it.
    pub at: usize,
    /// What was felt.
    pub contact: Contact,
    /// What the approach aimed at.
    pub target: Option<Target>,
    /// Its uncertainty by the pad's centre, Eq. (1), or the caller's own; in [0, 1].
    pub uncertainty: f64,
    /// Whether it pulls the surface; in the paper an early one does not.
    pub pulls: bool,
    /// The measured normal, where it can be used.
    pub normal: Option<Direction>,
}

/// A motion of the object, as it was reported or estimated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// The number of the first piece of evidence after it.
    pub since: usize,
    /// A point of the object that was at `p` is at `new_from_old * p`.
    pub new_from_old: Pose,
    /// How well it is known, as a standard deviation in metres.
    pub std_m: f64,
    /// Whether it was found in the evidence, and not reported.
    pub is_found: bool,
}

/// A straight way is suspicious where it is longer than this, in metres, and the size of what is known: no arm
/// reaches that far.
const LONG_M: f64 = 5.0;

/// All evidence of a session, sorted. Points are in the frame that the method works in.
#[derive(Clone, Debug, Default)]
pub struct Ledger {
    /// How many pieces of evidence there are.
    pub entries: usize,
    /// What was seen, in the order of its arrival.
    pub views: Vec<View>,
    /// What was touched, likewise.
    pub touches: Vec<Touch>,
    /// The paths of misses, each with the number of its piece of evidence.
    pub misses: Vec<(usize, Sweep)>,
    /// How the object moved, as the caller reported.
    pub motions: Vec<Motion>,
    /// The plane that the object stands on, where it is known.
    pub support: Option<Plane>,
    /// The direction away from it, or that of the session's z axis where it is not known.
    pub up: Vector,
    /// Failed attempts, in the order of their arrival.
    pub failures: Vec<Failure>,
    /// Candidates that were not tried, in the order of their arrival.
    pub rejections: Vec<Rejection>,
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
    pub warnings: Vec<Warning>,
}

impl Ledger {
    /// Enters one piece of evidence.
    ///
    /// # Errors
    /// [`Error::NoVisualPrior`] for an attempt before anything was seen.
    pub fn enter(&mut self, evidence: &Evidence, config: &Config) -> Result<Entry, Error> {
        let entry = match evidence {
            Evidence::VisualPrior(prior) => self.enter_prior(prior, config),
            Evidence::Attempt(_) | Evidence::Moved(_) if self.views.is_empty() => {
                return Err(Error::NoVisualPrior);
            }
            Evidence::Attempt(attempt) => self.enter_attempt(attempt, config),
            Evidence::Moved(moved) => self.enter_motion(moved),
        };
        self.entries += 1;
        Ok(entry)
    }

    /// What was told before evidence `since`.
    pub(crate) fn until(&self, since: usize) -> Self {
        self.within(&|at| at < since)
    }

    /// What was touched and swept from evidence `since` on.
    pub(crate) fn since(&self, since: usize) -> Self {
        Self { views: Vec::new(), ..self.within(&|at| at >= since) }
    }

    fn within(&self, is_within: &dyn Fn(usize) -> bool) -> Self {
        Self {
            views: self.views.iter().filter(|view| is_within(view.at)).cloned().collect(),
            touches: self.touches.iter().filter(|touch| is_within(touch.at)).cloned().collect(),
            misses: self.misses.iter().filter(|(at, _)| is_within(*at)).copied().collect(),
            ..self.clone()
        }
    }

    /// Where the camera stood for the first view that says so, in metres, with the number of that piece of
    /// evidence.
    pub(super) fn viewpoint(&self) -> Option<(usize, Point)> {
        self.views.iter().find_map(|view| Some((view.at, *view.prior.viewpoint()?)))
    }

    /// Adds itself to a fingerprint.
    pub(crate) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self { entries, views, touches, misses, motions, support, up, failures, rejections, tallies } =
            self;
        fingerprint.vector(up);
        fingerprint.count(usize::from(support.is_some()));
        if let Some(plane) = support {
            fingerprint.vector(plane.normal());
            fingerprint.number(plane.offset_m());
        }
        fingerprint.count(*entries);
        for View { at, prior, uncertainty } in views {
            fingerprint.count(*at);
            fingerprint.points(prior.points());
            fingerprint.points(prior.viewpoint().map_or(&[], std::slice::from_ref));
            fingerprint.number(*uncertainty);
        }
        for Touch { at, contact, target, uncertainty, pulls, normal } in touches {
            fingerprint.count(*at);
            fingerprint.pose(contact.base_from_sensor());
            let Wrench { force, torque } = contact.wrench();
            fingerprint.vector(force);
            fingerprint.vector(torque);
            fingerprint.points(contact.swept_from().map_or(&[], std::slice::from_ref));
            for vector in [target.map(|t| t.point().coords), normal.map(Direction::into_inner)] {
                fingerprint.count(usize::from(vector.is_some()));
                fingerprint.vector(&vector.unwrap_or_default());
            }
            fingerprint.number(*uncertainty);
            fingerprint.count(usize::from(*pulls));
        }
        for (at, sweep) in misses {
            fingerprint.count(*at);
            fingerprint.points(&[*sweep.from(), *sweep.to()]);
            fingerprint.number(sweep.radius_m());
        }
        for Motion { since, new_from_old, std_m, is_found: _ } in motions {
            fingerprint.count(*since);
            fingerprint.pose(new_from_old);
            fingerprint.number(*std_m);
        }
        for Failure { point, contacts_before } in failures {
            fingerprint.vector(&point.coords);
            fingerprint.count(*contacts_before as usize);
        }
        rejections.iter().for_each(|rejection| rejection.fingerprint(fingerprint));
        tallies.fingerprint(fingerprint);
    }

    fn enter_prior(&mut self, prior: &VisualPrior, config: &Config) -> Entry {
        let uncertainty = prior.uncertainty().unwrap_or(config.visual_uncertainty);
        self.views.push(View { at: self.entries, prior: prior.clone(), uncertainty });
        self.tallies.visual_points += prior.points().len() as u32;
        let warnings = if self.viewpoint().is_none() {
            vec![Warning::new(
                WarningKind::NoViewpoint,
                "prior.viewpoint: unknown, so the object is taken to lie evenly about the points",
            )]
        } else {
            Vec::new()
        };
        Entry { changes_estimate: true, contact_uncertainty: None, warnings }
    }

    fn enter_motion(&mut self, moved: &Moved) -> Entry {
        let (new_from_old, std_m) = (*moved.new_from_old(), moved.std_m());
        self.motions.push(Motion { since: self.entries, new_from_old, std_m, is_found: false });
        for failure in &mut self.failures {
            failure.point = new_from_old * failure.point;
        }
        for rejection in &mut self.rejections {
            rejection.point = new_from_old * rejection.point;
        }
        Entry { changes_estimate: true, ..Entry::default() }
    }

    fn enter_attempt(&mut self, attempt: &Attempt, config: &Config) -> Entry {
        self.tallies.attempts += 1;
        match &attempt.outcome {
            Outcome::Contact(contact) => self.enter_contact(contact, &[], attempt, config),
            Outcome::Contacts { aimed, others } => self.enter_contact(aimed, others, attempt, config),
            Outcome::NoContact(sweep) => {
                self.tallies.no_contacts += 1;
                self.misses.push((self.entries, *sweep));
                let failure = self.enter_failure(attempt, Some(sweep.middle()));
                let warnings = self.long_way("no_contact", sweep.from(), sweep.to()).into_iter().collect();
                Entry { changes_estimate: config.method.learns_from_failures(), warnings, ..failure }
            }
            Outcome::Rejected(reason) => {
                self.tallies.rejected += 1;
                self.tallies.consecutive_failures += 1;
                self.leave_alone(attempt.target, *reason);
                Entry::default()
            }
            Outcome::InvalidContact(base_from_sensor) => {
                self.tallies.invalid_contacts += 1;
                if config.method.learns_from_failures() {
                    // What the housing met is in the way of its neighbours, too: they fail as it did.
                    self.leave_alone(attempt.target, RejectReason::Collision);
                }
                self.enter_failure(attempt, Some(base_from_sensor.translation.vector.into()))
            }
        }
    }

    /// Proposes nothing around a candidate for as long as `reason` holds.
    fn leave_alone(&mut self, target: Option<Target>, reason: RejectReason) {
        let attempts = self.tallies.attempts;
        self.rejections.extend(target.map(|target| Rejection { point: *target.point(), reason, attempts }));
    }

    /// Contacts of one attempt; `aimed` decides whether it came early, for all of them.
    fn enter_contact(
        &mut self,
        aimed: &Contact,
        others: &[Contact],
        attempt: &Attempt,
        config: &Config,
    ) -> Entry {
        // The pad's centre travels along the approach, whatever point of the pad touches.
        let off_m = attempt.target.map_or(0.0, |target| (aimed.point() - target.point()).norm());
        let is_early = off_m > config.failure_distance_m;
        let pulls = !is_early || (config.method.learns_from_failures() && config.stages.early_contacts);
        let mut warnings = Vec::new();
        let uncertainty = self.enter_touch(aimed, attempt.target, pulls, config, &mut warnings);
        for other in others {
            self.enter_touch(other, None, pulls, config, &mut warnings);
        }
        if is_early {
            self.tallies.early_contacts += 1;
            let message = format!(
                "touched {:.1} mm from the candidate: counts as a failure, as more than the {:.0} mm of \
                 failure_distance_m",
                1e3 * off_m,
                1e3 * config.failure_distance_m
            );
            warnings.push(Warning::new(WarningKind::EarlyContact, message).with("distance_m", off_m));
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

    /// One pad's touch, on its way to `target`, and what is odd about it. Gives its uncertainty.
    fn enter_touch(
        &mut self,
        contact: &Contact,
        target: Option<Target>,
        pulls: bool,
        config: &Config,
        warnings: &mut Vec<Warning>,
    ) -> f64 {
        let uncertainty =
            contact.uncertainty().unwrap_or_else(|| contact_uncertainty(contact, config.tactile_u_max));
        warnings.extend(wrench_check::warnings(contact, target.as_ref()));
        let normal = usable_normal(contact, config).unwrap_or_else(|unusable| {
            warnings.push(Warning::new(WarningKind::NormalIgnored, unusable));
            None
        });
        let is_far = self.beyond_m(&contact.point()) > 0.0;
        if is_far {
            let distance_m = self.distance_m(&contact.point());
            let message = format!(
                "sensor_pose: the contact is {distance_m:.2} m from all that is known of the object, and is not used: is \
                 it in metres, in the session's frame, and of the pad and not of the flange?"
            );
            warnings.push(Warning::new(WarningKind::FarContact, message).with("distance_m", distance_m));
        } else if let Some(from) = contact.swept_from() {
            warnings.extend(self.long_way("swept_from", from, &contact.point()));
        }
        let pulls = pulls && !is_far;
        // Nor did it come before the planned start of its approach, which would then lie inside.
        let target = target.filter(|_| !is_far);
        let (at, normal) = (self.entries, normal.copied());
        self.touches.push(Touch { at, contact: contact.clone(), target, uncertainty, pulls, normal });
        let contacts: Vec<&Contact> = self.touches.iter().map(|touch| &touch.contact).collect();
        warnings.extend(wrench_check::drift(&contacts));
        uncertainty
    }

    /// The distance of a place from the nearest point that was seen or touched, in metres.
    fn distance_m(&self, place: &Point) -> f64 {
        let distances = self.known_points().map(|point| (point - place).norm());
        distances.fold(f64::INFINITY, f64::min)
    }

    /// How much farther off a place is than any part of the object may be, in metres: a few times the size of
    /// what is known.
    fn beyond_m(&self, place: &Point) -> f64 {
        self.distance_m(place) - (FAR_SIZES * self.size_m() + FAR_M)
    }

    /// The farthest that a known point lies from the first one, in metres.
    fn size_m(&self) -> f64 {
        let Some(first) = self.known_points().next() else { return 0.0 };
        self.known_points().map(|point| (point - first).norm()).fold(0.0, f64::max)
    }

    /// A warning of a way that is longer than an arm can reach, whose field is named.
    fn long_way(&self, field: &str, from: &Point, to: &Point) -> Option<Warning> {
        let length_m = (to - from).norm();
        let is_long = length_m > LONG_M && length_m > LONG_M + self.size_m();
        is_long.then(|| {
            let message = format!(
                "{field}: the way of the probe is {length_m:.1} m long, and only what is near the object counts: is it \
                 in metres, and in the session's frame?"
            );
            Warning::new(WarningKind::LongSweep, message).with("length_m", length_m)
        })
    }

    fn known_points(&self) -> impl Iterator<Item = Point> {
        let seen = self.views.iter().flat_map(|view| view.prior.points().iter().copied());
        let touched = self.touches.iter().filter(|touch| touch.pulls).map(|touch| touch.contact.point());
        seen.chain(touched)
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
fn usable_normal<'a>(contact: &'a Contact, config: &Config) -> Result<Option<&'a Direction>, String> {
    let Some(normal) = contact.normal() else { return Ok(None) };
    if !config.method.uses_normals() {
        return Err(format!("normal: recorded, but {} has no use for it", config.method.name()));
    }
    if normal.dot(&contact.approach()) > 0.0 {
        return Err("normal: ignored, as it points into the object: it must point out of the surface, \
                    against the pad's outward normal"
            .to_owned());
    }
    Ok(Some(normal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Method, Settings};
    use crate::evidence::{ContactDetail, Pad};
    use crate::geometry::Vector;

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
        let contact =
            Contact::new(pose, Wrench::default(), Pad::new(0.009).unwrap(), ContactDetail::default())
                .unwrap();
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
        assert!(!entry.changes_estimate && entry.warnings.iter().any(|w| w.message.contains("20.0 mm")));
        assert_eq!(
            (ledger.tallies.early_contacts, ledger.tallies.failures(), ledger.touches[0].pulls),
            (1, 1, false)
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
        for (config, normal_z, normals, warning) in [
            (&palpate, -1.0, 1, None),
            (&palpate, 1.0, 0, Some("into the object")),
            (&paper(), -1.0, 0, Some("METHOD_PAPER has no use for it")),
        ] {
            let mut ledger = seen();
            let detail = ContactDetail { normal: Some(Vector::z() * normal_z), ..ContactDetail::default() };
            let push = Wrench { force: Vector::new(0.0, 0.0, -2.0), torque: Vector::zeros() };
            // The pad looks and moves along z.
            let contact = Contact::new(Pose::identity(), push, Pad::new(0.009).unwrap(), detail).unwrap();
            let attempt = Attempt { target: None, outcome: Outcome::Contact(contact) };
            let entry = ledger.enter(&Evidence::Attempt(attempt), config).unwrap();
            assert_eq!(
                (usize::from(ledger.touches[0].normal.is_some()), ledger.tallies.contacts),
                (normals, 1)
            );
            assert_eq!(entry.warnings.len(), usize::from(warning.is_some()), "{:?}", entry.warnings);
            assert!(
                warning.is_none_or(|text| entry.warnings[0].message.contains(text)),
                "{:?}",
                entry.warnings
            );
        }
    }
}
