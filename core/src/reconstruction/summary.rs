//! A session in a few numbers, whether it should go on, and its fingerprint.

use super::{Detail, Estimate, GpisDetail, PalpateDetail, PaperDetail, Reconstruction, Surface};
use crate::fingerprint::Fingerprint;

/// A session in a few numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Points seen.
    pub visual_points: u32,
    /// Touches by the pad near their candidate, or without one; `attempts` are these and the `failures`.
    pub contacts: u32,
    /// Approaches that touched nothing.
    pub no_contacts: u32,
    /// Approaches that the robot refused.
    pub rejected: u32,
    /// Touches too far from their candidate.
    pub early_contacts: u32,
    /// Touches by something other than the pad.
    pub invalid_contacts: u32,
    /// All attempts that did not succeed.
    pub failures: u32,
    /// All approaches.
    pub attempts: u32,
    /// Failures since the last success.
    pub consecutive_failures: u32,
    /// Mean over the vertices, in [0, 1]; 1 before the first visual prior.
    pub mean_uncertainty: f64,
    /// Maximum over the vertices, in [0, 1]; 1 before the first visual prior.
    pub max_uncertainty: f64,
    /// Root mean square distance of what was fitted, touches and (in METHOD_PALPATE thinned) visual
    /// points, to the estimated surface, along the normals of the template, in metres.
    pub fit_rms_m: f64,
    /// The template's family; empty before the first visual prior.
    pub template: &'static str,
    /// Mean stated standard deviation of the surface over the vertices, in metres; nothing where it is not stated.
    pub mean_std_m: Option<f64>,
    /// The greatest of them, in metres.
    pub max_std_m: Option<f64>,
}

/// Why a session should stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The mean uncertainty has fallen to what was asked for.
    Coverage,
    /// All attempts are used.
    Budget,
    /// Nothing is left that may be touched.
    NoAdmissibleCandidate,
    /// Too many failures in a row.
    Stalled,
    /// The template has grown without bound: the points do not look like one object.
    Diverged,
    /// The object seems to have moved, and the session does not follow it.
    Moved,
}

impl Reconstruction {
    /// The session in a few numbers.
    pub fn stats(&self) -> Stats {
        let tallies = &self.ledger().tallies;
        let estimate = self.last_estimate();
        let uncertainty = estimate.map_or(&[1.0][..], |estimate| &estimate.surface.uncertainty);
        let deviations = estimate.and_then(|estimate| estimate.surface.std_m.as_deref());
        Stats {
            visual_points: tallies.visual_points,
            contacts: tallies.contacts,
            no_contacts: tallies.no_contacts,
            rejected: tallies.rejected,
            early_contacts: tallies.early_contacts,
            invalid_contacts: tallies.invalid_contacts,
            failures: tallies.failures(),
            attempts: tallies.attempts,
            consecutive_failures: tallies.consecutive_failures,
            mean_uncertainty: uncertainty.iter().sum::<f64>() / uncertainty.len() as f64,
            max_uncertainty: uncertainty.iter().copied().fold(0.0, f64::max),
            fit_rms_m: estimate.map_or(0.0, Estimate::residual_m),
            template: estimate.map_or("", |estimate| estimate.template_family()),
            mean_std_m: deviations.map(|stds| stds.iter().sum::<f64>() / stds.len() as f64),
            max_std_m: deviations.map(|stds| stds.iter().copied().fold(0.0, f64::max)),
        }
    }

    /// Whether the exploration should stop, and why; `None` to go on.
    pub fn stop_reason(&self) -> Option<StopReason> {
        let stats = self.stats();
        let rule = &self.config().stop;
        let most_failures = rule.max_consecutive_failures.or(self.config().method.own_stall_limit());
        let estimate = self.last_estimate()?;
        if estimate.has_diverged() {
            Some(StopReason::Diverged)
        } else if self.findings().motion.is_some_and(|motion| !motion.is_followed) {
            Some(StopReason::Moved)
        } else if rule.mean_uncertainty_below.is_some_and(|below| stats.mean_uncertainty < below) {
            Some(StopReason::Coverage)
        } else if most_failures.is_some_and(|most| stats.consecutive_failures >= most) {
            Some(StopReason::Stalled)
        } else if rule.max_attempts.is_some_and(|most| stats.attempts >= most) {
            Some(StopReason::Budget)
        } else if self.is_exhausted() {
            Some(StopReason::NoAdmissibleCandidate)
        } else {
            None
        }
    }

    /// What it takes in memory, in bytes, by its largest parts: points, each in the ledger and in the evidence, and the
    /// arrays of the estimate.
    pub fn bytes(&self) -> usize {
        const POINT: usize = 2 * 24;
        const ATTEMPT: usize = 2 * 512;
        let evidence = POINT * self.ledger.tallies.visual_points as usize + ATTEMPT * self.ledger.entries;
        evidence + self.last_estimate().map_or(0, Estimate::bytes)
    }

    /// A fingerprint of all that the next step rests on: equal evidence gives equal fingerprints.
    pub fn digest(&self) -> [u8; 32] {
        let mut fingerprint = Fingerprint::default();
        self.frame.fingerprint(&mut fingerprint);
        self.ledger.fingerprint(&mut fingerprint);
        if let Some(estimate) = &self.estimate {
            estimate.fingerprint(&mut fingerprint);
        }
        fingerprint.finish()
    }
}

impl Estimate {
    fn bytes(&self) -> usize {
        /// Place, normal, uncertainty and deviation.
        const VERTEX: usize = 64;
        const FACE: usize = 12;
        let mesh = &self.surface.mesh;
        let detail = match &self.detail {
            Detail::Paper(_) | Detail::Gpis(_) => 0,
            Detail::Palpate(detail) => detail.raised.bytes(),
        };
        VERTEX * mesh.vertices.len() + FACE * mesh.faces.len() + detail
    }

    fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        // Normals and connectivity follow from the mesh, and the reach from the configuration.
        let Self {
            surface: Surface { mesh, uncertainty, std_m },
            normals: _,
            connectivity: _,
            reach: _,
            detail,
            began_with: _,
        } = self;
        fingerprint.points(&mesh.vertices);
        fingerprint.numbers(uncertainty);
        fingerprint.numbers(std_m.as_deref().unwrap_or_default());
        match detail {
            Detail::Paper(PaperDetail { template, residual_m }) => {
                template.shape.fingerprint(fingerprint);
                fingerprint.number(*residual_m);
            }
            Detail::Gpis(GpisDetail { centre, residual_m }) => {
                // Faces are made anew with every mesh.
                mesh.faces.iter().flatten().for_each(|vertex| fingerprint.count(*vertex as usize));
                fingerprint.vector(&centre.coords);
                fingerprint.number(*residual_m);
            }
            Detail::Palpate(detail) => {
                let PalpateDetail { number, reading, template, template_std_m, raised } = &**detail;
                fingerprint.count(*number);
                reading.fingerprint(fingerprint);
                template.fingerprint(fingerprint);
                fingerprint.numbers(template_std_m);
                raised.hyperparameters.fingerprint(fingerprint);
                fingerprint.number(raised.residual_m);
            }
        }
    }
}
