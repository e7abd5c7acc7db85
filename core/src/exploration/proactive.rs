//! The proactive strategy: cautious, depth first, Eq. (3).
//!
//! A candidate lies next to something confident, so that the estimate there can be relied on, and
//! as far as possible from the rest of what is confident, so that the exploration reaches new
//! ground.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::proposal::{Excluded, Exclusion, ScoreTerm};
use super::ranking::{Ranked, Ranking, total};
use super::situation::Situation;
use super::travel::Travel;
use super::{failures, risk, template_error};
use crate::geometry::{Geodesics, Ring};
use crate::uncertainty::scaled_hops;

/// The threshold of uncertainty is multiplied by this until something is feasible.
const RELAXATION: f64 = 0.8;
/// Below this threshold nothing uncertain is left.
const LEAST_THRESHOLD: f64 = 1e-3;

/// Ranks the reachable vertices by `a_G G + a_U U`, Eq. (3).
pub(super) fn rank<'a>(
    situation: &Situation<'a>,
    reachable: &[u32],
    asked: &[u32],
    travel: Option<Travel>,
) -> Ranking<'a> {
    let (free, recently_failed) = failures::leave_out_taboo(situation, reachable);
    let mut excluded = Excluded { recently_failed, ..Excluded::default() };
    let uncertainty = |vertex: u32| situation.uncertainty[vertex as usize];
    let frontier = Frontier::new(situation);
    let at_frontier: Vec<u32> =
        free.iter().copied().filter(|&vertex| situation.has_confident_neighbour(vertex)).collect();
    let mut threshold = situation.config.candidate_min;
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
    let is_nothing_left = chosen.is_empty();
    if is_nothing_left {
        chosen = free;
    }
    let exclusion = |vertex: u32| {
        if failures::is_taboo(situation, vertex) {
            Some(Exclusion::RecentlyFailed)
        } else if is_nothing_left {
            None
        } else if uncertainty(vertex) < threshold {
            Some(Exclusion::AlreadyCertain)
        } else {
            (!situation.has_confident_neighbour(vertex)).then_some(Exclusion::NoConfidentNeighbour)
        }
    };
    let why = Box::new(move |ranked: &Ranked| explain(ranked, relaxed.then_some(threshold)));
    let mut best_first = BestFirst::new(frontier, chosen, travel);
    let asked = asked.iter().map(|&vertex| (best_first.measured(vertex), exclusion(vertex))).collect();
    Ranking { ranked: Box::new(best_first), relaxed, excluded, asked, why }
}

/// The feasible vertices by their score, the best first.
///
/// Geodesics are what costs, so each vertex waits with an upper bound of its score, and is
/// measured only when no other can be better.
struct BestFirst<'a> {
    frontier: Frontier<'a>,
    /// The largest mean geodesic distance of all, by which `G` is normalised.
    largest_m: f64,
    travel: Option<Travel>,
    waiting: BinaryHeap<Scored>,
}

impl<'a> BestFirst<'a> {
    fn new(mut frontier: Frontier<'a>, vertices: Vec<u32>, travel: Option<Travel>) -> Self {
        let mut bounds: Vec<(f64, u32)> = vertices
            .into_iter()
            .map(|vertex| (frontier.mean_edge_path_m(vertex).unwrap_or(0.0), vertex))
            .collect();
        bounds.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut largest_m = 0.0_f64;
        let mut measured = Vec::new();
        for (bound_m, vertex) in &bounds {
            if *bound_m <= largest_m {
                break;
            }
            let mean_m = frontier.mean_geodesic_m(*vertex);
            largest_m = largest_m.max(mean_m.unwrap_or(0.0));
            measured.push(mean_m);
        }
        let mut ranking = Self { frontier, largest_m, travel, waiting: BinaryHeap::new() };
        for (index, (bound_m, vertex)) in bounds.into_iter().enumerate() {
            let measured = measured.get(index).copied();
            // No measured distance exceeds the largest, whatever its bound.
            let most_m = measured.map_or(bound_m.min(largest_m), |mean_m| mean_m.unwrap_or(0.0));
            let score = total(&ranking.terms(vertex, most_m));
            ranking.waiting.push(Scored { score, measured, vertex });
        }
        ranking
    }

    fn measured(&mut self, vertex: u32) -> Ranked {
        let mean_geodesic_m = self.frontier.mean_geodesic_m(vertex);
        Ranked { vertex, terms: self.terms(vertex, mean_geodesic_m.unwrap_or(0.0)), mean_geodesic_m }
    }

    /// The terms of Eq. (3), and those that a method adds.
    fn terms(&self, vertex: u32, mean_geodesic_m: f64) -> Vec<ScoreTerm> {
        let situation = &self.frontier.situation;
        let distance = if self.largest_m > 0.0 { mean_geodesic_m / self.largest_m } else { 0.0 };
        let term = |term, weight, value| ScoreTerm { term, weight, value };
        let mut terms = vec![
            term("geodesic", situation.config.alpha_geodesic, distance),
            term("uncertainty", situation.config.alpha_uncertainty(), situation.uncertainty[vertex as usize]),
        ];
        if situation.config.method.has_extra_terms() {
            let stages = &situation.config.stages;
            terms.extend(stages.template_error.then(|| template_error::term(situation, vertex)).flatten());
            terms.extend(stages.risk.then(|| risk::term(situation, vertex)).flatten());
            terms.extend(stages.failure_penalty.then(|| failures::term(situation, vertex)));
        }
        terms.extend(self.travel.map(|travel| travel.term(situation, vertex)));
        terms
    }
}

impl Iterator for BestFirst<'_> {
    type Item = Ranked;

    fn next(&mut self) -> Option<Ranked> {
        loop {
            let Scored { measured, vertex, .. } = self.waiting.pop()?;
            let mean_geodesic_m = match measured {
                Some(mean_geodesic_m) => {
                    let terms = self.terms(vertex, mean_geodesic_m.unwrap_or(0.0));
                    return Some(Ranked { vertex, terms, mean_geodesic_m });
                }
                None => self.frontier.mean_geodesic_m(vertex),
            };
            let score = total(&self.terms(vertex, mean_geodesic_m.unwrap_or(0.0)));
            self.waiting.push(Scored { score, measured: Some(mean_geodesic_m), vertex });
        }
    }
}

/// A vertex with its score, or with an upper bound of it while it is not measured.
#[derive(Debug)]
struct Scored {
    score: f64,
    measured: Option<Option<f64>>,
    vertex: u32,
}

impl Ord for Scored {
    /// The highest score first; of equals what may still be a tie, and then the lowest number.
    fn cmp(&self, other: &Self) -> Ordering {
        self.score
            .total_cmp(&other.score)
            .then(self.measured.is_none().cmp(&other.measured.is_none()))
            .then(other.vertex.cmp(&self.vertex))
    }
}

impl PartialOrd for Scored {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Eq for Scored {}

impl PartialEq for Scored {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

fn explain(ranked: &Ranked, lowered: Option<f64>) -> String {
    let u = ranked.value("uncertainty");
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

/// The border between what is confident and what is not.
pub(super) struct Frontier<'a> {
    situation: Situation<'a>,
    hops: usize,
    ring: Ring,
    geodesics: Geodesics<'a>,
    paths_m: Vec<f64>,
}

impl<'a> Frontier<'a> {
    pub(super) fn new(situation: &Situation<'a>) -> Self {
        let count = situation.mesh.vertices.len();
        Self {
            situation: situation.clone(),
            hops: scaled_hops(situation.reach.hops, count),
            ring: Ring::new(count),
            geodesics: Geodesics::new(situation.connectivity, &situation.mesh.vertices),
            paths_m: Vec::new(),
        }
    }

    /// Mean geodesic distance from a vertex to the confident vertices of its ring, in metres.
    pub(super) fn mean_geodesic_m(&mut self, vertex: u32) -> Option<f64> {
        self.ring.around(self.situation.connectivity, vertex, self.hops);
        self.geodesics.spread(vertex, &self.ring);
        let others = self.ring.vertices()[1..].iter();
        mean(
            others
                .filter(|&&other| self.situation.is_confident(other))
                .map(|&other| self.geodesics.to(other)),
        )
    }

    /// The same along edges, from hop to hop: quickly found, and never shorter.
    fn mean_edge_path_m(&mut self, vertex: u32) -> Option<f64> {
        self.ring.around(self.situation.connectivity, vertex, self.hops);
        self.paths_m.clear();
        let at = |vertex: u32| &self.situation.mesh.vertices[vertex as usize];
        for (&other, &parent) in self.ring.vertices().iter().zip(self.ring.parents()) {
            let before_m = self.paths_m.get(parent as usize).copied().unwrap_or(0.0);
            let step_m = (at(other) - at(self.ring.vertices()[parent as usize])).norm();
            self.paths_m.push(before_m + step_m);
        }
        let paths = self.ring.vertices().iter().zip(&self.paths_m).skip(1);
        mean(paths.filter(|(other, _)| self.situation.is_confident(**other)).map(|(_, path_m)| *path_m))
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}
