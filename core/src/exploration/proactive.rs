//! The proactive strategy: cautious, depth first, Eq. (3).
//!
//! A candidate lies next to something confident, so that the estimate there can be relied on, and
//! as far as possible from the rest of what is confident, so that the exploration reaches new
//! ground. A failed candidate is left alone until three later contacts have succeeded: the
//! estimate has not changed, and the same choice would fail for ever.

use super::{Excluded, Ranked, Ranking, ScoreTerm, View};
use crate::config::Method;
use crate::geodesic::Geodesics;
use crate::uncertainty::{Ring, scaled_hops};

/// Candidates this close to a failed one are taboo, in metres.
const TABU_RADIUS_M: f64 = 0.010;
/// Until this many later contacts have succeeded.
const TABU_CONTACTS: u32 = 3;
/// A failure makes its surroundings less attractive over this distance, in metres.
const FAILURE_RADIUS_M: f64 = 0.035;
/// The threshold of uncertainty is multiplied by this until something is feasible.
const RELAXATION: f64 = 0.8;
/// Below this threshold nothing uncertain is left.
const LEAST_THRESHOLD: f64 = 1e-3;

/// Ranks the reachable vertices by `a_G G + a_U U`, Eq. (3).
pub(super) fn rank(view: &View<'_>, reachable: &[u32]) -> Ranking {
    let mut excluded = Excluded::default();
    let free: Vec<u32> = reachable
        .iter()
        .copied()
        .filter(|&vertex| {
            let taboo = is_taboo(view, vertex);
            excluded.recently_failed += u32::from(taboo);
            !taboo
        })
        .collect();
    let uncertainty = |vertex: u32| view.uncertainty[vertex as usize];
    let mut frontier = Frontier::new(view);
    let at_frontier: Vec<u32> =
        free.iter().copied().filter(|&vertex| frontier.has_confident_neighbour(vertex)).collect();
    let mut threshold = view.config.candidate_min;
    let feasible = |threshold: f64| -> Vec<u32> {
        at_frontier.iter().copied().filter(|&vertex| uncertainty(vertex) >= threshold).collect()
    };
    let mut chosen = feasible(threshold);
    excluded.already_certain = free.iter().filter(|&&v| uncertainty(v) < threshold).count() as u32;
    excluded.no_confident_neighbour = free.len() as u32 - excluded.already_certain - chosen.len() as u32;
    let relaxed = chosen.is_empty();
    while chosen.is_empty() && threshold > LEAST_THRESHOLD {
        threshold *= RELAXATION;
        chosen = feasible(threshold);
    }
    if chosen.is_empty() {
        chosen = free;
    }
    let geodesics: Vec<Option<f64>> = chosen.iter().map(|&vertex| frontier.mean_geodesic_m(vertex)).collect();
    let largest = geodesics.iter().flatten().copied().fold(0.0, f64::max);
    let weigh = |(vertex, mean_geodesic_m): (u32, Option<f64>)| {
        let distance = if largest > 0.0 { mean_geodesic_m.unwrap_or(0.0) / largest } else { 0.0 };
        let term = |term, weight, value| ScoreTerm { term, weight, value };
        let mut terms = vec![
            term("geodesic", view.config.alpha_geodesic, distance),
            term("uncertainty", view.config.alpha_uncertainty, uncertainty(vertex)),
        ];
        if view.config.method == Method::Palpate {
            terms.push(term("failures", -1.0, failures_nearby(view, vertex)));
        }
        Ranked { vertex, terms, mean_geodesic_m }
    };
    let mut ranked: Vec<Ranked> = chosen.into_iter().zip(geodesics).map(weigh).collect();
    // A stable sort: equal scores stay in the order of their numbers.
    ranked.sort_by(|a, b| b.score().total_cmp(&a.score()));
    let why = Box::new(move |ranked: &Ranked| explain(ranked, relaxed.then_some(threshold)));
    Ranking { ranked, relaxed, excluded, why }
}

fn explain(ranked: &Ranked, lowered: Option<f64>) -> String {
    let u = ranked.terms[1].value;
    let distance = match ranked.mean_geodesic_m {
        Some(m) => {
            format!("on average {:.0} mm along the surface from the confident vertices around it", 1e3 * m)
        }
        None => "with nothing confident around it".to_owned(),
    };
    let rule = match lowered {
        Some(threshold) => format!("; nothing met candidate_min, which was lowered to {threshold:.2}"),
        None => String::new(),
    };
    format!("at the frontier of what is known: uncertainty {u:.2}, {distance}{rule}")
}

/// Past failures, each counted by its nearness: the estimate is less to be trusted around them.
fn failures_nearby(view: &View<'_>, vertex: u32) -> f64 {
    let point = &view.mesh.vertices[vertex as usize];
    let nearness = |square_m2: f64| (-square_m2 / (2.0 * FAILURE_RADIUS_M.powi(2))).exp();
    view.ledger.failures.iter().map(|failure| nearness((failure.point - point).norm_squared())).sum()
}

/// Whether a candidate close by failed and too little has been learnt since.
pub(super) fn is_taboo(view: &View<'_>, vertex: u32) -> bool {
    let point = &view.mesh.vertices[vertex as usize];
    let contacts = view.ledger.tallies.contacts;
    view.ledger.failures.iter().any(|failure| {
        contacts < failure.contacts_before + TABU_CONTACTS && (failure.point - point).norm() < TABU_RADIUS_M
    })
}

/// The border between what is confident and what is not.
pub(super) struct Frontier<'a> {
    view: View<'a>,
    hops: usize,
    ring: Ring,
    geodesics: Geodesics<'a>,
}

impl<'a> Frontier<'a> {
    pub(super) fn new(view: &View<'a>) -> Self {
        let count = view.mesh.vertices.len();
        Self {
            view: *view,
            hops: scaled_hops(view.reach.hops, count),
            ring: Ring::new(count),
            geodesics: Geodesics::new(view.sphere, &view.mesh.vertices),
        }
    }

    /// `u <= u'_max`, Eq. (3).
    fn is_confident(&self, vertex: u32) -> bool {
        self.view.uncertainty[vertex as usize] <= self.view.config.confident_max
    }

    fn has_confident_neighbour(&self, vertex: u32) -> bool {
        self.view.sphere.neighbours(vertex as usize).iter().any(|&next| self.is_confident(next))
    }

    /// Mean geodesic distance from a vertex to the confident vertices of its ring, in metres.
    pub(super) fn mean_geodesic_m(&mut self, vertex: u32) -> Option<f64> {
        self.ring.around(self.view.sphere, vertex, self.hops);
        self.geodesics.spread(vertex, &self.ring);
        let (mut sum, mut count) = (0.0, 0_u32);
        for &other in self.ring.vertices() {
            if other != vertex && self.is_confident(other) {
                sum += self.geodesics.to(other);
                count += 1;
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }
}
