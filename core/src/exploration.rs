//! Exploration: where to touch next (Section III-G).
//!
//! Takes a [`Situation`] and a [`ProposalRequest`]; gives candidates, the best first. A strategy
//! ranks the vertices of the estimate; what is forbidden is left out, and the best few that lie
//! apart from each other become candidates. A proposal is a pure function of the state.

mod baselines;
mod expected_gain;
mod failures;
mod keep_out;
mod proactive;
mod proposal;
mod ranking;
mod risk;
mod rng;
mod situation;
mod template_error;
mod travel;

pub use keep_out::{KeepOut, Region};
pub use proposal::{Candidate, Excluded, Proposal, ProposalRequest, ScoreTerm};
pub use risk::RiskLaw;
pub use situation::{Deviations, Situation};

use self::ranking::{Ranked, Ranking};
use self::travel::Travel;
use crate::config::Strategy;

/// Candidates of one proposal lie at least this far apart, in metres: a second one within it
/// would be no alternative.
const SEPARATION_M: f64 = 0.010;

/// Proposes the next contacts.
pub fn propose(situation: &Situation<'_>, request: &ProposalRequest) -> Proposal {
    let mut excluded = Excluded::default();
    let reachable: Vec<u32> = (0..situation.mesh.vertices.len() as u32)
        .filter(|&vertex| {
            let (start, end) = situation.probe_segment(vertex as usize);
            let blocked =
                request.keep_out().iter().any(|region| region.blocks(&start, &end, request.pad_radius_m()));
            excluded.keep_out += u32::from(blocked);
            !blocked
        })
        .collect();
    let travel = Travel::new(situation, request);
    let mut ranking = match situation.config.strategy {
        Strategy::Proactive => proactive::rank(situation, &reachable, travel),
        Strategy::ExpectedGain => expected_gain::rank(situation, &reachable, travel),
        Strategy::MinUncertainty => baselines::min_uncertainty(situation, &reachable),
        Strategy::Uniform => baselines::uniform(situation, &reachable),
        Strategy::Random => baselines::random(situation, &reachable),
    };
    let mut candidates: Vec<Candidate> = Vec::new();
    while candidates.len() < request.top_k() {
        let Some(ranked) = ranking.ranked.next() else { break };
        let point = situation.mesh.vertices[ranked.vertex as usize];
        if candidates.iter().all(|other| (other.point - point).norm() >= SEPARATION_M) {
            candidates.push(candidate(situation, &ranked, &ranking));
        }
    }
    let excluded = Excluded { keep_out: excluded.keep_out, ..ranking.excluded };
    Proposal { candidates, excluded }
}

/// Whether a strategy that avoids what has failed has nothing left to offer.
pub fn is_exhausted(situation: &Situation<'_>) -> bool {
    situation.config.strategy.weighs_terms()
        && (0..situation.mesh.vertices.len() as u32).all(|vertex| failures::is_taboo(situation, vertex))
}

fn candidate(situation: &Situation<'_>, ranked: &Ranked, ranking: &Ranking<'_>) -> Candidate {
    let vertex = ranked.vertex as usize;
    let (probe_start, probe_end) = situation.probe_segment(vertex);
    let measure = || proactive::Frontier::new(situation).mean_geodesic_m(ranked.vertex);
    let std_m = situation.deviations.map(|deviations| deviations.std_m[vertex]);
    Candidate {
        vertex: ranked.vertex,
        point: situation.mesh.vertices[vertex],
        normal: situation.normals[vertex],
        probe_start,
        probe_end,
        score: ranked.score(),
        terms: ranked.terms.clone(),
        uncertainty: situation.uncertainty[vertex],
        std_m,
        mean_geodesic_m: ranked.mean_geodesic_m.or_else(measure).unwrap_or(0.0),
        failure_risk: std_m.map(|std_m| RiskLaw::FITTED.of_failure(situation.config, std_m)),
        relaxed: ranking.relaxed,
        why: (ranking.why)(ranked),
    }
}
