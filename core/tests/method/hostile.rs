//! Numbers that nobody means: they cost what ordinary ones cost, and leave a sound surface.

use palpate_core::config::{Config, Method};
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Outcome, Sweep, VisualPrior, Wrench,
};
use palpate_core::geometry::{Point, Pose, Vector};
use palpate_core::reconstruction::{Reconstruction, Update};
use palpate_core::warning::WarningKind;

use crate::object::{METHODS, Object, explore, of, point_pad};
use crate::{assert_sound, touch_at};

const PUSH: Wrench = Wrench { force: Vector::new(0.0, 0.0, -5.0), torque: Vector::new(0.0, 0.0, 0.0) };

fn missed(state: &Reconstruction, from: Point, to: Point) -> (Reconstruction, Update) {
    let sweep = Sweep::new(from, to, 0.009).unwrap();
    let outcome = Outcome::NoContact(sweep);
    state.absorb(&Evidence::Attempt(Attempt { target: None, outcome })).unwrap()
}

fn warns(update: &Update, kind: WarningKind) -> bool {
    update.warnings.iter().any(|warning| warning.kind == kind)
}

#[test]
fn a_way_that_passes_far_from_the_object_says_nothing_about_it_however_long_it_is() {
    for method in METHODS {
        let (_, state) = explore(&Object::sphere(), of(method), 3);
        let at = |x: f64, y: f64| Object::sphere().centre() + Vector::new(x, y, 0.3);
        let (short, told) = missed(&state, at(-0.2, 30.0), at(0.2, 30.0));
        assert!(!warns(&told, WarningKind::LongSweep), "{method:?}");
        let (long, told) = missed(&state, at(-9e3, 30.0), at(9e3, 30.0));
        assert!(short.has_surface_of(&long), "{method:?}");
        assert!(warns(&told, WarningKind::LongSweep), "{method:?}: {:?}", told.warnings);
    }
}

#[test]
fn a_way_of_kilometres_through_the_object_is_learnt_from_and_warned_about() {
    let (_, state) = explore(&Object::sphere(), of(Method::Palpate), 3);
    // It grazes the object 5 mm inside of its surface.
    let at = |x: f64| Object::sphere().centre() + Vector::new(x, 0.0, -0.040);
    let (mut after, mut told) = missed(&state, at(-9e3), at(9e3));
    assert!(told.max_vertex_move_m > 0.0 && warns(&told, WarningKind::LongSweep));
    for _ in 0..3 {
        (after, told) = missed(&after, at(-9e3), at(9e3));
    }
    assert_sound(&after);
    let message = &told.warnings.iter().find(|w| w.kind == WarningKind::LongSweep).unwrap().message;
    assert!(message.starts_with("no_contact: the way of the probe is 18000.0 m long"), "{message}");
}

#[test]
fn an_approach_from_kilometres_away_is_warned_about_by_its_field() {
    let (_, state) = explore(&Object::sphere(), of(Method::Palpate), 1);
    let top = Object::sphere().centre() + Vector::new(0.0, 0.0, 0.045);
    let reported = |height_m: f64| {
        let swept_from = Some(top + Vector::new(0.0, 0.0, height_m));
        let detail = ContactDetail { swept_from, ..ContactDetail::default() };
        let pose = Pose::new(top.coords, Vector::x() * std::f64::consts::PI);
        let contact = Contact::new(pose, PUSH, point_pad(), detail).unwrap();
        Evidence::Attempt(Attempt { target: None, outcome: Outcome::Contact(contact) })
    };
    let (near, told) = state.absorb(&reported(0.8)).unwrap();
    assert!(!warns(&told, WarningKind::LongSweep));
    let (far, told) = state.absorb(&reported(8e3)).unwrap();
    assert!(
        warns(&told, WarningKind::LongSweep)
            && told.warnings.iter().any(|w| w.message.starts_with("swept_from"))
    );
    assert_sound(&far);
    let centre = |state: &Reconstruction| state.template_centre().unwrap();
    assert!((centre(&near) - centre(&far)).norm() < 1e-5);
}

#[test]
fn a_contact_kilometres_away_is_warned_about_and_drags_no_surface_there() {
    for method in METHODS {
        let (_, mut state) = explore(&Object::sphere(), of(method), 2);
        for place in [Point::new(9.9e3, 0.0, 0.0), Point::new(-9e3, 9e3, 9e3), Point::new(0.5, -0.1, 1e3)] {
            let told;
            (state, told) = state.absorb(&touch_at(place, PUSH)).unwrap();
            assert!(warns(&told, WarningKind::FarContact), "{method:?}");
            assert_sound(&state);
            let vertices = state.surface().unwrap().mesh.vertices;
            let farthest_m =
                vertices.iter().map(|v| (v - Object::sphere().centre()).norm()).fold(0.0, f64::max);
            assert!(farthest_m < 0.3, "{method:?}: {farthest_m}");
        }
    }
}

#[test]
fn clouds_too_small_to_be_an_object_panic_nowhere_and_leave_a_sound_surface() {
    for size_m in [1e-5, 1e-7, 1e-9, 1e-20, 1e-39] {
        for offset in [Vector::zeros(), Vector::new(0.4, 0.1, 0.3)] {
            let corner = |i: u32| {
                let (u, v) = (f64::from(i % 5), f64::from(i / 5));
                Point::from(offset) + Vector::new(u, v, 0.1 * (u * v).sin()) * size_m
            };
            // What is gone in the sum is refused.
            let Ok(prior) = VisualPrior::new((0..25).map(corner).collect(), None, None) else { continue };
            for method in METHODS {
                let state = Reconstruction::new(Config::new(of(method)).unwrap());
                let (mut state, _) = state.absorb(&Evidence::VisualPrior(prior.clone())).unwrap();
                assert_sound(&state);
                for at in [corner(3), corner(20), corner(7) + Vector::new(0.0, 0.0, -size_m)] {
                    (state, _) = state.absorb(&touch_at(at, PUSH)).unwrap();
                    assert_sound(&state);
                }
            }
        }
    }
}

#[test]
fn the_same_point_and_a_line_and_a_plane_of_touches_give_a_sound_surface() {
    let centre = Object::sphere().centre();
    let places: [fn(f64) -> Vector; 3] = [
        |_| Vector::new(0.0, 0.0, 0.045),
        |i| Vector::new(0.002 * i - 0.03, 0.0, 0.045),
        |i| Vector::new(0.006 * (i % 6.0) - 0.02, 0.01 * (i / 6.0).floor() - 0.02, 0.045),
    ];
    for place in places {
        let (_, mut state) = explore(&Object::sphere(), of(Method::Palpate), 0);
        for i in 0..30 {
            (state, _) = state.absorb(&touch_at(centre + place(f64::from(i)), PUSH)).unwrap();
        }
        assert_sound(&state);
    }
}

#[test]
fn a_view_of_five_points_shown_again_and_again_gives_a_sound_surface() {
    let square = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.1, 0.1, 0.0], [0.05, 0.05, 0.02]];
    let line = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.001, 0.0]];
    for points in [square, line] {
        for method in METHODS {
            let points: Vec<Point> = points.iter().map(|xyz| Point::from(*xyz)).collect();
            for viewpoint in [None, Some(Point::new(0.05, 0.05, 0.6))] {
                let seen = Evidence::VisualPrior(VisualPrior::new(points.clone(), None, viewpoint).unwrap());
                let mut state = Reconstruction::new(Config::new(of(method)).unwrap());
                for _ in 0..40 {
                    state = state.absorb(&seen).unwrap().0;
                }
                assert_sound(&state);
            }
        }
    }
}
