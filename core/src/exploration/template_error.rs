//! Where the template is unsure of its parameters, a touch fixes those too.
//!
//! The length of a bottle whose bottom nothing has touched is a guess, and all that lies around it
//! with it; confidence that spreads from the touches at its sides does not know that. The
//! covariance of the template's parameters does.

use super::proposal::ScoreTerm;
use super::situation::Situation;

/// Weight of the term; docs/results.md has the ablation.
const TEMPLATE_WEIGHT: f64 = 2.0;
/// The deviation that counts as a large one, in metres.
const LARGE_M: f64 = 0.002;

/// The term of a vertex, from 0 where the template is sure to 1 where it is not; nothing where the
/// method does not state it.
pub(super) fn term(situation: &Situation<'_>, vertex: u32) -> Option<ScoreTerm> {
    let deviation = situation.deviations?.template_std_m[vertex as usize] / LARGE_M;
    Some(ScoreTerm { term: "template", weight: TEMPLATE_WEIGHT, value: deviation / deviation.hypot(1.0) })
}
