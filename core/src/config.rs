//! The parameters of the method: every number that the paper leaves to the experimenter.

use std::ops::Deref;

use crate::error::FieldError;
use crate::geometry::{MAX_SUBDIVISIONS, Plane};
pub use crate::method::Method;

/// A symmetry of the object that the caller vouches for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeclaredSymmetry {
    /// A body of revolution, about an axis that the method finds.
    Revolution,
    /// The same on both sides of a plane that the method finds.
    Mirror,
}

/// The directions of the axes of METHOD_PAPER's template.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axes {
    /// Those of the session's frame, as the printed formula has it: for objects that stand upright in it.
    #[default]
    Frame,
    /// Fitted too: for objects that stand askew.
    Free,
}

/// How the next contact is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strategy {
    /// Cautious, depth first, from the frontier of what is known (Section III-G, Eq. (3)).
    #[default]
    Proactive,
    /// The vertex of highest uncertainty: the paper's baseline, minU.
    MinUncertainty,
    /// Directions spread evenly over the sphere before the first touch.
    Uniform,
    /// Any point of the surface, by area.
    Random,
    /// The touch that is expected to teach the most, if it meets anything. Needs a method that
    /// states deviations: [`Method::Palpate`].
    ExpectedGain,
}

impl Method {
    /// The strategy of a session that asks for none.
    pub fn own_strategy(self) -> Strategy {
        match self {
            Self::Paper | Self::Palpate => Strategy::Proactive,
            Self::Gpis => Strategy::MinUncertainty,
        }
    }

    /// The stop rule of a session that asks for none. What METHOD_GPIS calls uncertainty falls everywhere
    /// with every touch, so it says nothing of coverage.
    pub fn own_stop_rule(self) -> StopRule {
        match self {
            Self::Paper | Self::Palpate => StopRule::default(),
            Self::Gpis => StopRule { mean_uncertainty_below: None, ..StopRule::default() },
        }
    }
}

impl Strategy {
    /// Whether it scores vertices by weighted terms and avoids what has failed; the others are
    /// what such strategies are compared with.
    pub fn weighs_terms(self) -> bool {
        matches!(self, Self::Proactive | Self::ExpectedGain)
    }
}

/// Which ideas of [`Method::Palpate`] are in use: all, but in an ablation.
///
/// A setting for measurements only: a session on a server always has them all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stages {
    /// A template of one part may become a cylinder, a prism or a box; otherwise the template is
    /// always an ellipsoid, and has no more parts.
    pub superquadrics: bool,
    /// Fresh starts of the template include a slab behind the patch.
    pub slab: bool,
    /// Fresh starts of the template include shapes that just hold what was measured, and it costs a template to
    /// reach beyond that.
    pub extent: bool,
    /// The template may have more than one part.
    pub parts: bool,
    /// A part may be a limb, held on an axis of its host; otherwise all are free.
    pub limbs: bool,
    /// What was swept freely lies outside the template and the surface, and the planned start of an
    /// approach that touched before it lies inside.
    pub free_space: bool,
    /// A pad touches where its force acts, and the face of one that touches beside its centre was free.
    pub pressure: bool,
    /// Touches that contradict what else is known are doubted.
    pub doubts: bool,
    /// What was seen may be off as a whole.
    pub offsets: bool,
    /// The object may have moved.
    pub motion: bool,
    /// A touch that came early pulls the surface like any other.
    pub early_contacts: bool,
    /// A visual point that is kept is the mean of those around it.
    pub visual_means: bool,
    /// The noise of camera and pad is estimated; otherwise it is what is expected of them.
    pub noise: bool,
    /// A symmetry is taken where the evidence shows it; one that the caller vouches for always is.
    pub symmetry: bool,
    /// Places that a symmetry of revolution makes like known ones are less uncertain, so that
    /// others are touched first.
    pub symmetry_first: bool,
    /// Places around a failure are less attractive, after their taboo too.
    pub failure_penalty: bool,
    /// Places where the template is uncertain are more attractive.
    pub template_error: bool,
    /// Places where a touch is likely to fail are less attractive.
    pub risk: bool,
}

impl Default for Stages {
    fn default() -> Self {
        Self {
            superquadrics: true,
            slab: true,
            extent: true,
            parts: true,
            limbs: true,
            free_space: true,
            pressure: true,
            doubts: true,
            offsets: true,
            motion: true,
            early_contacts: true,
            visual_means: true,
            noise: true,
            symmetry: true,
            symmetry_first: true,
            failure_penalty: true,
            template_error: true,
            risk: true,
        }
    }
}

/// Attempts of a session where no budget is configured: as many as the paper's explorations take.
pub const ATTEMPTS: u32 = 50;
/// Mean uncertainty below which an object counts as covered where no rule is configured: at 20 mm for
/// each touch a small object is known to a fraction of a millimetre by then.
const COVERED_BELOW: f64 = 0.25;

/// When a session should end; a rule that is `None` never ends it, but for failures in a row. It is
/// advice, and changes no estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopRule {
    /// Attempts, failures included; the uniform strategy spreads its directions over them.
    pub max_attempts: Option<u32>,
    /// Mean vertex uncertainty in [0, 1] below which the object counts as covered.
    pub mean_uncertainty_below: Option<f64>,
    /// Failures in a row after which the exploration counts as stalled; `None` for the method's own:
    /// 50 in [`Method::Palpate`], never in the others.
    pub max_consecutive_failures: Option<u32>,
}

impl Default for StopRule {
    fn default() -> Self {
        Self {
            max_attempts: Some(ATTEMPTS),
            mean_uncertainty_below: Some(COVERED_BELOW),
            max_consecutive_failures: None,
        }
    }
}

/// Parameters as a caller writes them; [`Config::new`] checks them.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Which reading of the method reconstructs.
    pub method: Method,
    /// How the next contact is chosen.
    pub strategy: Strategy,
    /// Weight of the mean geodesic distance, `a_G` of Eq. (3).
    pub alpha_geodesic: f64,
    /// Weight of the vertex uncertainty, `a_U` of Eq. (3); `None` for the method's own: 2 in
    /// METHOD_PALPATE, 1 in the others.
    pub alpha_uncertainty: Option<f64>,
    /// Weight of the path from the tool to where an approach starts, as a share of the object's size.
    pub alpha_travel: f64,
    /// A vertex at or below this uncertainty is confident, `u'_max` of Eq. (3).
    pub confident_max: f64,
    /// A candidate has at least this uncertainty, `u'_min` of Eq. (3).
    pub candidate_min: f64,
    /// Uncertainty of a visual attractor (Section IV-C).
    pub visual_uncertainty: f64,
    /// Uncertainty of a contact at the rim of the pad, `u_max` of Eq. (1).
    pub tactile_u_max: f64,
    /// How far an attractor's uncertainty spreads, in edges of the mesh with 2562 vertices.
    pub propagation_hops: u32,
    /// Length over which confidence halves, in metres; the paper does not give it.
    pub propagation_length_m: f64,
    /// The probe travels from this far outside the estimate to this far inside, in metres: `d`.
    pub probe_half_travel_m: f64,
    /// A touch further than this from its candidate counts as a failure, in metres (Section IV-B).
    pub failure_distance_m: f64,
    /// Subdivisions of the icosahedron: 4 gives 2562 vertices.
    pub icosphere_subdivisions: u32,
    /// Seed of everything random: ties, the uniform and the random strategy.
    pub seed: u64,
    /// When to stop.
    pub stop: StopRule,
    /// A symmetry that the caller vouches for; only [`Method::Palpate`] has a use for one.
    pub symmetry: Option<DeclaredSymmetry>,
    /// Whether the axes of [`Method::Paper`]'s template may turn.
    pub template_axes: Axes,
    /// The plane that the object stands on, with its normal towards the object, in the session's frame.
    pub support: Option<Plane>,
    /// Whether [`Method::Palpate`] takes earlier evidence along where the object was found to have moved;
    /// otherwise it says so and advises to stop.
    pub follows_motion: bool,
    /// Which ideas of [`Method::Palpate`] are in use; the others have none of them.
    pub stages: Stages,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::default(),
            strategy: Strategy::Proactive,
            alpha_geodesic: 1.0,
            alpha_uncertainty: None,
            alpha_travel: 0.0,
            confident_max: 0.6,
            candidate_min: 0.5,
            visual_uncertainty: 0.4,
            tactile_u_max: 0.2,
            propagation_hops: 5,
            propagation_length_m: 0.020,
            probe_half_travel_m: 0.015,
            failure_distance_m: 0.015,
            icosphere_subdivisions: 4,
            seed: 0,
            stop: StopRule::default(),
            symmetry: None,
            template_axes: Axes::Frame,
            support: None,
            follows_motion: true,
            stages: Stages::default(),
        }
    }
}

/// Parameters that have been checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    settings: Settings,
    alpha_uncertainty: f64,
}

impl Config {
    /// The same with another strategy, which need not weigh what the session's own weighs.
    ///
    /// # Errors
    /// The method refuses the strategy.
    pub fn with_strategy(&self, strategy: Strategy) -> Result<Self, FieldError> {
        let alpha_travel = if strategy.weighs_terms() { self.alpha_travel } else { 0.0 };
        Self::new(Settings { strategy, alpha_travel, ..**self })
    }

    /// Checks every parameter against its range.
    ///
    /// # Errors
    /// The first field that is out of its range, with the range.
    pub fn new(settings: Settings) -> Result<Self, FieldError> {
        let unit = 0.0..=1.0;
        let length = 1e-4..=1.0;
        let weight = 0.0..=1e3;
        for (field, value, range) in [
            ("alpha_geodesic", settings.alpha_geodesic, &weight),
            ("alpha_uncertainty", settings.alpha_uncertainty.unwrap_or(1.0), &weight),
            ("alpha_travel", settings.alpha_travel, &weight),
            ("confident_max", settings.confident_max, &unit),
            ("candidate_min", settings.candidate_min, &unit),
            ("visual_uncertainty", settings.visual_uncertainty, &unit),
            ("tactile_u_max", settings.tactile_u_max, &unit),
            ("propagation_length_m", settings.propagation_length_m, &length),
            ("probe_half_travel_m", settings.probe_half_travel_m, &length),
            ("failure_distance_m", settings.failure_distance_m, &length),
            ("stop.mean_uncertainty_below", settings.stop.mean_uncertainty_below.unwrap_or(0.0), &unit),
        ] {
            if !range.contains(&value) {
                let (low, high) = (range.start(), range.end());
                let reason = format!("{value} is not between {low} and {high}");
                return Err(FieldError { field, reason, non_finite: !value.is_finite() });
            }
        }
        if !(1..=50).contains(&settings.propagation_hops) {
            return Err(FieldError::invalid("propagation_hops", "must be between 1 and 50 edges"));
        }
        let subdivisions = settings.icosphere_subdivisions;
        if !(2..MAX_SUBDIVISIONS as u32).contains(&subdivisions) {
            let reason = format!("{subdivisions} is not between 2 (162 vertices) and 5 (10,242 vertices)");
            return Err(FieldError::invalid("icosphere_subdivisions", reason));
        }
        let method = settings.method;
        if !method.uses_symmetry() && settings.symmetry.is_some() {
            let reason = format!("{} has no use for it: leave it unspecified", method.name());
            return Err(FieldError::invalid("symmetry", reason));
        }
        if !method.has_choice_of_axes() && settings.template_axes != Axes::default() {
            let reason = format!("{} turns its axes always: leave it unspecified", method.name());
            return Err(FieldError::invalid("template_axes", reason));
        }
        if !method.has_stages() && settings.stages != Stages::default() {
            let reason = format!("{} has none of them: leave all of them on", method.name());
            return Err(FieldError::invalid("stages", reason));
        }
        if !method.states_deviations() && settings.strategy == Strategy::ExpectedGain {
            let reason = format!(
                "{} states no deviation that a gain could be expected of: \
                 take METHOD_PALPATE, or STRATEGY_PROACTIVE",
                method.name()
            );
            return Err(FieldError::invalid("strategy", reason));
        }
        if settings.alpha_travel > 0.0 && !settings.strategy.weighs_terms() {
            let reason = "a baseline does not look at the path: set it to 0, \
                          or take STRATEGY_PROACTIVE or STRATEGY_EXPECTED_GAIN";
            return Err(FieldError::invalid("alpha_travel", reason));
        }
        Ok(Self::of(settings))
    }

    /// Settings within their ranges, with the weight that is the method's own where none is set.
    fn of(mut settings: Settings) -> Self {
        let own = settings.method.own_alpha_uncertainty();
        let alpha_uncertainty = *settings.alpha_uncertainty.get_or_insert(own);
        Self { settings, alpha_uncertainty }
    }

    /// Weight of the vertex uncertainty, `a_U` of Eq. (3).
    pub fn alpha_uncertainty(&self) -> f64 {
        self.alpha_uncertainty
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::of(Settings::default())
    }
}

impl Deref for Config {
    type Target = Settings;

    fn deref(&self) -> &Settings {
        &self.settings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid() {
        assert!(Config::new(Settings::default()).is_ok());
    }

    #[test]
    fn a_weight_that_is_not_set_is_the_method_s_own() {
        let weight = |method, alpha_uncertainty| {
            let settings = Settings { method, alpha_uncertainty, ..Settings::default() };
            Config::new(settings).unwrap().alpha_uncertainty()
        };
        assert_eq!((weight(Method::Paper, None), weight(Method::Palpate, None)), (1.0, 2.0));
        assert_eq!((weight(Method::Paper, Some(3.0)), weight(Method::Palpate, Some(0.0))), (3.0, 0.0));
        assert_eq!(Config::default(), Config::new(Settings::default()).unwrap());
    }

    #[test]
    fn a_value_out_of_range_is_named_with_its_range() {
        let error = Config::new(Settings { confident_max: 1.5, ..Settings::default() }).unwrap_err();
        assert_eq!(error.to_string(), "confident_max: 1.5 is not between 0 and 1");
    }

    #[test]
    fn what_would_be_ignored_is_refused() {
        let field = |settings| Config::new(settings).map_err(|error| error.field).err();
        let paper = Settings { method: Method::Paper, ..Settings::default() };
        assert_eq!(field(Settings { strategy: Strategy::ExpectedGain, ..paper.clone() }), Some("strategy"));
        assert_eq!(
            field(Settings { symmetry: Some(DeclaredSymmetry::Mirror), ..paper.clone() }),
            Some("symmetry")
        );
        let stages = Stages { parts: false, ..Stages::default() };
        assert_eq!(field(Settings { stages, ..paper.clone() }), Some("stages"));
        assert_eq!(field(Settings { alpha_travel: 0.5, ..paper.clone() }), None);
        assert_eq!(field(Settings { template_axes: Axes::Free, ..paper }), None);
        assert_eq!(
            field(Settings { template_axes: Axes::Free, ..Settings::default() }),
            Some("template_axes")
        );
        for strategy in [Strategy::MinUncertainty, Strategy::Uniform, Strategy::Random] {
            let baseline = Settings { strategy, ..Settings::default() };
            assert_eq!(field(Settings { alpha_travel: 0.5, ..baseline.clone() }), Some("alpha_travel"));
            assert_eq!(field(baseline), None);
        }
    }

    #[test]
    fn nan_is_refused() {
        let settings = Settings { propagation_length_m: f64::NAN, ..Settings::default() };
        let error = Config::new(settings).unwrap_err();
        assert_eq!((error.field, error.non_finite), ("propagation_length_m", true));
    }
}
