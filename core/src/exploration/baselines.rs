//! What the proactive strategy is compared with: the paper's own baseline and the two that the
//! literature uses. None of them avoids a place that has failed, but for the first in METHOD_GPIS.

use rand::RngExt;
use rand::seq::SliceRandom;

use super::failures;
use super::proposal::{Excluded, Exclusion, ScoreTerm};
use super::ranking::{Ranked, Ranking};
use super::rng::{Use, generator};
use super::situation::Situation;
use crate::config::ATTEMPTS;
use crate::geometry::Vector;

/// The vertex of the highest uncertainty; ties by the seeded generator (Section IV-B, minU).
pub(super) fn min_uncertainty(
    situation: &Situation<'_>,
    reachable: &[u32],
    asked: &[u32],
) -> Ranking<'static> {
    let leaves_out_failures = situation.config.method.baseline_leaves_out_failures();
    let (mut order, recently_failed) = if leaves_out_failures {
        failures::leave_out_taboo(situation, reachable)
    } else {
        (reachable.to_vec(), 0)
    };
    order.shuffle(&mut generator(situation.config.seed, Use::Ties, situation.ledger.tallies.attempts));
    let mut ranking = by_value(
        order,
        asked,
        "uncertainty",
        |vertex| situation.uncertainty[vertex as usize],
        |value| format!("uncertainty {value:.2}, the highest of the surface"),
    );
    for (offered, exclusion) in &mut ranking.asked {
        let is_taboo = leaves_out_failures && failures::is_taboo(situation, offered.vertex);
        *exclusion = is_taboo.then_some(Exclusion::RecentlyFailed);
    }
    Ranking { excluded: Excluded { recently_failed, ..ranking.excluded }, ..ranking }
}

/// Evenly spread directions from the template's centre, fixed before the first touch.
pub(super) fn uniform(situation: &Situation<'_>, reachable: &[u32], asked: &[u32]) -> Ranking<'static> {
    let count = situation.config.stop.max_attempts.unwrap_or(ATTEMPTS).max(1);
    let mut order: Vec<u32> = (0..count).collect();
    order.shuffle(&mut generator(situation.config.seed, Use::Directions, 0));
    let number = situation.ledger.tallies.attempts % count;
    let direction = fibonacci_direction(order[number as usize], count);
    by_value(
        reachable.to_vec(),
        asked,
        "alignment",
        |vertex| {
            let offset = situation.mesh.vertices[vertex as usize] - situation.centre;
            offset.try_normalize(0.0).map_or(-1.0, |towards| towards.dot(&direction))
        },
        move |_| format!("direction {} of {count} spread evenly over the sphere", number + 1),
    )
}

/// Any point of the surface, by area.
pub(super) fn random(situation: &Situation<'_>, reachable: &[u32], asked: &[u32]) -> Ranking<'static> {
    let mut random = generator(situation.config.seed, Use::Picks, situation.ledger.tallies.attempts);
    // The largest of u^(1/area) is a draw weighted by area, and so is each that follows it.
    let areas = situation.mesh.vertex_areas();
    let draws: Vec<f64> = areas
        .iter()
        .map(|area| random.random::<f64>().powf(area.max(f64::MIN_POSITIVE).recip().min(1e12)))
        .collect();
    by_value(
        reachable.to_vec(),
        asked,
        "draw",
        |vertex| draws[vertex as usize],
        |_| "drawn at random, by area".into(),
    )
}

/// The unit direction `index` of `count` on a Fibonacci lattice.
fn fibonacci_direction(index: u32, count: u32) -> Vector {
    let z = 1.0 - (2.0 * f64::from(index) + 1.0) / f64::from(count);
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let (sin, cos) = (golden_angle * f64::from(index)).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    Vector::new(radius * cos, radius * sin, z)
}

/// Ranks vertices by one value, the highest first; equal values keep the order that is given.
fn by_value(
    vertices: Vec<u32>,
    asked: &[u32],
    term: &'static str,
    value: impl Fn(u32) -> f64,
    why: impl Fn(f64) -> String + 'static,
) -> Ranking<'static> {
    let offer = |vertex| {
        let terms = vec![ScoreTerm { term, weight: 1.0, value: value(vertex) }];
        Ranked { vertex, terms, mean_geodesic_m: None }
    };
    let asked = asked.iter().map(|&vertex| (offer(vertex), None)).collect();
    let mut ranked: Vec<Ranked> = vertices.into_iter().map(offer).collect();
    ranked.sort_by(|a, b| b.score().total_cmp(&a.score()));
    let why = Box::new(move |ranked: &Ranked| why(ranked.score()));
    let ranked = Box::new(ranked.into_iter());
    Ranking { ranked, relaxed: false, excluded: Excluded::default(), asked, why }
}
