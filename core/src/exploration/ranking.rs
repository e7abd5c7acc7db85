//! Vertices in the order of a strategy's preference.

use super::proposal::{Excluded, Exclusion, ScoreTerm};

/// A vertex that a strategy offers.
#[derive(Clone, Debug)]
pub(super) struct Ranked {
    pub(super) vertex: u32,
    pub(super) terms: Vec<ScoreTerm>,
    /// Mean geodesic distance to the confident vertices around it, where the strategy asked for it.
    pub(super) mean_geodesic_m: Option<f64>,
}

impl Ranked {
    /// The value of a term by its name; 0 where the score has no such term.
    pub(super) fn value(&self, name: &str) -> f64 {
        self.terms.iter().find(|term| term.term == name).map_or(0.0, |term| term.value)
    }

    pub(super) fn score(&self) -> f64 {
        total(&self.terms)
    }
}

/// The sum of weight times value.
pub(super) fn total(terms: &[ScoreTerm]) -> f64 {
    terms.iter().map(|term| term.weight * term.value).sum()
}

/// Vertices in the order of their preference, and what was left out.
pub(super) struct Ranking<'a> {
    /// The best first, each found when it is asked for: few ever are.
    pub(super) ranked: Box<dyn Iterator<Item = Ranked> + 'a>,
    pub(super) relaxed: bool,
    pub(super) excluded: Excluded,
    /// The vertices whose score was asked, with what keeps the strategy from offering them.
    pub(super) asked: Vec<(Ranked, Option<Exclusion>)>,
    /// Why a vertex is offered, in words; asked only of those that become candidates.
    pub(super) why: Box<dyn Fn(&Ranked) -> String>,
}
