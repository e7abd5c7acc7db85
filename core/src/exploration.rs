//! Exploration: where to touch next (Section III-G).
//!
//! Takes a [`Situation`] and a [`ProposalRequest`]; gives candidates, the best first. A strategy
//! ranks the vertices of the estimate; what is forbidden is left out, and the best few that lie
//! apart from each other become candidates. A proposal is a pure function of the state.

mod again;
mod baselines;
mod expected_gain;
mod failures;
mod hindsight;
mod keep_out;
mod pads;
mod proactive;
mod proposal;
mod ranking;
mod risk;
mod rng;
mod separation;
mod situation;
mod template_error;
mod travel;

pub use hindsight::{Hindsight, hindsight};
pub use keep_out::{KeepOut, Region};
pub use pads::{Approach, MountedPad};
pub use proposal::{
    Candidate, Excluded, Exclusion, Explained, Proposal, ProposalRequest, SEPARATION_M, ScoreTerm,
};
pub use risk::RiskLaw;
pub use situation::{Deviations, DoubtedTouch, Situation};

use self::ranking::{Ranked, Ranking};
use self::travel::Travel;
use crate::config::Strategy;
use crate::geometry::{Direction, Point};

/// Proposes the next contacts.
pub fn propose(situation: &Situation<'_>, request: &ProposalRequest) -> Proposal {
    let mut excluded = Excluded::default();
    let reachable: Vec<u32> = (0..situation.mesh.vertices.len() as u32)
        .filter(|&vertex| {
            let count = match forbidden(situation, request, vertex) {
                Some(Exclusion::KeepOut) => &mut excluded.keep_out,
                Some(Exclusion::Unreachable) => &mut excluded.unreachable,
                Some(Exclusion::Leased) => &mut excluded.leased,
                _ => return true,
            };
            *count += 1;
            false
        })
        .collect();
    let travel = Travel::new(situation, request);
    let asked: Vec<u32> = request.asked().iter().copied().filter(|&vertex| situation.has(vertex)).collect();
    let mut ranking = match situation.config.strategy {
        Strategy::Proactive => proactive::rank(situation, &reachable, &asked, travel),
        Strategy::ExpectedGain => expected_gain::rank(situation, &reachable, &asked, travel),
        Strategy::MinUncertainty => baselines::min_uncertainty(situation, &reachable, &asked),
        Strategy::Uniform => baselines::uniform(situation, &reachable, &asked),
        Strategy::Random => baselines::random(situation, &reachable, &asked),
    };
    let chosen = separation::best_apart(situation, &mut ranking.ranked, request.top_k());
    let chosen = chosen.iter().map(|ranked| candidate(situation, request, ranked, &ranking));
    let candidates =
        again::candidates(situation, request).into_iter().chain(chosen).take(request.top_k()).collect();
    let Excluded { already_certain, no_confident_neighbour, recently_failed, .. } = ranking.excluded;
    let excluded = Excluded { already_certain, no_confident_neighbour, recently_failed, ..excluded };
    let explained = ranking.asked.iter().map(|(ranked, exclusion)| {
        explained(situation, ranked, forbidden(situation, request, ranked.vertex).or(*exclusion))
    });
    Proposal { candidates, excluded, explained: explained.collect() }
}

/// What forbids an approach to a vertex, whatever the strategy.
fn forbidden(situation: &Situation<'_>, request: &ProposalRequest, vertex: u32) -> Option<Exclusion> {
    let (place, normal) = (&situation.mesh.vertices[vertex as usize], &situation.normals[vertex as usize]);
    let (start, end) = situation.probe_segment(vertex as usize);
    if enters_what_is_kept_out(request, normal, (&start, &end)) {
        Some(Exclusion::KeepOut)
    } else if is_rejected(situation, place) {
        Some(Exclusion::Unreachable)
    } else {
        is_leased(request, place).then_some(Exclusion::Leased)
    }
}

/// Whether an approach is not to be made: kept out, rejected or promised to another robot.
fn is_forbidden(
    situation: &Situation<'_>,
    request: &ProposalRequest,
    place: &Point,
    normal: &Direction,
    approach: (&Point, &Point),
) -> bool {
    enters_what_is_kept_out(request, normal, approach)
        || is_rejected(situation, place)
        || is_leased(request, place)
}

/// Whether any part of the pad enters a forbidden region on its way.
fn enters_what_is_kept_out(
    request: &ProposalRequest,
    normal: &Direction,
    (start, end): (&Point, &Point),
) -> bool {
    if !request.keeps_out() {
        return false;
    }
    let radius_m = request.pad_radius_m(normal);
    request.keep_out().iter().any(|region| region.blocks(start, end, radius_m))
}

/// Whether a robot did not try a candidate close by, for a reason that still holds.
fn is_rejected(situation: &Situation<'_>, place: &Point) -> bool {
    let attempts = situation.ledger.tallies.attempts;
    situation.ledger.rejections.iter().any(|rejection| rejection.holds_at(place, attempts))
}

/// Whether a place close by is promised to another robot.
fn is_leased(request: &ProposalRequest, place: &Point) -> bool {
    request.leased().iter().any(|leased| (leased - place).norm() < request.lease_radius_m())
}

/// Whether nothing is left to offer: all was rejected, or has failed where the strategy avoids that.
pub fn is_exhausted(situation: &Situation<'_>) -> bool {
    let avoids_failures = situation.config.strategy.weighs_terms();
    let is_out = |vertex| {
        is_rejected(situation, &situation.mesh.vertices[vertex as usize])
            || (avoids_failures && failures::is_taboo(situation, vertex))
    };
    (0..situation.mesh.vertices.len() as u32).all(is_out)
}

fn candidate(
    situation: &Situation<'_>,
    request: &ProposalRequest,
    ranked: &Ranked,
    ranking: &Ranking<'_>,
) -> Candidate {
    let vertex = ranked.vertex as usize;
    let (probe_start, probe_end) = situation.probe_segment(vertex);
    let Explained { score, terms, uncertainty, std_m, mean_geodesic_m, failure_risk, .. } =
        explained(situation, ranked, None);
    Candidate {
        vertex: ranked.vertex,
        point: situation.mesh.vertices[vertex],
        normal: situation.normals[vertex],
        probe_start,
        probe_end,
        approach: request.approach(&probe_start, &situation.normals[vertex]),
        score,
        terms,
        uncertainty,
        std_m,
        mean_geodesic_m,
        failure_risk,
        relaxed: ranking.relaxed,
        why: (ranking.why)(ranked),
    }
}

/// What a vertex's score is made of, and what is known of it.
fn explained(situation: &Situation<'_>, ranked: &Ranked, excluded: Option<Exclusion>) -> Explained {
    let vertex = ranked.vertex as usize;
    let measure = || proactive::Frontier::new(situation).mean_geodesic_m(ranked.vertex);
    let std_m = situation.deviations.map(|deviations| deviations.std_m[vertex]);
    Explained {
        vertex: ranked.vertex,
        score: ranked.score(),
        terms: ranked.terms.clone(),
        uncertainty: situation.uncertainty[vertex],
        std_m,
        mean_geodesic_m: ranked.mean_geodesic_m.or_else(measure).unwrap_or(0.0),
        failure_risk: std_m.map(|std_m| RiskLaw::FITTED.of_failure(situation.config, std_m)),
        excluded,
    }
}
