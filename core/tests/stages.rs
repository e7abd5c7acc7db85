//! A stage that is left out takes its idea with it, and nothing else is asked of the rest.

#![expect(clippy::unwrap_used, reason = "a test that meets nothing where something must be has failed")]

use nalgebra::{Rotation3, UnitQuaternion};
use palpate_core::config::{Config, Settings, Stages};
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Outcome, Pad, Sweep, Target, VisualPrior, Wrench,
};
use palpate_core::exploration::ProposalRequest;
use palpate_core::geometry::{Icosphere, Point, Pose, Vector};
use palpate_core::reconstruction::Reconstruction;
use palpate_core::template::{Compound, Superquadric};

fn part(z: f64, radius: f64, half_height: f64) -> Superquadric {
    Superquadric {
        centre: Point::new(0.0, 0.0, z),
        semi_axes: Vector::new(radius, radius, half_height),
        base_from_template: Rotation3::identity(),
        exponents: [0.2, 1.0],
    }
}

/// A body with a neck.
fn bottle() -> Compound {
    Compound { body: part(0.0, 0.035, 0.08), others: vec![part(0.1, 0.014, 0.05)] }
}

/// A flat plate, seen from above.
fn plate() -> Compound {
    Compound { body: part(0.0, 0.09, 0.005), others: Vec::new() }
}

/// A rough patch, `touches` all over the object, one of them early, and a miss beside it.
fn evidence(object: &Compound, touches: usize) -> Vec<Evidence> {
    let mesh = object.mesh(Icosphere::get(4));
    let camera = Point::new(0.3, -0.2, 0.5);
    let mut seen = mesh.vertices.clone();
    seen.sort_by(|a, b| (a - camera).norm().total_cmp(&(b - camera).norm()));
    seen.truncate(300);
    // Two millimetres of scatter along the rays, which repeats itself every seven points.
    for (k, point) in seen.iter_mut().enumerate() {
        *point += (*point - camera).normalize() * (0.001 * ((k * 5 % 7) as f64 - 3.0));
    }
    let mut log = vec![Evidence::VisualPrior(VisualPrior::new(seen, None, Some(camera)).unwrap())];
    let normals = mesh.vertex_normals();
    for touch in 0..touches {
        // A stride that shares no factor with the number of vertices, so that they lie all over.
        let vertex = (touch * 997 + 11) % mesh.vertices.len();
        let (point, normal) = (mesh.vertices[vertex], normals[vertex]);
        let facing = UnitQuaternion::rotation_between(&Vector::z(), &-normal.into_inner());
        let pose = Pose::from_parts(point.coords.into(), facing.unwrap_or_else(UnitQuaternion::identity));
        let contact =
            Contact::new(pose, Wrench::default(), Pad::new(0.009).unwrap(), ContactDetail::default())
                .unwrap();
        // The third was expected far inside.
        let depth_m = if touch == 2 { 0.03 } else { 0.0 };
        let target = Target::new(point - normal.into_inner() * depth_m, normal.into_inner()).unwrap();
        log.push(Evidence::Attempt(Attempt { target: Some(target), outcome: Outcome::Contact(contact) }));
    }
    let sweep = Sweep::new(Point::new(0.0, 0.05, 0.09), Point::new(0.0, 0.02, 0.09), 0.0).unwrap();
    log.push(Evidence::Attempt(Attempt { target: None, outcome: Outcome::NoContact(sweep) }));
    log
}

/// The states after each piece of evidence.
fn states(log: &[Evidence], stages: Stages) -> Vec<Reconstruction> {
    let settings = Settings { stages, icosphere_subdivisions: 2, ..Settings::default() };
    let mut states = vec![Reconstruction::new(Config::new(settings).unwrap())];
    for evidence in log {
        states.push(states.last().unwrap().absorb(evidence).unwrap().0);
    }
    states.split_off(1)
}

fn families(log: &[Evidence], stages: Stages) -> Vec<&'static str> {
    states(log, stages).iter().map(|state| state.last_estimate().unwrap().template_family()).collect()
}

#[test]
fn a_template_has_the_families_that_are_in_use() {
    let log = evidence(&bottle(), 40);
    let all = Stages::default();
    assert!(families(&log, all).iter().any(|family| family.starts_with("compound")));
    let alone = families(&log, Stages { parts: false, ..all });
    assert!(!alone.iter().any(|family| family.starts_with("compound")));
    assert!(alone.contains(&"cylinder"), "{alone:?}");
    let plain = families(&log, Stages { superquadrics: false, ..all });
    assert!(plain.iter().all(|family| *family == "ellipsoid"), "{plain:?}");
}

#[test]
fn an_early_contact_is_an_attractor_only_where_it_is_to_be_kept() {
    let log = evidence(&bottle(), 5);
    let attractors = |stages| states(&log, stages).last().unwrap().attractors().len();
    let all = Stages::default();
    assert_eq!(attractors(all), attractors(Stages { early_contacts: false, ..all }) + 1);
}

#[test]
fn a_term_of_the_score_is_there_only_where_it_is_in_use() {
    let log = evidence(&bottle(), 5);
    let has_term = |name, stages| {
        let proposal = states(&log, stages).last().unwrap().propose(&ProposalRequest::best(1));
        proposal.candidates[0].terms.iter().any(|term| term.term == name)
    };
    // Nothing is doubted: the approach of a doubted touch is repeated without a score.
    let all = Stages { doubts: false, ..Stages::default() };
    for (name, without) in [
        ("failures", Stages { failure_penalty: false, ..all }),
        ("template", Stages { template_error: false, ..all }),
        ("risk", Stages { risk: false, ..all }),
    ] {
        assert!(has_term(name, all) && !has_term(name, without), "{name}");
    }
}

#[test]
fn every_other_stage_changes_the_surface_or_its_uncertainty() {
    let all = Stages::default();
    let surfaces = |log: &[Evidence], stages| -> Vec<_> {
        states(log, stages).iter().map(Reconstruction::surface).collect()
    };
    let log = evidence(&bottle(), 20);
    let with_all = surfaces(&log, all);
    for stages in [
        Stages { free_space: false, ..all },
        Stages { visual_means: false, ..all },
        Stages { noise: false, ..all },
        Stages { extent: false, ..all },
    ] {
        assert!(surfaces(&log, stages) != with_all, "{stages:?}");
    }
    // The neck has to be known before it is a limb, and the template to be as round as the bottle before a
    // revolution is thought of, which after twenty touches is a matter of chance.
    let log = evidence(&bottle(), 60);
    let with_all = surfaces(&log, all);
    for stages in [
        Stages { limbs: false, ..all },
        Stages { symmetry: false, ..all },
        Stages { symmetry_first: false, ..all },
    ] {
        assert!(surfaces(&log, stages) != with_all, "{stages:?}");
    }
    // What five touches of a plate contradict in its template, an offset of the view may explain as well, and what just
    // holds them is a plate, too.
    let all = Stages { offsets: false, extent: false, ..all };
    let log = evidence(&plate(), 5);
    assert!(surfaces(&log, Stages { slab: false, ..all }) != surfaces(&log, all));
}
