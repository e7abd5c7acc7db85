//! What matters to real arms: rejections and promises, several pads, the rim of a pad.

use palpate_core::config::{Config, Method, Settings, Strategy};
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Outcome, Pad, RejectReason, Target, Wrench,
};
use palpate_core::exploration::{Candidate, KeepOut, MountedPad, ProposalRequest};
use palpate_core::geometry::{Point, Pose, Vector};
use palpate_core::reconstruction::Reconstruction;

use crate::object::{METHODS, Object, best, explore, of};

fn target(candidate: &Candidate) -> Target {
    Target::new(candidate.point, candidate.normal.into_inner()).unwrap()
}

fn rejected(candidate: &Candidate, reason: RejectReason) -> Evidence {
    Evidence::Attempt(Attempt { target: Some(target(candidate)), outcome: Outcome::Rejected(reason) })
}

fn distance_m(a: &Candidate, b: &Candidate) -> f64 {
    (a.point - b.point).norm()
}

/// Every method with every strategy that it takes.
pub(crate) fn settings() -> impl Iterator<Item = Settings> {
    use Strategy::{ExpectedGain, MinUncertainty, Proactive, Random, Uniform};
    let strategies = [Proactive, MinUncertainty, Uniform, Random, ExpectedGain];
    let pairs = METHODS.into_iter().flat_map(move |method| strategies.map(|strategy| (method, strategy)));
    pairs
        .map(|(method, strategy)| Settings { strategy, ..of(method) })
        .filter(|settings| Config::new(settings.clone()).is_ok())
}

#[test]
fn a_rejected_place_is_left_alone_by_every_strategy_and_is_no_failure_of_the_estimate() {
    for settings in settings() {
        let (_, before) = explore(&Object::sphere(), settings.clone(), 2);
        let failures = before.ledger().failures.len();
        let mut state = before;
        let mut refused: Vec<Candidate> = Vec::new();
        for _ in 0..4 {
            let next = state.propose(&best()).candidates[0].clone();
            assert!(
                refused.iter().all(|earlier| distance_m(earlier, &next) >= 0.030),
                "{:?} {:?}",
                settings.method,
                settings.strategy
            );
            (state, _) = state.absorb(&rejected(&next, RejectReason::Operator)).unwrap();
            refused.push(next);
        }
        assert!(state.propose(&best()).excluded.unreachable > 0);
        assert_eq!(state.ledger().failures.len(), failures);
        assert_eq!((state.stats().rejected, state.stats().consecutive_failures >= 4), (4, true));
    }
}

#[test]
fn a_timeout_is_forgotten_after_three_attempts_and_a_rejection_moves_no_surface() {
    let (_, mut state) = explore(&Object::sphere(), Settings::default(), 1);
    let first = state.propose(&best()).candidates[0].clone();
    let surface = state.surface();
    (state, _) = state.absorb(&rejected(&first, RejectReason::Timeout)).unwrap();
    for attempt in 1..=3 {
        assert_eq!(state.surface(), surface);
        assert!(state.propose(&best()).excluded.unreachable > 0, "{attempt}");
        let next = state.propose(&best()).candidates[0].clone();
        assert!(distance_m(&first, &next) >= 0.010, "{attempt}");
        // Of no candidate, so that only the number of attempts grows.
        let nowhere = Attempt { target: None, outcome: Outcome::Rejected(RejectReason::Timeout) };
        (state, _) = state.absorb(&Evidence::Attempt(nowhere)).unwrap();
    }
    let again = state.propose(&best());
    assert_eq!((again.excluded.unreachable, &again.candidates[0].point), (0, &first.point));
}

#[test]
fn what_the_housing_met_is_in_the_way_of_places_within_25_mm_for_ten_attempts() {
    let (_, mut state) = explore(&Object::sphere(), Settings::default(), 1);
    let first = state.propose(&best()).candidates[0].clone();
    let outcome = Outcome::InvalidContact(Pose::new(first.probe_start.coords, Vector::zeros()));
    let attempt = Attempt { target: Some(target(&first)), outcome };
    (state, _) = state.absorb(&Evidence::Attempt(attempt)).unwrap();
    for attempt in 1..=10 {
        let next = state.propose(&best());
        assert!(next.excluded.unreachable > 0, "{attempt}");
        assert!(distance_m(&first, &next.candidates[0]) >= 0.025, "{attempt}");
        let nowhere = Attempt { target: None, outcome: Outcome::Rejected(RejectReason::Timeout) };
        (state, _) = state.absorb(&Evidence::Attempt(nowhere)).unwrap();
    }
    assert_eq!(state.propose(&best()).excluded.unreachable, 0);
}

#[test]
fn a_session_of_which_all_was_rejected_has_nothing_left() {
    let (_, mut state) = explore(&Object::sphere(), Settings::default(), 0);
    while let Some(next) = state.propose(&best()).candidates.first().cloned() {
        (state, _) = state.absorb(&rejected(&next, RejectReason::Operator)).unwrap();
        assert!(state.stats().attempts < 100);
    }
    assert!(state.is_exhausted());
}

#[test]
fn promised_places_are_left_to_others_by_the_size_of_the_pads() {
    let (_, state) = explore(&Object::sphere(), Settings::default(), 2);
    let pad = |half_side_m| vec![MountedPad { tool_from_sensor: Pose::identity(), half_side_m }];
    for (pads, radius_m) in [(Vec::new(), 0.030), (pad(0.009), 0.0354), (pad(0.014), 0.0495)] {
        let request = ProposalRequest::best(5).for_pads(pads);
        let promised = state.propose(&request).candidates[0].point;
        let others = state.propose(&request.leaving(vec![promised]));
        assert!(others.excluded.leased > 0 && others.candidates.len() == 5);
        for other in others.candidates {
            assert!((other.point - promised).norm() >= radius_m, "{radius_m}");
        }
    }
}

#[test]
fn the_second_best_is_a_real_alternative_and_the_best_is_the_same() {
    for settings in settings() {
        let name = format!("{:?} {:?}", settings.method, settings.strategy);
        let (_, state) = explore(&Object::sphere(), settings, 3);
        let alone = state.propose(&best()).candidates;
        let two = state.propose(&ProposalRequest::best(2)).candidates;
        assert_eq!(alone, two[..1]);
        let vertices = state.surface().unwrap().mesh.vertices;
        let (low, high) =
            vertices.iter().fold((vertices[0], vertices[0]), |(low, high), v| (low.inf(v), high.sup(v)));
        let apart_m = distance_m(&two[0], &two[1]);
        // A quarter of the diagonal, or half of that where a strategy ranks too few vertices; the box along the
        // work frame's axes is a little another one.
        assert!(apart_m >= 0.12 * (high - low).norm(), "{name}: {apart_m}");
    }
}

fn two_pads(half_sides_m: [f64; 2]) -> Vec<MountedPad> {
    let side = Pose::new(Vector::x() * 0.03, Vector::y() * std::f64::consts::FRAC_PI_2);
    let [end, side_m] = half_sides_m;
    vec![
        MountedPad { tool_from_sensor: Pose::identity(), half_side_m: end },
        MountedPad { tool_from_sensor: side, half_side_m: side_m },
    ]
}

/// Corners of a candidate's pad, all along its approach, in the orientation that the tool is told.
fn swept_corners(candidate: &Candidate, pads: &[MountedPad]) -> Vec<Point> {
    let pad = &pads[candidate.approach.pad];
    let sensor = candidate.approach.base_from_tool * pad.tool_from_sensor;
    let way = candidate.probe_end - candidate.probe_start;
    let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let steps = (0..=10).map(|step| way * (f64::from(step) / 10.0));
    steps
        .flat_map(|moved| {
            corners.map(|(x, y)| sensor * Point::new(x * pad.half_side_m, y * pad.half_side_m, 0.0) + moved)
        })
        .collect()
}

#[test]
fn no_corner_of_the_pad_that_touches_enters_the_table_or_a_ball_anywhere_on_its_way() {
    for method in [Method::Palpate, Method::Paper] {
        let (_, state) = explore(&Object::rotated_ellipsoid(), of(method), 3);
        let (table, obstacle) = (0.09, Point::new(0.42, 0.18, 0.18));
        let regions = || {
            let above = KeepOut::half_space(Vector::z(), table).unwrap();
            vec![above, KeepOut::ball(obstacle, 0.02).unwrap()]
        };
        let mut used = [false; 2];
        for pads in [two_pads([0.009, 0.009]), two_pads([0.004, 0.02]), two_pads([0.02, 0.004])] {
            for held in [None, Some(Pose::rotation(Vector::new(2.0, 1.0, -0.4)))] {
                let mut request = ProposalRequest::best(64).for_pads(pads.clone()).keeping_out_of(regions());
                if let Some(held) = &held {
                    request = request.with_tool(held).unwrap();
                }
                let proposal = state.propose(&request);
                assert!(proposal.excluded.keep_out > 0 && proposal.candidates.len() > 3);
                for candidate in &proposal.candidates {
                    used[candidate.approach.pad] = true;
                    for corner in swept_corners(candidate, &pads) {
                        assert!(corner.z >= table - 1e-9, "{corner}");
                        assert!((corner - obstacle).norm() >= 0.02 - 1e-9, "{corner}");
                    }
                }
            }
        }
        assert_eq!(used, [true; 2]);
    }
}

#[test]
fn two_contacts_of_one_attempt_are_one_attempt_and_two_attractors() {
    for method in METHODS {
        let (_, state) = explore(&Object::sphere(), of(method), 1);
        let next = state.propose(&best()).candidates[0].clone();
        let Evidence::Attempt(Attempt { target, outcome: Outcome::Contact(aimed) }) =
            Object::sphere().touch(&next)
        else {
            panic!("a contact")
        };
        // The other finger closes on the opposite side.
        let centre = Object::sphere().centre();
        let across = Pose::from_parts(
            (centre + (centre - aimed.point())).coords.into(),
            nalgebra::UnitQuaternion::rotation_between(&Vector::z(), &next.normal).unwrap(),
        );
        let pull = Wrench { force: Vector::new(0.0, 0.0, 3.0), torque: Vector::zeros() };
        let detail = ContactDetail { uncertainty: Some(0.17), ..ContactDetail::default() };
        let other = Contact::new(across, pull, Pad::new(0.009).unwrap(), detail).unwrap();
        let both = Outcome::Contacts { aimed: aimed.clone(), others: vec![other.clone()] };
        let (two, update) = state.absorb(&Evidence::Attempt(Attempt { target, outcome: both })).unwrap();
        let (one, alone) =
            state.absorb(&Evidence::Attempt(Attempt { target, outcome: Outcome::Contact(aimed) })).unwrap();
        assert_eq!((two.stats().attempts, two.stats().contacts), (2, one.stats().contacts), "{method:?}");
        assert_eq!(two.attractors().len(), one.attractors().len() + 1);
        assert_eq!(update.contact_uncertainty, alone.contact_uncertainty);
        assert_eq!(update.warnings.len(), alone.warnings.len() + 1, "the second one pulls");
        let far_m = |state: &Reconstruction| {
            let vertices = state.surface().unwrap().mesh.vertices;
            vertices.iter().map(|v| (v - other.point()).norm()).fold(f64::INFINITY, f64::min)
        };
        assert!(far_m(&two) < 0.004, "{method:?}: {}", far_m(&two));
    }
}
