//! Why a vertex is proposed or is not: its score, and what rules it out.

use palpate_core::evidence::{Attempt, Evidence, Outcome, RejectReason, Sweep, Target};
use palpate_core::exploration::{
    Candidate, Excluded, Exclusion, Explained, KeepOut, Proposal, ProposalRequest,
};
use palpate_core::geometry::Vector;
use palpate_core::reconstruction::Reconstruction;

use crate::arms::settings;
use crate::object::{Object, best, explore};

/// A session in which a place failed and another one could not be approached.
fn with_trouble(state: &Reconstruction) -> Reconstruction {
    let attempt = |candidate: &Candidate, outcome| {
        let target = Target::new(candidate.point, candidate.normal.into_inner()).unwrap();
        Evidence::Attempt(Attempt { target: Some(target), outcome })
    };
    let failed = &state.propose(&best()).candidates[0];
    let sweep = Sweep::new(failed.probe_start, failed.probe_end, 0.0).unwrap();
    let (state, _) = state.absorb(&attempt(failed, Outcome::NoContact(sweep))).unwrap();
    let refused = &state.propose(&best()).candidates[0];
    state.absorb(&attempt(refused, Outcome::Rejected(RejectReason::Operator))).unwrap().0
}

fn proposed(state: &Reconstruction, asked: Vec<u32>) -> Proposal {
    let leased = state.propose(&best()).candidates[0].point;
    let table = KeepOut::half_space(Vector::z(), 0.17).unwrap();
    let request = ProposalRequest::best(1).keeping_out_of(vec![table]).leaving(vec![leased]);
    state.propose(&request.explaining(asked))
}

#[test]
fn every_vertex_has_a_score_and_what_rules_it_out_is_what_is_counted() {
    let mut seen = Vec::new();
    for settings in settings() {
        let name = format!("{:?} {:?}", settings.method, settings.strategy);
        let (_, state) = explore(&Object::sphere(), settings, 4);
        let state = with_trouble(&state);
        let all = 0..state.surface().unwrap().mesh.vertices.len() as u32;
        let Proposal { candidates, excluded, explained } = proposed(&state, all.clone().collect());
        assert!(explained.iter().map(|one| one.vertex).eq(all), "{name}");
        let Candidate { score, ref terms, std_m, failure_risk, mean_geodesic_m, vertex, .. } = candidates[0];
        let of_best = &explained[vertex as usize];
        let Explained { terms: its_terms, score: its_score, .. } = of_best;
        // A gain is computed for many vertices at a time, and rounds by which they are.
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6;
        assert!(near(*its_score, score) && of_best.excluded.is_none(), "{name}");
        assert_eq!(its_terms.len(), terms.len(), "{name}");
        for (its, of_candidate) in its_terms.iter().zip(terms) {
            assert_eq!((its.term, its.weight), (of_candidate.term, of_candidate.weight), "{name}");
            assert!(near(its.value, of_candidate.value), "{name}: {its:?} {of_candidate:?}");
        }
        assert_eq!((of_best.std_m, of_best.failure_risk), (std_m, failure_risk), "{name}");
        assert_eq!(of_best.mean_geodesic_m, mean_geodesic_m, "{name}");
        let offered = explained.iter().filter(|one| one.excluded.is_none());
        let highest = offered.map(|one| one.score).fold(f64::NEG_INFINITY, f64::max);
        assert!(near(highest, score), "{name}: {highest} {score}");

        let count = |reason| explained.iter().filter(|one| one.excluded == Some(reason)).count() as u32;
        let counted = Excluded {
            already_certain: count(Exclusion::AlreadyCertain),
            no_confident_neighbour: count(Exclusion::NoConfidentNeighbour),
            keep_out: count(Exclusion::KeepOut),
            recently_failed: count(Exclusion::RecentlyFailed),
            unreachable: count(Exclusion::Unreachable),
            leased: count(Exclusion::Leased),
        };
        assert!(!candidates[0].relaxed, "{name}: thresholds that were lowered are counted otherwise");
        assert_eq!(counted, excluded, "{name}");
        seen.extend(explained.iter().filter_map(|one| one.excluded));
    }
    for reason in [
        Exclusion::AlreadyCertain,
        Exclusion::NoConfidentNeighbour,
        Exclusion::KeepOut,
        Exclusion::RecentlyFailed,
        Exclusion::Unreachable,
        Exclusion::Leased,
        Exclusion::NotCompared,
    ] {
        assert!(seen.contains(&reason), "{reason:?}");
    }
}

#[test]
fn only_what_is_asked_is_explained_and_the_candidates_are_the_same() {
    let (_, state) = explore(&Object::sphere(), settings().next().unwrap(), 2);
    let (without, with) = (proposed(&state, Vec::new()), proposed(&state, vec![7, 3, 7, 1_000_000]));
    assert_eq!((without.candidates, without.explained.len()), (with.candidates, 0));
    assert!(with.explained.iter().map(|one| one.vertex).eq([7, 3, 7]), "a vertex that is none is left out");
}
