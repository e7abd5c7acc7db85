//! Each stage of the method, and the whole step from a reported contact to the next candidate, at
//! several numbers of attractors and vertices. Run with `cargo bench -p palpate-core`.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use palpate_core::attractor::{Attractor, Sense};
use palpate_core::config::{Config, Method, Settings, Strategy};
use palpate_core::deformation::{self, ThinPlate};
use palpate_core::evidence::{Attempt, Contact, ContactDetail, Evidence, Outcome, VisualPrior, Wrench};
use palpate_core::exploration::Request;
use palpate_core::geometry::{Icosphere, Point, Pose, SurfaceIndex, Vector};
use palpate_core::reconstruction::Reconstruction;
use palpate_core::template::ellipsoid;
use palpate_core::uncertainty::{self, Reach};

/// Attractors and subdivisions of the icosphere: 4 gives 2562 vertices, 5 gives 10,242.
const SIZES: [(usize, u32); 6] = [(250, 4), (500, 4), (1000, 4), (250, 5), (500, 5), (1000, 5)];
/// METHOD_PALPATE at the sizes that sessions have.
const SIZES_OF_SESSIONS: [(usize, u32); 3] = [(250, 4), (500, 4), (250, 5)];
const SEEN: usize = 200;

/// Points of a box-like body, the first `SEEN` of them on a patch towards the camera.
fn attractors(count: usize) -> Vec<Attractor> {
    let mut directions = Icosphere::get(5).directions.clone();
    directions.sort_by(|a, b| b.x.total_cmp(&a.x));
    let unseen = directions.len() - 1200;
    let seen = (0..SEEN).map(|i| (directions[6 * i], Sense::Vision));
    let touched = (0..count - SEEN).map(|i| (directions[1200 + (i * 7919) % unseen], Sense::Touch));
    let on_body = |d: &Vector| {
        let gauge = ((d.x / 0.03).powi(4) + (d.y / 0.045).powi(4) + (d.z / 0.08).powi(4)).powf(0.25);
        Point::from(d / gauge)
    };
    seen.chain(touched)
        .map(|(direction, sense)| Attractor { point: on_body(&direction), uncertainty: 0.1, sense })
        .collect()
}

fn contact(attractor: &Attractor) -> Evidence {
    let pose = Pose::from(attractor.point);
    let detail = ContactDetail { uncertainty: Some(attractor.uncertainty), ..ContactDetail::default() };
    let contact = Contact::new(pose, Wrench::default(), 0.009, detail).expect("a sound contact");
    Evidence::Attempt(Attempt { target: None, outcome: Outcome::Contact(contact) })
}

/// A session with all of the attractors but the last, which is returned as evidence.
fn session(method: Method, attractors: &[Attractor], subdivisions: u32) -> (Reconstruction, Evidence) {
    session_with(Settings { method, icosphere_subdivisions: subdivisions, ..Settings::default() }, attractors)
}

fn session_with(settings: Settings, attractors: &[Attractor]) -> (Reconstruction, Evidence) {
    let mut state = Reconstruction::new(Config::new(settings).expect("valid settings"));
    let (last, rest) = attractors.split_last().expect("attractors");
    let of = |sense| rest.iter().filter(move |a| a.sense == sense);
    let seen = of(Sense::Vision).map(|a| a.point).collect();
    let prior = VisualPrior::new(seen, None, Some(Point::new(0.6, 0.1, 0.2))).expect("a sound prior");
    state = state.absorb(&Evidence::VisualPrior(prior)).expect("absorbed").0;
    for touch in of(Sense::Touch) {
        state = state.absorb(&contact(touch)).expect("absorbed").0;
    }
    (state, contact(last))
}

/// From a reported contact to the next candidate, for both methods. Neither thins touches; of
/// visual points METHOD_PALPATE keeps a hundred, so its 250 attractors are 150.
fn whole_step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("contact_step");
    group.sample_size(20);
    let methods = [("paper", Method::Paper, &SIZES[..]), ("palpate", Method::Palpate, &SIZES_OF_SESSIONS)];
    for (name, method, sizes) in methods {
        for &(count, subdivisions) in sizes {
            let (state, evidence) = session(method, &attractors(count), subdivisions);
            let vertices = Icosphere::get(subdivisions as usize).directions.len();
            group.bench_function(BenchmarkId::new(name, format!("{count}x{vertices}")), |bencher| {
                bencher.iter(|| {
                    let (next, _) = state.absorb(black_box(&evidence)).expect("absorbed");
                    next.propose(&Request { top_k: 1, ..Request::default() })
                });
            });
        }
    }
}

/// The choice of the next candidate alone, by the two strategies of METHOD_PALPATE.
fn proposals(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("propose");
    group.sample_size(20);
    for (name, strategy) in [("proactive", Strategy::Proactive), ("expected_gain", Strategy::ExpectedGain)] {
        for (count, subdivisions) in SIZES_OF_SESSIONS {
            let settings = Settings { strategy, icosphere_subdivisions: subdivisions, ..Settings::default() };
            let (state, evidence) = session_with(settings, &attractors(count));
            let (state, _) = state.absorb(&evidence).expect("absorbed");
            let vertices = Icosphere::get(subdivisions as usize).directions.len();
            group.bench_function(BenchmarkId::new(name, format!("{count}x{vertices}")), |bencher| {
                bencher.iter(|| black_box(state.propose(&Request { top_k: 1, ..Request::default() })));
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
        let start = ellipsoid::initial(&attractors, viewpoint.as_ref());
        let cold = ellipsoid::fit(&attractors, viewpoint.as_ref(), &start, false);
        let global = cold.shape.mesh(sphere);
        let normals = global.vertex_normals();
        let index = SurfaceIndex::new(&global).expect("a mesh");
        let projections = deformation::project(&global, &index, &attractors);
        let (plate, _) = ThinPlate::fit(&projections);
        let mesh = plate.displace(&global, &normals);
        let (state, evidence) = session(Method::Paper, &attractors, subdivisions);
        let (state, _) = state.absorb(&evidence).expect("absorbed");
        let mut bench = |name: &str, run: &mut dyn FnMut()| {
            group.bench_function(BenchmarkId::new(name, &size), |bencher| bencher.iter(&mut *run));
        };
        bench("template_warm", &mut || {
            black_box(ellipsoid::fit(&attractors, viewpoint.as_ref(), &cold.shape, true));
        });
        bench("index", &mut || {
            black_box(SurfaceIndex::new(&global));
        });
        bench("project", &mut || {
            black_box(deformation::project(&global, &index, &attractors));
        });
        bench("plate_fit", &mut || {
            black_box(ThinPlate::fit(&projections));
        });
        bench("plate_displace", &mut || {
            black_box(plate.displace(&global, &normals));
        });
        bench("uncertainty", &mut || {
            black_box(uncertainty::propagate(
                sphere,
                &mesh.vertices,
                &attractors,
                Reach { hops: 5, length_m: 0.02 },
                |_| 1.0,
            ));
        });
        bench("propose", &mut || {
            black_box(state.propose(&Request { top_k: 1, ..Request::default() }));
        });
    }
}

criterion_group!(benches, whole_step, proposals, stages);
criterion_main!(benches);
