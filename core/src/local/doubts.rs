//! Which measurements are none of the surface: a contact in the air, one that slid or touched twice, one reported
//! wrongly, or a pixel between an edge and what is behind it.
//!
//! Each is compared with what all others expect there (leave-one-out). Its likelihood is heavy-tailed, a
//! mixture of what the process foresees and of anything within the reach of an approach:
//!
//! ```text
//! p(r) = (1 - e) N(r; 0, s²) + e / w
//! ```
//!
//! and its doubt is the share of the second, which a later touch nearby may take back.

use super::hyperparameters::{First, Problem, nominal_m};
use super::noise::Noise;
use super::observation::Observation;
use super::process::Displacement;
use crate::evidence::DOUBTED;
use crate::evidence::attractor::{Attractor, Sense};

/// Before anything is known a false touch counts as a quarter of one among fifty.
const FALSE_BEFORE: f64 = 0.25;
const TOUCHES_BEFORE: f64 = 50.0;
/// Where a false touch may be, `w`, in metres: anywhere along an approach.
const ANYWHERE_M: f64 = 0.030;
/// What lies deeper than foreseen was reached through space that was free, and is by this factor less likely
/// to be false.
const DEEPER: f64 = 0.1;
/// Errors below this are never doubted, in metres: edges and dents that the process does not foresee.
const LEAST_M: f64 = 0.0012;
/// The deviation of a normal distribution over the median of its sizes.
const NORMAL_MEDIAN: f64 = 1.48;
/// The process is at most this much better than it states.
const LEAST_SCALE: f64 = 0.7;
/// Two touches within this of each other, in metres, confirm each other.
const CONFIRMED_M: f64 = 0.004;
/// Rounds in which what is doubted no longer speaks against the others.
const ROUNDS: usize = 4;
/// A round that changes no doubt by more is the last.
const SETTLED: f64 = 0.05;
/// Fewer touches cannot contradict each other.
const LEAST_TOUCHES: usize = 4;

/// The attractors with their doubts, found anew from those that they come with.
pub(super) fn found(
    problem: &Problem<'_>,
    first: &First,
    observations: &mut [Observation],
) -> Vec<Attractor> {
    let mut attractors = problem.attractors.to_vec();
    if problem.touches() < LEAST_TOUCHES {
        return attractors;
    }
    for _ in 0..ROUNDS {
        let problem = Problem { attractors: &attractors, ..*problem };
        let process = problem.with_default_noise(first, observations);
        let doubts = of_attractors(&process, observations, &attractors);
        let mut change = 0.0_f64;
        for (attractor, doubt) in attractors.iter_mut().zip(doubts) {
            change = change.max((attractor.provenance.doubt - doubt).abs());
            attractor.provenance.doubt = doubt;
        }
        if change < SETTLED {
            break;
        }
    }
    // What is more likely a touch than none counts in full: what is clean is not changed by a doubt.
    for attractor in &mut attractors {
        if attractor.provenance.doubt < DOUBTED {
            attractor.provenance.doubt = 0.0;
        }
    }
    attractors
}

/// The doubt of each attractor.
fn of_attractors(process: &Displacement, observations: &[Observation], attractors: &[Attractor]) -> Vec<f64> {
    let implied: Vec<Vec<usize>> =
        attractors.iter().map(|attractor| implied_by(attractor, attractors)).collect();
    let groups: Vec<Vec<usize>> =
        implied.iter().enumerate().map(|(own, implied)| [&[own], &implied[..]].concat()).collect();
    // The residual of each, and the standard deviation of what is expected there, in metres.
    let expected: Vec<(f64, f64)> = process
        .left_out(observations, &groups)
        .into_iter()
        .zip(attractors.iter().zip(observations))
        .map(|((residual_m, variance_m2), (attractor, observation))| {
            let noise_m = nominal_m(&Noise::default(), attractor, observation);
            (residual_m, variance_m2.sqrt().hypot(noise_m))
        })
        .collect();
    let senses = [Sense::Touch, Sense::Vision].map(|sense| Believed::of(sense, &expected, attractors));
    let doubt = |((residual_m, std_m), attractor): (&(f64, f64), &Attractor)| match senses
        .iter()
        .flatten()
        .find(|believed| believed.sense == attractor.sense)
    {
        Some(believed) if !is_confirmed(attractor, attractors) => believed.doubt(*residual_m, *std_m),
        _ => 0.0,
    };
    let mut doubts: Vec<f64> = expected.iter().zip(attractors).map(doubt).collect();
    // What a normal implies is as doubtful as its touch.
    for (own, implied) in implied.iter().enumerate() {
        implied.iter().for_each(|&tangent| doubts[tangent] = doubts[own]);
    }
    doubts
}

/// What the measured normal of a touch adds: it is left out together with it.
fn implied_by(touch: &Attractor, attractors: &[Attractor]) -> Vec<usize> {
    let is_implied = |other: &Attractor| {
        let is_touch = touch.sense == Sense::Touch && other.sense == Sense::Tangent;
        is_touch && other.provenance.source == touch.provenance.source
    };
    (0..attractors.len()).filter(|&other| is_implied(&attractors[other])).collect()
}

/// Whether another touch is at the same place.
fn is_confirmed(attractor: &Attractor, attractors: &[Attractor]) -> bool {
    let is_another = |other: &Attractor| {
        attractor.sense != other.sense || attractor.provenance.source != other.provenance.source
    };
    attractors.iter().any(|other| {
        other.sense == Sense::Touch
            && is_another(other)
            && (other.point - attractor.point).norm() < CONFIRMED_M
    })
}

/// What is believed of a sense.
struct Believed {
    sense: Sense,
    /// How much worse it is than expected: half of all that it measured is off by less.
    scale: f64,
    /// The share of what it measured that is no point of the surface.
    false_share: f64,
}

impl Believed {
    /// What all residuals and the deviations expected of them say of a sense; nothing of one that measured nothing.
    fn of(sense: Sense, expected: &[(f64, f64)], attractors: &[Attractor]) -> Option<Self> {
        let measured = || expected.iter().zip(attractors).filter(|(_, a)| a.sense == sense);
        let mut ratios: Vec<f64> = measured().map(|((r, std_m), _)| r.abs() / std_m).collect();
        ratios.sort_by(f64::total_cmp);
        let scale = (NORMAL_MEDIAN * ratios.get(ratios.len() / 2)?).max(LEAST_SCALE);
        let doubted: f64 = measured().map(|(_, a)| a.provenance.doubt).sum();
        let false_share = (FALSE_BEFORE + doubted) / (TOUCHES_BEFORE + ratios.len() as f64);
        Some(Self { sense, scale, false_share })
    }

    /// The probability that what was measured so far from where it was expected is no point of the surface.
    fn doubt(&self, residual_m: f64, std_m: f64) -> f64 {
        let std_m = (self.scale * std_m).max(LEAST_M);
        let foreseen = (-0.5 * (residual_m / std_m).powi(2)).exp() / (std_m * std::f64::consts::TAU.sqrt());
        // What a touch reached deeper than foreseen lies behind space that was free, and what was seen there
        // does not.
        let is_deeper = self.sense == Sense::Touch && residual_m < 0.0;
        let share = self.false_share * if is_deeper { DEEPER } else { 1.0 };
        let (believed, doubted) = ((1.0 - share) * foreseen, share / ANYWHERE_M);
        doubted / (believed + doubted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Touches of which one in a hundred is false.
    const TOUCHES: Believed = Believed { sense: Sense::Touch, scale: 1.0, false_share: 0.01 };

    fn doubt(residual_m: f64, std_m: f64) -> f64 {
        TOUCHES.doubt(residual_m, std_m)
    }

    #[test]
    fn what_is_foreseen_is_believed_and_what_is_far_off_is_doubted() {
        assert!(doubt(0.001, 0.0015) < 0.01);
        assert!(doubt(0.008, 0.0015) > 0.99);
        // Where little is known a large error is no surprise.
        assert!(doubt(0.008, 0.008) < 0.05);
        // Nor is one that goes deeper as doubtful as one in the air.
        assert!(doubt(-0.006, 0.002) < doubt(0.006, 0.002));
    }

    #[test]
    fn doubt_grows_with_the_error_and_falls_with_what_was_unknown() {
        let errors = [0.0, 0.002, 0.004, 0.006, 0.01].map(|residual_m| doubt(residual_m, 0.002));
        assert!(errors.windows(2).all(|pair| pair[1] > pair[0]), "{errors:?}");
        let known = [0.002, 0.004, 0.008].map(|std_m| doubt(0.01, std_m));
        assert!(known.windows(2).all(|pair| pair[1] < pair[0]), "{known:?}");
    }
}
