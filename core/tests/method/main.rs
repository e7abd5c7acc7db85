//! The whole method against analytic truth, its symmetries and degenerate input.

#![expect(clippy::unwrap_used, reason = "a test that meets nothing where something must be has failed")]

mod arms;
mod explained;
mod faults;
mod guarantees;
mod hostile;
mod object;
mod robot;

use palpate_core::config::{Axes, Config, DeclaredSymmetry, Method, Settings, StopRule, Strategy};
use palpate_core::error::Error;
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Outcome, Pad, Sweep, Target, VisualPrior, Wrench,
};
use palpate_core::exploration::{Candidate, KeepOut, ProposalRequest};
use palpate_core::geometry::{Point, Pose, Vector};
use palpate_core::reconstruction::{Reconstruction, StopReason};

use crate::object::{METHODS, Object, best, explore, of};

#[test]
fn a_sphere_is_recovered_from_a_cap_and_thirty_touches() {
    for (method, most_m) in [(Method::Paper, 5e-4), (Method::Palpate, 2e-4), (Method::Gpis, 2e-3)] {
        let (_, state) = explore(&Object::sphere(), of(method), 30);
        let error_m = Object::sphere().mean_error_m(&state);
        assert!(error_m < most_m, "{method:?}: {error_m}");
        let centre = state.template_centre().unwrap();
        assert!((centre - Point::new(0.5, -0.1, 0.2)).norm() < 0.01, "{method:?}: {centre}");
    }
}

#[test]
fn a_rotated_ellipsoid_is_recovered_from_a_cap_and_thirty_touches() {
    let object = Object::rotated_ellipsoid();
    let free = Settings { template_axes: Axes::Free, ..of(Method::Paper) };
    for (settings, most_m) in
        [(of(Method::Paper), 1e-3), (free, 1e-3), (of(Method::Palpate), 4e-4), (of(Method::Gpis), 1e-3)]
    {
        let error_m = object.mean_error_m(&explore(&object, settings.clone(), 30).1);
        assert!(error_m < most_m, "{:?} {:?}: {error_m}", settings.method, settings.template_axes);
    }
}

#[test]
fn the_seed_alone_decides_what_is_random() {
    let candidates = |strategy, seed| {
        let settings = Settings { strategy, seed, ..Settings::default() };
        explore(&Object::sphere(), settings, 3).1.propose(&best()).candidates[0].vertex
    };
    for strategy in [Strategy::MinUncertainty, Strategy::Uniform, Strategy::Random] {
        assert_eq!(candidates(strategy, 1), candidates(strategy, 1));
        let distinct: std::collections::HashSet<u32> =
            (0..8).map(|seed| candidates(strategy, seed)).collect();
        assert!(distinct.len() > 3, "{strategy:?}");
    }
}

#[test]
fn the_terms_of_a_score_add_up_to_it_and_candidates_lie_apart() {
    let request = ProposalRequest::best(6).with_tool_at(Point::new(0.9, 0.3, 0.4)).unwrap();
    let settings = METHODS.map(|method| Settings { alpha_travel: 0.5, ..of(method) });
    let gain = Settings { strategy: Strategy::ExpectedGain, ..settings[1].clone() };
    for settings in settings.into_iter().chain([gain]) {
        let state = explore(&Object::sphere(), settings, 4).1;
        let candidates = state.propose(&request).candidates;
        assert_eq!(candidates.len(), 6);
        assert!(candidates.iter().all(|candidate| candidate.terms.iter().any(|term| term.term == "travel")));
        assert_sound_candidates(&candidates);
    }
}

#[test]
fn the_heavier_the_way_weighs_the_nearer_to_the_tool_is_the_next_candidate() {
    for strategy in [Strategy::Proactive, Strategy::ExpectedGain] {
        let proposed = |alpha_travel, request: &ProposalRequest| {
            let settings = Settings { strategy, alpha_travel, ..of(Method::Palpate) };
            // The touches before are the same: they were asked for without a tool.
            let (_, state) = explore(&Object::sphere(), settings, 6);
            state.propose(request).candidates[0].probe_start
        };
        let alone = proposed(0.0, &best());
        // On the other side of the object from what is best without a way.
        let tool = Point::from(2.0 * Object::sphere().centre().coords - alone.coords);
        let request = best().with_tool_at(tool).unwrap();
        let paths = [0.0, 0.3, 3.0, 300.0].map(|weight| (proposed(weight, &request) - tool).norm());
        assert!(paths.is_sorted_by(|a, b| a >= b), "{strategy:?} {paths:?}");
        assert!(paths[3] < paths[0] - 0.01, "{strategy:?} {paths:?}");
        assert_eq!(proposed(300.0, &best()), alone, "without a tool there is no path to weigh");
    }
}

#[test]
fn expected_gain_recovers_an_ellipsoid_and_hardly_fails() {
    let settings = Settings { strategy: Strategy::ExpectedGain, ..of(Method::Palpate) };
    let (_, state) = explore(&Object::rotated_ellipsoid(), settings, 30);
    let (error_m, failures) = (Object::rotated_ellipsoid().mean_error_m(&state), state.stats().failures);
    assert!(error_m < 0.5e-3 && failures <= 4, "{error_m} {failures}");
}

fn assert_sound_candidates(candidates: &[Candidate]) {
    for (place, candidate) in candidates.iter().enumerate() {
        let sum: f64 = candidate.terms.iter().map(|term| term.weight * term.value).sum();
        assert!((sum - candidate.score).abs() < 1e-12);
        assert!(!candidate.why.is_empty());
        assert!(((candidate.probe_start - candidate.probe_end).norm() - 0.03).abs() < 1e-12);
        for other in &candidates[..place] {
            assert!((other.point - candidate.point).norm() >= 0.010 && other.score >= candidate.score);
        }
    }
}

#[test]
fn no_candidate_enters_what_is_kept_out() {
    let (_, state) = explore(&Object::sphere(), Settings::default(), 0);
    let above = KeepOut::half_space(Vector::z(), 0.2).unwrap();
    let ball = KeepOut::ball(Point::new(0.5, -0.1, 0.245), 0.02).unwrap();
    let proposal = state.propose(&ProposalRequest::best(20).keeping_out_of(vec![above, ball]));
    assert!(proposal.excluded.keep_out > 0 && !proposal.candidates.is_empty());
    for candidate in proposal.candidates {
        assert!(candidate.probe_start.z.min(candidate.probe_end.z) >= 0.2 - 1e-12);
        assert!((candidate.probe_start - Point::new(0.5, -0.1, 0.245)).norm() >= 0.02);
    }
}

/// A touch at a point, with a pose and a wrench of its own.
fn touch_at(point: Point, wrench: Wrench) -> Evidence {
    let pose = Pose::translation(point.x, point.y, point.z);
    let contact = Contact::new(pose, wrench, Pad::new(0.009).unwrap(), ContactDetail::default()).unwrap();
    Evidence::Attempt(Attempt { target: None, outcome: Outcome::Contact(contact) })
}

fn assert_sound(state: &Reconstruction) {
    let surface = state.surface().unwrap();
    assert!(surface.mesh.vertices.iter().all(|v| v.coords.iter().all(|x| x.is_finite())));
    assert!(surface.uncertainty.iter().all(|u| (0.0..=1.0).contains(u)));
    for candidate in state.propose(&ProposalRequest::best(3)).candidates {
        assert!(candidate.score.is_finite() && candidate.normal.iter().all(|x| x.is_finite()));
    }
}

#[test]
fn degenerate_clouds_give_a_sound_surface() {
    let flat: Vec<Point> =
        (0..25).map(|i| Point::new(0.01 * f64::from(i % 5), 0.01 * f64::from(i / 5), 0.3)).collect();
    let four = vec![flat[0], flat[4], flat[20], Point::new(0.02, 0.02, 0.31)];
    let repeated = [four.clone(), four.clone(), four.clone()].concat();
    for points in [flat, four, repeated] {
        for viewpoint in [Some(Point::new(0.0, 0.0, 0.9)), None, points.first().copied()] {
            let prior = VisualPrior::new(points.clone(), None, viewpoint).unwrap();
            for method in METHODS {
                let state = Reconstruction::new(Config::new(of(method)).unwrap());
                let (state, _) = state.absorb(&Evidence::VisualPrior(prior.clone())).unwrap();
                assert_sound(&state);
            }
        }
    }
}

#[test]
fn degenerate_touches_give_a_sound_surface() {
    for method in METHODS {
        let (_, state) = explore(&Object::sphere(), of(method), 2);
        assert_sound_after_odd_touches(state);
    }
}

fn assert_sound_after_odd_touches(mut state: Reconstruction) {
    let centre = state.template_centre().unwrap();
    let push = Wrench { force: Vector::new(0.0, 0.0, -5.0), torque: Vector::zeros() };
    for (point, wrench) in [
        (centre, push),
        (centre, push),
        (Point::new(0.5, -0.1, 0.2), Wrench::default()),
        (Point::new(3.0, 0.0, 0.0), push),
        (Point::new(-9e3, 9e3, 9e3), push),
    ] {
        (state, _) = state.absorb(&touch_at(point, wrench)).unwrap();
        assert_sound(&state);
    }
}

#[test]
fn a_touch_before_anything_was_seen_is_refused() {
    let state = Reconstruction::new(Config::default());
    let result = state.absorb(&touch_at(Point::origin(), Wrench::default()));
    assert_eq!(result.unwrap_err(), Error::NoVisualPrior);
    assert!(state.surface().is_none() && state.propose(&best()).candidates.is_empty());
}

#[test]
fn a_place_that_failed_is_left_alone_until_three_contacts_succeeded_and_by_the_paper_s_method_for_good() {
    assert_eq!(taboo_after_three_contacts(Method::Palpate), 0);
    assert!(taboo_after_three_contacts(Method::Paper) > 0);
}

/// How many vertices are left out after a failure and three contacts.
fn taboo_after_three_contacts(method: Method) -> u32 {
    let (_, mut state) = explore(&Object::sphere(), of(method), 0);
    let miss = |candidate: &Candidate| {
        let sweep = Sweep::new(candidate.probe_start, candidate.probe_end, 0.0).unwrap();
        let target = Target::new(candidate.point, candidate.normal.into_inner()).unwrap();
        Evidence::Attempt(Attempt { target: Some(target), outcome: Outcome::NoContact(sweep) })
    };
    let failed = state.propose(&best()).candidates[0].clone();
    (state, _) = state.absorb(&miss(&failed)).unwrap();
    let next = state.propose(&best());
    assert!(next.excluded.recently_failed > 0);
    assert!((next.candidates[0].point - failed.point).norm() >= 0.010);
    for _ in 0..3 {
        assert!(state.propose(&best()).excluded.recently_failed > 0);
        let touch = Object::sphere().touch(&state.propose(&best()).candidates[0]);
        (state, _) = state.absorb(&touch).unwrap();
    }
    state.propose(&best()).excluded.recently_failed
}

#[test]
fn stop_rules_are_told_apart() {
    let stop_after = |rule: fn(&mut Settings)| {
        let mut settings = Settings::default();
        rule(&mut settings);
        explore(&Object::sphere(), settings, 5).1.stop_reason()
    };
    assert_eq!(stop_after(|_| ()), None);
    assert_eq!(stop_after(|s| s.stop.max_attempts = Some(5)), Some(StopReason::Budget));
    assert_eq!(stop_after(|s| s.stop.mean_uncertainty_below = Some(0.99)), Some(StopReason::Coverage));
    let blind =
        Object { semi_axes: Vector::repeat(1e-3), base_from_object: Pose::translation(9.0, 9.0, 9.0) };
    let (_, mut state) = explore(
        &Object::sphere(),
        Settings {
            stop: StopRule { max_consecutive_failures: Some(3), ..Default::default() },
            ..Settings::default()
        },
        0,
    );
    for _ in 0..3 {
        assert_eq!(state.stop_reason(), None);
        (state, _) = state.absorb(&blind.touch(&state.propose(&best()).candidates[0])).unwrap();
    }
    assert_eq!(state.stop_reason(), Some(StopReason::Stalled));
}

#[test]
fn an_object_that_moved_away_is_looked_for_in_a_new_place_every_time() {
    for strategy in [Strategy::Proactive, Strategy::ExpectedGain] {
        let settings = Settings { strategy, ..Settings::default() };
        let (_, mut state) = explore(&Object::sphere(), settings, 0);
        let gone =
            Object { semi_axes: Vector::repeat(1e-3), base_from_object: Pose::translation(9.0, 9.0, 9.0) };
        let mut tried: Vec<Point> = Vec::new();
        let first = state.surface().unwrap().mesh.clone();
        for _ in 0..50 {
            assert_eq!(state.stop_reason(), None, "{strategy:?} after {}", tried.len());
            let candidate = state.propose(&best()).candidates[0].clone();
            assert!(tried.iter().all(|before| (before - candidate.point).norm() > 1e-3));
            tried.push(candidate.point);
            (state, _) = state.absorb(&gone.touch(&candidate)).unwrap();
            assert_sound(&state);
        }
        assert_eq!(state.stop_reason(), Some(StopReason::Stalled));
        assert_ne!(state.surface().unwrap().mesh, first);
    }
}

#[test]
fn a_miss_changes_the_estimate_and_the_paper_s_does_not() {
    for method in METHODS {
        let (_, state) = explore(&Object::sphere(), of(method), 0);
        let aside =
            Object { semi_axes: Vector::repeat(1e-3), base_from_object: Pose::translation(9.0, 9.0, 9.0) };
        let (next, _) = state.absorb(&aside.touch(&state.propose(&best()).candidates[0])).unwrap();
        let changed = next.surface() != state.surface();
        assert_eq!(changed, method != Method::Paper);
    }
}

#[test]
fn deviations_cover_the_error_of_a_known_shape() {
    let object = Object::rotated_ellipsoid();
    let (_, state) = explore(&object, of(Method::Palpate), 15);
    let surface = state.surface().unwrap();
    let std_m = surface.std_m.as_ref().unwrap();
    assert!(std_m.iter().all(|s| s.is_finite() && *s > 0.0));
    let covered =
        surface.mesh.vertices.iter().zip(std_m).filter(|(v, s)| object.error_m(v) <= 2.0 * **s).count();
    assert!(covered as f64 > 0.9 * std_m.len() as f64, "{covered} of {}", std_m.len());
    let candidate = &state.propose(&best()).candidates[0];
    assert!(candidate.failure_risk.is_some_and(|risk| (0.0..=1.0).contains(&risk)));
}

#[test]
fn a_declared_symmetry_is_taken_and_the_paper_s_method_refuses_one() {
    let settings = Settings { symmetry: Some(DeclaredSymmetry::Revolution), ..of(Method::Palpate) };
    let (_, state) = explore(&Object::sphere(), settings, 25);
    assert!(Object::sphere().mean_error_m(&state) < 1e-3);
    let settings = Settings { symmetry: Some(DeclaredSymmetry::Mirror), ..of(Method::Paper) };
    assert_eq!(Config::new(settings).unwrap_err().field, "symmetry");
}
