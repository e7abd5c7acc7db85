//! Each stage of the method, and the whole step from a reported contact to the next candidate, at
//! several numbers of attractors and vertices. Run with `cargo bench -p palpate-core`.

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, criterion_group, criterion_main};
use nalgebra::UnitQuaternion;
use palpate_core::config::{Axes, Config, Method, Settings, Strategy};
use palpate_core::evidence::attractor::{Attractor, Sense};
use palpate_core::evidence::{Attempt, Contact, ContactDetail, Evidence, Outcome, Pad, VisualPrior, Wrench};
use palpate_core::exploration::ProposalRequest;
use palpate_core::geometry::{Icosphere, Point, Pose, Vector};
use palpate_core::local::thin_plate::ThinPlate;
use palpate_core::reconstruction::Reconstruction;
use palpate_core::schedule::Extras;
use palpate_core::template::{TemplateSurface, ellipsoid};
use palpate_core::uncertainty::{self, Reach};

type Group<'a> = BenchmarkGroup<'a, WallTime>;

/// Attractors and subdivisions of the icosphere: 4 gives 2562 vertices, 5 gives 10,242.
const SIZES: [(usize, u32); 6] = [(250, 4), (500, 4), (1000, 4), (250, 5), (500, 5), (1000, 5)];
/// METHOD_PALPATE at the sizes that sessions have.
const SIZES_OF_SESSIONS: [(usize, u32); 3] = [(250, 4), (500, 4), (250, 5)];
const SEEN: usize = 200;
/// Visual points that METHOD_PALPATE keeps.
const KEPT: usize = 100;

type Body = (&'static str, fn(&Vector) -> Point);

const BODIES: [Body; 2] = [("box", box_like), ("bottle", bottle)];

/// The extras that METHOD_PALPATE does in every fourth fit, and how a fit is recognised that does them.
type Extra = (&'static str, fn(&Extras) -> bool);

const EXTRAS: [Extra; 4] = [
    ("starts", |extras| extras.starts),
    ("noise", |extras| extras.noise),
    ("splits", |extras| extras.splits),
    ("symmetries", |extras| extras.symmetry),
];

/// A box with round edges: one part is enough for it.
fn box_like(direction: &Vector) -> Point {
    let d = direction;
    let gauge = ((d.x / 0.03).powi(4) + (d.y / 0.045).powi(4) + (d.z / 0.08).powi(4)).powf(0.25);
    Point::from(d / gauge)
}

/// A body with a wide neck: more than one part is fitted to it.
fn bottle(direction: &Vector) -> Point {
    let across = direction.x.hypot(direction.y);
    let cylinder = |radius: f64, low: f64, high: f64| {
        let end = if direction.z > 0.0 { high } else { low };
        (radius / across).min(end / direction.z.abs())
    };
    let (body, neck) = (cylinder(0.035, 0.06, 0.02), cylinder(0.02, 0.06, 0.12));
    Point::from(direction * body.max(neck))
}

fn attractors(count: usize) -> Vec<Attractor> {
    attractors_of(box_like, count)
}

/// Points of a body, the first `SEEN` of them on a patch towards the camera.
fn attractors_of(on_body: fn(&Vector) -> Point, count: usize) -> Vec<Attractor> {
    let mut directions = Icosphere::get(5).directions.clone();
    directions.sort_by(|a, b| b.x.total_cmp(&a.x));
    let unseen = directions.len() - 1200;
    let seen = (0..SEEN).map(|i| (directions[6 * i], Sense::Vision));
    let touched = (0..count - SEEN).map(|i| (directions[1200 + (i * 7919) % unseen], Sense::Touch));
    seen.chain(touched).map(|(direction, sense)| Attractor::new(on_body(&direction), 0.1, sense)).collect()
}

/// A touch after a free way of the default length, pointing at the middle of the body.
fn contact(attractor: &Attractor) -> Evidence {
    let outwards = attractor.point.coords.normalize();
    let facing = UnitQuaternion::face_towards(&-outwards, &Vector::new(0.1, 0.2, 0.3));
    let pose = Pose::from_parts(attractor.point.into(), facing);
    let swept_from = Some(attractor.point + outwards * Settings::default().probe_half_travel_m);
    let detail =
        ContactDetail { uncertainty: Some(attractor.uncertainty), swept_from, ..ContactDetail::default() };
    let contact = Contact::new(pose, Wrench::default(), Pad::default(), detail).expect("a sound contact");
    Evidence::Attempt(Attempt { target: None, outcome: Outcome::Contact(contact) })
}

/// A session with all of the attractors but the last, which is returned as evidence.
fn session(method: Method, attractors: &[Attractor], subdivisions: u32) -> (Reconstruction, Evidence) {
    let settings = Settings { method, icosphere_subdivisions: subdivisions, ..Settings::default() };
    session_with(settings, attractors, 1)
}

/// The same, with as many fits before as views, and touches but the last.
fn session_with(settings: Settings, attractors: &[Attractor], views: usize) -> (Reconstruction, Evidence) {
    let mut state = Reconstruction::new(Config::new(settings).expect("valid settings"));
    let (last, rest) = attractors.split_last().expect("attractors");
    let (seen, touched) = rest.split_at(SEEN);
    for view in 0..views {
        let points = seen.iter().skip(view).step_by(views).map(|a| a.point).collect();
        let prior = VisualPrior::new(points, None, Some(Point::new(0.6, 0.1, 0.2))).expect("a sound prior");
        state = state.absorb(&Evidence::VisualPrior(prior)).expect("absorbed").0;
    }
    for touch in touched {
        state = state.absorb(&contact(touch)).expect("absorbed").0;
    }
    (state, contact(last))
}

/// From a reported contact to the next candidate.
fn bench_step(group: &mut Group<'_>, id: BenchmarkId, (state, evidence): (Reconstruction, Evidence)) {
    group.bench_function(id, |bencher| {
        bencher.iter(|| {
            let (next, _) = state.absorb(black_box(&evidence)).expect("absorbed");
            next.propose(&ProposalRequest::best(1))
        });
    });
}

fn paper_step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("contact_step");
    group.sample_size(20);
    for (count, subdivisions) in SIZES {
        let vertices = Icosphere::get(subdivisions as usize).directions.len();
        let id = BenchmarkId::new("paper", format!("{count}x{vertices}"));
        bench_step(&mut group, id, session(Method::Paper, &attractors(count), subdivisions));
    }
}

/// METHOD_PALPATE keeps a hundred visual points and every touch: its sizes count those. Each extra is
/// brought about by the number of views.
fn palpate_step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("contact_step");
    group.sample_size(20);
    let mut bench = |(count, subdivisions): (usize, u32), (body, on_body): Body, (extra, is_due): Extra| {
        let vertices = Icosphere::get(subdivisions as usize).directions.len();
        let touches = count - SEEN;
        let views = (1..=4).find(|views| is_due(&Extras::of_fit(views + touches))).expect("one of four fits");
        let settings = Settings { icosphere_subdivisions: subdivisions, ..Settings::default() };
        let size = format!("{}x{vertices}", KEPT + touches);
        let id = BenchmarkId::new(format!("palpate/{body}/{extra}"), size);
        bench_step(&mut group, id, session_with(settings, &attractors_of(on_body, count), views));
    };
    let [usual, larger @ ..] = SIZES_OF_SESSIONS;
    for body in BODIES {
        for extra in EXTRAS {
            bench(usual, body, extra);
        }
    }
    for size in larger {
        bench(size, BODIES[0], EXTRAS[1]);
    }
}

/// The choice of the next candidate alone, by the two strategies of METHOD_PALPATE.
fn proposals(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("propose");
    group.sample_size(20);
    for (name, strategy) in [("proactive", Strategy::Proactive), ("expected_gain", Strategy::ExpectedGain)] {
        for (count, subdivisions) in SIZES_OF_SESSIONS {
            let settings = Settings { strategy, icosphere_subdivisions: subdivisions, ..Settings::default() };
            let (state, evidence) = session_with(settings, &attractors(count), 1);
            let (state, _) = state.absorb(&evidence).expect("absorbed");
            let vertices = Icosphere::get(subdivisions as usize).directions.len();
            group.bench_function(BenchmarkId::new(name, format!("{count}x{vertices}")), |bencher| {
                bencher.iter(|| black_box(state.propose(&ProposalRequest::best(1))));
            });
        }
    }
}

fn stages(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("stage");
    group.sample_size(20);
    for (count, subdivisions) in SIZES {
        let attractors = attractors(count);
        let sphere = Icosphere::get(subdivisions as usize);
        let size = format!("{count}x{}", sphere.directions.len());
        let viewpoint = Some(Point::new(0.6, 0.1, 0.2));
        let template = || ellipsoid::fit(&attractors, viewpoint.as_ref(), Axes::Frame);
        let surface = TemplateSurface::new(template().shape.mesh(sphere));
        let project = || -> Vec<_> { attractors.iter().map(|a| surface.project(&a.point)).collect() };
        let projections = project();
        let plate = ThinPlate::fit(&projections);
        let raise = || surface.raised(&plate.heights_m(&surface.mesh().vertices));
        let mesh = raise();
        let (state, evidence) = session(Method::Paper, &attractors, subdivisions);
        let (state, _) = state.absorb(&evidence).expect("absorbed");
        let mut bench = |name: &str, run: &mut dyn FnMut()| {
            group.bench_function(BenchmarkId::new(name, &size), |bencher| bencher.iter(&mut *run));
        };
        bench("template", &mut || {
            black_box(template());
        });
        bench("surface", &mut || {
            black_box(TemplateSurface::new(surface.mesh().clone()));
        });
        bench("project", &mut || {
            black_box(project());
        });
        bench("plate_fit", &mut || {
            black_box(ThinPlate::fit(&projections));
        });
        bench("plate_raise", &mut || {
            black_box(raise());
        });
        bench("uncertainty", &mut || {
            black_box(uncertainty::propagate(
                &sphere.connectivity,
                &mesh.vertices,
                &attractors,
                Reach { hops: 5, length_m: 0.02 },
            ));
        });
        bench("propose", &mut || {
            black_box(state.propose(&ProposalRequest::best(1)));
        });
    }
}

criterion_group!(benches, paper_step, palpate_step, proposals, stages);
criterion_main!(benches);
