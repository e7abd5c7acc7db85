//! What holds of every session: rotated scenes, replay, fingerprints, budgets, free space.

use nalgebra::Rotation3;
use palpate_core::config::{Config, Method, Settings, StopRule, Strategy};
use palpate_core::evidence::{Attempt, Evidence, Outcome, Sweep};
use palpate_core::geometry::{Point, Pose, SurfaceIndex, Vector};
use palpate_core::reconstruction::Reconstruction;

use crate::object::{METHODS, Object, best, explore, of};

#[test]
fn a_rigid_motion_of_the_input_moves_mesh_and_candidate_by_the_same_motion() {
    let turn = Rotation3::from_euler_angles(0.8, -1.9, 2.6);
    let motion = Pose::from_parts(Vector::new(-0.7, 1.1, 0.4).into(), turn.into());
    // These work in the frame of their first view, where nothing has moved.
    for method in [Method::Palpate, Method::Gpis] {
        assert_moves_with(&motion, &of(method), 1e-9);
    }
}

#[test]
fn the_papers_template_has_the_axes_of_the_frame_so_only_a_translation_moves_all_by_the_same() {
    assert_moves_with(&Pose::translation(-0.7, 1.1, 0.4), &of(Method::Paper), 1e-6);
}

/// Explores an object and the same object moved, and compares.
fn assert_moves_with(motion: &Pose, settings: &Settings, tolerance_m: f64) {
    let object = Object::rotated_ellipsoid();
    let method = settings.method;
    for attempts in [0, 1, 8] {
        let (_, here) = explore(&object, settings.clone(), attempts);
        let (_, there) = explore(&object.moved(motion), settings.clone(), attempts);
        let vertices = |state: &Reconstruction| state.surface().unwrap().mesh.vertices.clone();
        let (a, b) = (vertices(&here), vertices(&there));
        assert_eq!(a.len(), b.len());
        for (here, there) in a.iter().zip(&b) {
            let off_m = (motion * here - there).norm();
            assert!(off_m < tolerance_m, "{method:?}: {off_m} after {attempts} touches");
        }
        let (a, b) = (&here.propose(&best()).candidates[0], &there.propose(&best()).candidates[0]);
        assert_eq!(a.vertex, b.vertex);
        assert!((motion * a.point - b.point).norm() < tolerance_m);
        assert!((motion * a.normal.into_inner() - b.normal.into_inner()).norm() < 1e-2);
    }
}

#[test]
fn a_quarter_turn_of_the_scene_turns_thirty_touches_by_the_same_quarter() {
    // A body that is round about one axis, where rounding used to decide which way its faces lie.
    let upright = Object {
        semi_axes: Vector::new(0.04, 0.04, 0.08),
        base_from_object: Pose::translation(0.5, -0.25, 0.125),
    };
    let quarter = Pose::rotation(Vector::x() * std::f64::consts::FRAC_PI_2);
    let (_, here) = explore(&upright, of(Method::Palpate), 30);
    let (_, there) = explore(&upright.moved(&quarter), of(Method::Palpate), 30);
    let (a, b) = (here.surface().unwrap().mesh, there.surface().unwrap().mesh);
    for (here, there) in a.vertices.iter().zip(&b.vertices) {
        assert!((quarter * here - there).norm() < 1e-9);
    }
    assert_eq!(here.stats(), there.stats());
}

#[test]
fn the_fingerprint_covers_what_the_next_step_rests_on() {
    let (log, state) = explore(&Object::sphere(), of(Method::Palpate), 6);
    // A miss far outside moves nothing, but it is free space from now on.
    let far = Point::new(3.0, 0.0, 0.0);
    let sweep = Sweep::new(far, far + Vector::x() * 0.02, 0.0).unwrap();
    let miss = Evidence::Attempt(Attempt { target: None, outcome: Outcome::NoContact(sweep) });
    let missed = state.absorb(&miss).unwrap().0;
    assert_ne!(missed.digest(), state.digest());
    // The same again with another radius differs in nothing else.
    let wide = Sweep::new(far, far + Vector::x() * 0.02, 0.009).unwrap();
    let wide = Evidence::Attempt(Attempt { target: None, outcome: Outcome::NoContact(wide) });
    assert_ne!(state.absorb(&wide).unwrap().0.digest(), missed.digest());
    // Without one touch before the last, an estimate that ends up nearly the same is another state.
    let without = log.iter().enumerate().filter(|(k, _)| *k != 2).map(|(_, evidence)| evidence);
    let fold = |state: Reconstruction, evidence: &Evidence| state.absorb(evidence).unwrap().0;
    let other = without.fold(Reconstruction::new(state.config().clone()), fold);
    assert_ne!(other.digest(), state.digest());
}

#[test]
fn what_a_wide_probe_has_swept_holds_the_surface_back_further_out() {
    // The axis of the path passes outside of what the estimate guesses on the far side; its rim inside.
    let (_, state) = explore(&Object::sphere(), of(Method::Palpate), 0);
    let mesh = state.surface().unwrap().mesh;
    let camera = Object::sphere().camera();
    let off = |v: &usize| (mesh.vertices[*v] - camera).norm();
    let farthest = (0..mesh.vertices.len()).max_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
    let (vertex, normal) = (mesh.vertices[farthest], mesh.vertex_normals()[farthest].into_inner());
    let along = normal.cross(&Vector::x()).normalize() * 0.03;
    let axis = vertex + normal * 0.012;
    let volume = |radius_m: f64| {
        let sweep = Sweep::new(axis - along, axis + along, radius_m).unwrap();
        let miss = Evidence::Attempt(Attempt { target: None, outcome: Outcome::NoContact(sweep) });
        state.absorb(&miss).unwrap().0.surface().unwrap().mesh.volume()
    };
    let (thin, wide) = (volume(0.0), volume(0.025));
    assert!(wide < 0.98 * thin, "{wide} {thin}");
}

#[test]
fn the_budget_changes_the_advice_and_never_the_estimate() {
    let surface = |max_attempts| {
        let stop = StopRule { max_attempts, ..StopRule::default() };
        let (_, state) = explore(&Object::rotated_ellipsoid(), Settings { stop, ..Settings::default() }, 10);
        (state.surface(), state.propose(&best()))
    };
    assert_eq!(surface(Some(10)), surface(None));
    assert_eq!(surface(Some(1000)), surface(None));
}

#[test]
fn fit_rms_is_the_distance_to_the_surface_and_not_to_the_template() {
    // A template of one ellipsoid is far from a box; the surface meets its touches all the same.
    for method in METHODS {
        let (_, state) = explore(&Object::rotated_ellipsoid(), of(method), 12);
        let surface = state.surface().unwrap();
        let index = SurfaceIndex::new(&surface.mesh).unwrap();
        let stated_m = state.stats().fit_rms_m;
        let attractors = &state.attractors();
        // The paper's method works in the session's frame, so its ledger can be compared directly.
        if method == Method::Paper {
            let squares: f64 = attractors.iter().map(|a| index.closest(&a.point).distance_m.powi(2)).sum();
            let true_m = (squares / attractors.len() as f64).sqrt();
            assert!((stated_m - true_m).abs() < 1e-4, "{stated_m} {true_m}");
        }
        assert!(stated_m < 5e-4, "{method:?}: {stated_m}");
    }
}

#[test]
fn the_fold_of_the_log_is_the_live_state_bit_for_bit() {
    let strategies = [Strategy::Proactive, Strategy::MinUncertainty, Strategy::Uniform, Strategy::Random];
    let of_both = METHODS.into_iter().flat_map(|method| strategies.map(|strategy| (method, strategy)));
    for (method, strategy) in of_both.chain([(Method::Palpate, Strategy::ExpectedGain)]) {
        let settings = Settings { strategy, seed: 7, ..of(method) };
        let (log, live) = explore(&Object::rotated_ellipsoid(), settings, 12);
        let replayed = log.iter().fold(Reconstruction::new(live.config().clone()), |state, evidence| {
            state.absorb(evidence).unwrap().0
        });
        assert_eq!(replayed.digest(), live.digest());
        assert_eq!(replayed.surface(), live.surface());
        assert_eq!(replayed.propose(&best()), live.propose(&best()));
    }
}

#[test]
fn a_finer_mesh_gives_the_same_template() {
    let object = Object::rotated_ellipsoid();
    for method in METHODS {
        let (log, coarse) = explore(&object, of(method), 6);
        let fine = Config::new(Settings { icosphere_subdivisions: 5, ..of(method) }).unwrap();
        let fold = |state: Reconstruction, evidence: &Evidence| state.absorb(evidence).unwrap().0;
        let fine = log.iter().fold(Reconstruction::new(fine), fold);
        let centre = |state: &Reconstruction| state.template_centre().unwrap();
        // An offset of the view is estimated on the mesh, and the template follows it.
        assert!((centre(&coarse) - centre(&fine)).norm() < 1e-4, "{} {}", centre(&coarse), centre(&fine));
        let (coarse_u, fine_u) = (coarse.stats().mean_uncertainty, fine.stats().mean_uncertainty);
        assert!((coarse_u - fine_u).abs() < 0.03, "{coarse_u} {fine_u}");
    }
}
