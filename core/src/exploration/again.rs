//! The same approach again, where a touch is doubted: it is met once more or swept through, and either
//! settles the matter for the price of one attempt.

use super::proposal::{Candidate, ProposalRequest};
use super::risk::RiskLaw;
use super::situation::{DoubtedTouch, Situation};
use crate::geometry::{Direction, Point};
use crate::uncertainty::nearest_vertex;

/// The expected surface is at most this much deeper than the touch, in lengths of the probe's half travel:
/// the window of the new approach holds both.
const DEEPEST: f64 = 1.6;

/// The approaches that are to be repeated, the most doubted touch first.
pub(super) fn candidates(situation: &Situation<'_>, request: &ProposalRequest) -> Vec<Candidate> {
    if !situation.config.strategy.weighs_terms() {
        return Vec::new();
    }
    let mut open: Vec<&DoubtedTouch> = situation.doubted.iter().filter(|touch| !touch.is_settled).collect();
    open.sort_by(|a, b| b.doubt.total_cmp(&a.doubt));
    open.into_iter().filter_map(|touch| candidate(situation, request, touch)).collect()
}

fn candidate(
    situation: &Situation<'_>,
    request: &ProposalRequest,
    touch: &DoubtedTouch,
) -> Option<Candidate> {
    let travel_m = situation.config.probe_half_travel_m;
    let vertices = &situation.mesh.vertices;
    let below = nearest_vertex(vertices, &touch.point)?;
    let depth_m = (vertices[below as usize] - touch.point).dot(&touch.approach);
    let point: Point =
        touch.point + touch.approach.into_inner() * (0.5 * depth_m.clamp(0.0, DEEPEST * travel_m));
    let normal: Direction = -touch.approach;
    let (probe_start, probe_end) =
        (point + normal.into_inner() * travel_m, point - normal.into_inner() * travel_m);
    if super::is_forbidden(situation, request, &point, &normal, (&probe_start, &probe_end)) {
        return None;
    }
    let vertex = nearest_vertex(vertices, &point)?;
    let std_m = situation.deviations.map(|deviations| deviations.std_m[vertex as usize]);
    Some(Candidate {
        vertex,
        point,
        normal,
        probe_start,
        probe_end,
        approach: request.approach(&probe_start, &normal),
        score: 0.0,
        terms: Vec::new(),
        uncertainty: situation.uncertainty[vertex as usize],
        std_m,
        mean_geodesic_m: 0.0,
        failure_risk: std_m.map(|std_m| RiskLaw::FITTED.of_failure(situation.config, std_m)),
        relaxed: false,
        why: format!(
            "the touch here is doubted ({:.0} %), as it contradicts what is known around it: the same approach again \
             settles it",
            100.0 * touch.doubt
        ),
    })
}
