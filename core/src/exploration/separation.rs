//! The best few that differ: alternatives for a planner, and places for two arms at once.
//!
//! Scores change little over a few millimetres, so the best few by score alone would all be one
//! place. They keep a share of the object's size apart; where that leaves too few, the distance is
//! halved for those that are still missing, down to the least.

use super::proposal::SEPARATION_M;
use super::ranking::Ranked;
use super::situation::Situation;

/// The share of the object's diagonal that candidates keep apart where there is room.
const SHARE_OF_SIZE: f64 = 0.25;

/// At most `count` of `ranked`, which come best first: the best of all, and those that lie apart.
/// Best first again.
pub(super) fn best_apart(
    situation: &Situation<'_>,
    ranked: impl Iterator<Item = Ranked>,
    count: usize,
) -> Vec<Ranked> {
    if count < 2 {
        return ranked.take(count).collect();
    }
    let mut apart_m = (SHARE_OF_SIZE * situation.size_m()).max(SEPARATION_M);
    let (mut chosen, mut waiting) = (Vec::new(), Vec::new());
    take_apart(situation, &mut ranked.into_iter(), apart_m, count, &mut chosen, &mut waiting);
    while chosen.len() < count && apart_m > SEPARATION_M {
        apart_m = (0.5 * apart_m).max(SEPARATION_M);
        let mut again = std::mem::take(&mut waiting).into_iter();
        take_apart(situation, &mut again, apart_m, count, &mut chosen, &mut waiting);
    }
    chosen.sort_by(|a, b| b.score().total_cmp(&a.score()));
    chosen
}

/// Moves what lies at least `apart_m` from all that is `chosen` there, until it is `count`, and the
/// rest to `waiting`.
fn take_apart(
    situation: &Situation<'_>,
    ranked: &mut impl Iterator<Item = Ranked>,
    apart_m: f64,
    count: usize,
    chosen: &mut Vec<Ranked>,
    waiting: &mut Vec<Ranked>,
) {
    let at = |ranked: &Ranked| situation.mesh.vertices[ranked.vertex as usize];
    while chosen.len() < count {
        let Some(next) = ranked.next() else { return };
        if chosen.iter().all(|other| (at(other) - at(&next)).norm() >= apart_m) {
            chosen.push(next);
        } else {
            waiting.push(next);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::evidence::ledger::Ledger;
    use crate::exploration::proposal::ScoreTerm;
    use crate::geometry::{Icosphere, Point};

    /// The vertices of a sphere, the northernmost best.
    fn best(radius_m: f64, count: usize) -> Vec<(f64, Point)> {
        let sphere = Icosphere::get(4);
        let mesh = sphere.mesh_of(|direction| Point::from(direction.into_inner() * radius_m));
        let (config, ledger) = (Config::default(), Ledger::default());
        let situation = Situation::plain(&config, &ledger, sphere, &mesh);
        let mut ranked: Vec<Ranked> = (0..mesh.vertices.len() as u32)
            .map(|vertex| {
                let value = mesh.vertices[vertex as usize].z;
                let terms = vec![ScoreTerm { term: "height", weight: 1.0, value }];
                Ranked { vertex, terms, mean_geodesic_m: None }
            })
            .collect();
        ranked.sort_by(|a, b| b.score().total_cmp(&a.score()));
        let top = ranked[0].vertex;
        let chosen = best_apart(&situation, ranked.into_iter(), count);
        assert_eq!(chosen[0].vertex, top, "the best stays the best");
        chosen.iter().map(|ranked| (ranked.score(), mesh.vertices[ranked.vertex as usize])).collect()
    }

    fn nearest_m(chosen: &[(f64, Point)]) -> f64 {
        let pairs = chosen.iter().enumerate().flat_map(|(i, a)| chosen[..i].iter().map(move |b| (a.1, b.1)));
        pairs.map(|(a, b)| (a - b).norm()).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_second_best_is_farther_away_on_a_larger_object() {
        for radius_m in [0.02, 0.05, 0.15] {
            let diagonal_m = 2.0 * radius_m * 3.0_f64.sqrt();
            let two = best(radius_m, 2);
            assert!(nearest_m(&two) >= 0.25 * diagonal_m * 0.99, "{}", nearest_m(&two));
            assert!(nearest_m(&two) < 0.4 * diagonal_m, "{}", nearest_m(&two));
        }
    }

    #[test]
    fn where_there_is_no_room_they_come_closer_but_never_nearer_than_ten_millimetres() {
        let many = best(0.05, 64);
        assert_eq!(many.len(), 64);
        assert!(nearest_m(&many) >= SEPARATION_M && nearest_m(&many) < 0.02);
        assert!(many.is_sorted_by(|a, b| a.0 >= b.0));
        let all = best(0.01, 64);
        assert!(all.len() < 64 && nearest_m(&all) >= SEPARATION_M);
    }
}
