//! The strategy of expected gain: the touch that teaches the most about the whole surface, if it
//! meets anything.
//!
//! The posterior process says by how much a measurement at one vertex lowers the variance of every
//! other. Its variance alone is blind to a wrong template, and choosing by it fails almost every
//! time: so correlations are the process's, deviations are the calibrated ones of the surface,
//! which are scaled to cover the template's error, and the gain counts only as far as contact is to be expected:
//! `ln(expected share of the variance removed) + 2 ln P(contact) - failures nearby`.
//! It is as cautious as the proactive strategy: no further than next to what is confident.

use super::failures;
use super::proposal::{Excluded, Exclusion, ScoreTerm};
use super::ranking::{Ranked, Ranking};
use super::risk::RiskLaw;
use super::situation::{Deviations, Situation};
use super::travel::Travel;
use crate::geometry::farthest_point_sampling;

/// This many vertices are compared, spread evenly over what may be touched.
const COMPARED: usize = 128;
/// The variance is summed over this many vertices: those of the icosphere with three subdivisions.
/// With two, edges fall between them, and boxes and cans come out worse.
const OBSERVED: usize = 642;
/// Weight of the probability of contact: a failure costs an attempt and teaches little.
const CONTACT_WEIGHT: f64 = 2.0;
/// Deviation of a touch, in metres.
const NOISE_M: f64 = 0.001;

/// Ranks an even selection of the reachable vertices.
pub(super) fn rank(
    situation: &Situation<'_>,
    reachable: &[u32],
    asked: &[u32],
    travel: Option<Travel>,
) -> Ranking<'static> {
    let (mut free, recently_failed) = failures::leave_out_taboo(situation, reachable);
    let mut excluded = Excluded { recently_failed, ..Excluded::default() };
    let is_trusted =
        |vertex: u32| situation.is_confident(vertex) || situation.has_confident_neighbour(vertex);
    let trusted: Vec<u32> = free.iter().copied().filter(|&vertex| is_trusted(vertex)).collect();
    excluded.no_confident_neighbour = (free.len() - trusted.len()) as u32;
    let relaxed = trusted.is_empty();
    if !relaxed {
        free = trusted;
    }
    let at = |&vertex: &u32| situation.mesh.vertices[vertex as usize];
    let points: Vec<_> = free.iter().map(at).collect();
    let places: Vec<u32> =
        farthest_point_sampling(&points, COMPARED).into_iter().map(|place| free[place]).collect();
    let offer = |(&vertex, gain): (&u32, f64)| {
        let risk = situation
            .deviations
            .map_or(0.0, |d| RiskLaw::FITTED.of_failure(situation.config, d.std_m[vertex as usize]));
        let term = |term, weight, value| ScoreTerm { term, weight, value };
        let mut terms = vec![
            term("gain", 1.0, gain.max(f64::MIN_POSITIVE).ln()),
            term("contact", CONTACT_WEIGHT, (1.0 - risk).ln()),
        ];
        if situation.config.stages.failure_penalty {
            terms.push(failures::term(situation, vertex));
        }
        terms.extend(travel.map(|travel| travel.term(situation, vertex)));
        Ranked { vertex, terms, mean_geodesic_m: None }
    };
    let offers = |vertices: &[u32]| -> Vec<Ranked> {
        vertices.iter().zip(expected_gains(situation, vertices)).map(offer).collect()
    };
    let exclusion = |vertex: u32| {
        if failures::is_taboo(situation, vertex) {
            Some(Exclusion::RecentlyFailed)
        } else if !relaxed && !is_trusted(vertex) {
            Some(Exclusion::NoConfidentNeighbour)
        } else {
            (!places.contains(&vertex)).then_some(Exclusion::NotCompared)
        }
    };
    let asked = offers(asked).into_iter().zip(asked.iter().map(|&vertex| exclusion(vertex))).collect();
    let mut ranked = offers(&places);
    ranked.sort_by(|a, b| b.score().total_cmp(&a.score()));
    Ranking { ranked: Box::new(ranked.into_iter()), relaxed, excluded, asked, why: Box::new(explain) }
}

/// For each of some vertices the share of the surface's variance that a touch there is expected
/// to remove, in [0, 1].
fn expected_gains(situation: &Situation<'_>, places: &[u32]) -> Vec<f64> {
    let Some(Deviations { std_m, process, .. }) = situation.deviations else {
        return vec![0.0; places.len()];
    };
    // An icosphere begins with the vertices of the coarser ones, and these lie evenly.
    let observed: Vec<u32> = (0..OBSERVED.min(situation.mesh.vertices.len()) as u32).collect();
    let areas = situation.mesh.vertex_areas();
    let correlation = process.correlation(places, &observed);
    let variance = |vertex: u32| std_m[vertex as usize].powi(2);
    let total: f64 = observed.iter().map(|&v| areas[v as usize] * variance(v)).sum();
    let gain = |row: usize| {
        let of_place = variance(places[row]);
        let learnt = of_place / (of_place + NOISE_M * NOISE_M);
        let removed = observed.iter().enumerate().map(|(column, &vertex)| {
            areas[vertex as usize] * variance(vertex) * f64::from(correlation[(row, column)]).powi(2)
        });
        learnt * removed.sum::<f64>() / total
    };
    (0..places.len()).map(gain).collect()
}

fn explain(ranked: &Ranked) -> String {
    let (gain, contact) = (ranked.value("gain").exp(), ranked.value("contact").exp());
    format!(
        "a touch is expected to remove {:.1} % of what is uncertain, and to meet the surface with {:.0} %",
        100.0 * gain,
        100.0 * contact
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::evidence::ledger::Ledger;
    use crate::geometry::{Icosphere, Point, SurfacePoint};
    use crate::local::VertexProcess;
    use crate::local::observation::Observation;
    use crate::local::prior::Prior;
    use crate::local::process::Displacement;
    use crate::symmetry::{Symmetry, SymmetryFrame};
    use nalgebra::Rotation3;

    #[test]
    fn the_expected_gain_is_what_a_touch_there_removes() {
        let sphere = Icosphere::get(3);
        let mesh = sphere.mesh_of(|direction| Point::from(direction.into_inner() * 0.05));
        let places: Vec<SurfacePoint> =
            mesh.vertices.iter().zip(&sphere.directions).map(|(p, n)| SurfacePoint::new(p, n)).collect();
        let touch = |vertex: usize, noise_m| Observation::new(places[vertex], 0.0, noise_m);
        let mut seen: Vec<Observation> = [0, 5, 20, 100, 300].map(|vertex| touch(vertex, 5e-4)).into();
        for symmetry in [Symmetry::None, Symmetry::Mirror([true, false, false])] {
            let frame = SymmetryFrame { centre: Point::origin(), axes: Rotation3::identity(), symmetry };
            let prior = Prior { length_m: 0.03, amplitude_m: 0.006, frame };
            let deviations_m =
                |seen: &[Observation]| Displacement::fit(prior, seen).predict(&places, places.len()).1;
            let before = deviations_m(&seen);
            let process = VertexProcess::new(Displacement::fit(prior, &seen), places.clone(), before.clone());
            let (config, ledger) = (Config::default(), Ledger::default());
            let deviations = Deviations { std_m: &before, template_std_m: &before, process: &process };
            let plain = Situation::plain(&config, &ledger, sphere, &mesh);
            let situation = Situation { deviations: Some(deviations), ..plain };
            let chosen = [5, 17, 250, 641];
            let areas = mesh.vertex_areas();
            let variance = |deviations_m: &[f64]| -> f64 {
                deviations_m.iter().zip(&areas).map(|(deviation_m, area)| area * deviation_m.powi(2)).sum()
            };
            for (vertex, gain) in chosen.iter().zip(expected_gains(&situation, &chosen)) {
                seen.push(touch(*vertex as usize, NOISE_M));
                let removed = 1.0 - variance(&deviations_m(&seen)) / variance(&before);
                seen.pop();
                assert!((gain - removed).abs() < 1e-3 * removed, "{symmetry:?} {vertex}: {gain} {removed}");
            }
        }
    }

    #[test]
    fn an_icosphere_begins_with_the_vertices_of_the_coarser_one() {
        let coarse = &Icosphere::get(3).directions;
        assert_eq!(coarse.len(), OBSERVED);
        assert_eq!(coarse[..], Icosphere::get(4).directions[..coarse.len()]);
    }
}
