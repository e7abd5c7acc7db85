//! The risk that an approach fails: that the surface lies too far from where it is expected.
//!
//! An approach touches early where the surface lies further out than `failure_distance_m`, and
//! misses where it lies deeper than the probe travels. Errors of a reconstruction have heavy tails,
//! where the template is wrong, so they follow Student's law.
//!
//! Its scale is fitted to what became of candidates, each with its `std_m`, by the simulator's example
//! `calibrate`; it holds for that deviation, and is fitted again when it changes.

use super::proposal::ScoreTerm;
use super::situation::Situation;
use crate::config::Config;

/// Risk above this is penalised: exploring always takes some.
const ACCEPTED_RISK: f64 = 0.15;
/// With this weight.
const RISK_WEIGHT: f64 = -2.0;

/// The law of the errors that make an approach fail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RiskLaw {
    /// The law's scale for each metre of stated deviation.
    pub scale: f64,
}

/// The term for a risk that is higher than what exploring always takes; nothing where the method
/// states no deviation.
pub(super) fn term(situation: &Situation<'_>, vertex: u32) -> Option<ScoreTerm> {
    let std_m = situation.deviations?.std_m[vertex as usize];
    let value = (RiskLaw::FITTED.of_failure(situation.config, std_m) - ACCEPTED_RISK).max(0.0);
    Some(ScoreTerm { term: "risk", weight: RISK_WEIGHT, value })
}

impl RiskLaw {
    /// The law that is in use.
    pub const FITTED: Self = Self { scale: 1.35 };

    /// The probability that an approach fails where the surface has the deviation `std_m`, in metres.
    pub fn of_failure(&self, config: &Config, std_m: f64) -> f64 {
        let scale_m = self.scale * std_m;
        let outside = beyond(config.failure_distance_m / scale_m);
        // A touch that deep would be too far from its candidate as well.
        let inside = beyond(config.probe_half_travel_m.min(config.failure_distance_m) / scale_m);
        outside + inside
    }
}

/// The probability that a variable of Student's law with four degrees of freedom exceeds `t`.
fn beyond(t: f64) -> f64 {
    let scaled = 1.0 + t * t / 4.0;
    0.5 - 0.375 * t / scaled.sqrt() * (1.0 - t * t / scaled / 12.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Settings;

    #[test]
    fn the_tail_is_that_of_student_s_law() {
        // From tables: four degrees of freedom, one-sided.
        for (t, probability) in [(0.0, 0.5), (1.533, 0.10), (2.132, 0.05), (4.604, 0.005)] {
            assert!((beyond(t) - probability).abs() < 1e-4, "{t}");
        }
    }

    #[test]
    fn risk_grows_with_the_deviation_and_with_a_shorter_approach() {
        let long = Config::default();
        let short = Config::new(Settings { probe_half_travel_m: 0.005, ..Settings::default() }).unwrap();
        let mut before = 0.0;
        for std_m in [0.001, 0.003, 0.006, 0.010] {
            let risk = RiskLaw::FITTED.of_failure(&long, std_m);
            assert!(risk > before && risk < RiskLaw::FITTED.of_failure(&short, std_m) && risk < 1.0);
            before = risk;
        }
    }
}
