//! Which touches are none: a contact in the air, one that slid or touched twice, or one reported wrongly.
//!
//! Each touch is compared with what all others expect there (leave-one-out). Its likelihood is heavy-tailed, a
//! mixture of what the process foresees and of anything within the reach of an approach:
//!
//! ```text
//! p(r) = (1 - e) N(r; 0, s²) + e / w
//! ```
//!
//! and its doubt is the share of the second, which a later touch nearby may take back.

use super::hyperparameters::{Problem, nominal_m};
use super::noise::Noise;
use super::process::{Displacement, Observation};
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
pub(super) fn found(problem: &Problem<'_>, observations: &mut [Observation]) -> Vec<Attractor> {
    let mut attractors = problem.attractors.to_vec();
    if problem.touches() < LEAST_TOUCHES {
        return attractors;
    }
    for _ in 0..ROUNDS {
        let problem = Problem { attractors: &attractors, ..*problem };
        let process = problem.with_default_noise(observations);
        let doubts = of_touches(&process, observations, &attractors);
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

/// The doubt of each attractor; none of what was seen.
fn of_touches(process: &Displacement, observations: &[Observation], attractors: &[Attractor]) -> Vec<f64> {
    let left_out = process.left_out(observations);
    let compared: Vec<Option<(f64, f64)>> = attractors
        .iter()
        .zip(observations)
        .zip(left_out)
        .map(|((attractor, observation), (residual_m, variance_m2))| {
            let noise_m = nominal_m(&Noise::default(), attractor, observation);
            (attractor.sense == Sense::Touch).then_some((residual_m, variance_m2.sqrt().hypot(noise_m)))
        })
        .collect();
    // Where half of all touches are off by more than they should, the pad is worse than expected.
    let mut ratios: Vec<f64> = compared.iter().flatten().map(|(r, std_m)| r.abs() / std_m).collect();
    ratios.sort_by(f64::total_cmp);
    let scale = (NORMAL_MEDIAN * ratios[ratios.len() / 2]).max(LEAST_SCALE);
    let doubted: f64 = attractors.iter().map(|a| a.provenance.doubt).sum();
    let false_share = (FALSE_BEFORE + doubted) / (TOUCHES_BEFORE + ratios.len() as f64);
    let doubts = compared.into_iter().zip(attractors).map(|(compared, attractor)| match compared {
        Some((residual_m, std_m)) if !is_confirmed(attractor, attractors) => {
            doubt(residual_m, (scale * std_m).max(LEAST_M), false_share)
        }
        _ => 0.0,
    });
    doubts.collect()
}

/// Whether another touch is at the same place.
fn is_confirmed(touch: &Attractor, attractors: &[Attractor]) -> bool {
    attractors.iter().any(|other| {
        other.sense == Sense::Touch
            && other.provenance.source != touch.provenance.source
            && (other.point - touch.point).norm() < CONFIRMED_M
    })
}

fn doubt(residual_m: f64, std_m: f64, false_share: f64) -> f64 {
    let foreseen = (-0.5 * (residual_m / std_m).powi(2)).exp() / (std_m * std::f64::consts::TAU.sqrt());
    // What lies deeper than foreseen was reached through space that was free.
    let share = false_share * if residual_m < 0.0 { DEEPER } else { 1.0 };
    let (believed, doubted) = ((1.0 - share) * foreseen, share / ANYWHERE_M);
    doubted / (believed + doubted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_foreseen_is_believed_and_what_is_far_off_is_doubted() {
        assert!(doubt(0.001, 0.0015, 0.01) < 0.01);
        assert!(doubt(0.008, 0.0015, 0.01) > 0.99);
        // Where little is known a large error is no surprise.
        assert!(doubt(0.008, 0.008, 0.01) < 0.05);
        // Nor is one that goes deeper as doubtful as one in the air.
        assert!(doubt(-0.006, 0.002, 0.01) < doubt(0.006, 0.002, 0.01));
    }

    #[test]
    fn doubt_grows_with_the_error_and_falls_with_what_was_unknown() {
        let errors = [0.0, 0.002, 0.004, 0.006, 0.01].map(|residual_m| doubt(residual_m, 0.002, 0.01));
        assert!(errors.windows(2).all(|pair| pair[1] > pair[0]), "{errors:?}");
        let known = [0.002, 0.004, 0.008].map(|std_m| doubt(0.01, std_m, 0.01));
        assert!(known.windows(2).all(|pair| pair[1] < pair[0]), "{known:?}");
    }
}
