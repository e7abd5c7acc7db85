//! METHOD_PALPATE on one page: from all evidence, failures included, to a surface with its
//! standard deviation.

use super::{Estimate, LocalReport, Surface, Template};
use crate::attractor::{Attractor, Sense};
use crate::config::Config;
use crate::displacement::{Displacement, Observation, Prior, VertexProcess};
use crate::geometry::{Direction, Icosphere, Point, SurfaceIndex, TriangleMesh};
use crate::ledger::Ledger;
use crate::symmetry::{Fold, Place, Symmetry};
use crate::template::{Superquadric, selection};
use crate::thinning;
use crate::uncertainty::{self, Reach};

/// Visual points that are kept: they lie so close that more of them tell nothing new.
const VISUAL_POINTS: usize = 100;
const HOPS: u32 = 8;
/// The budget of touches where none is configured.
const BUDGET: u32 = 50;
/// Noise of a certain attractor, in metres, and how it grows with the attractor's uncertainty.
const NOISE_M: f64 = 0.0005;
const NOISE_BY_UNCERTAINTY: f64 = 2.5;
/// Noise of a point that is merely known to be free, in metres.
const FREE_NOISE_M: f64 = 0.003;
/// Over this share of the object's mean radius displacements are alike.
const CORRELATION: f64 = 0.6;
/// Displacements are expected to be this large, in metres, as if seen so many times.
const EXPECTED_M: f64 = 0.008;
const EXPECTED_COUNT: f64 = 8.0;
/// However far off a touch may be, displacements are not expected to be larger, in metres: the
/// system stays regular.
const LARGEST_M: f64 = 0.1;
/// The evidence for a symmetry has to be this much better, in nats.
const CLEARLY_BETTER: f64 = 10.0;
/// So many touches are needed before symmetry is asked for.
const TOUCHES_FOR_SYMMETRY: usize = 8;
/// The process's deviation against the error of the surface, template included, and the least of it.
const DEVIATION_SCALE: f64 = 1.5;
const LEAST_DEVIATION_M: f64 = 0.001;

pub(super) fn estimate(
    ledger: &Ledger,
    before: Option<&Estimate>,
    config: &Config,
    sphere: &'static Icosphere,
) -> Estimate {
    // The template is chosen and fitted to all that was seen, touched and swept.
    let attractors = thinning::thin_visual(&ledger.attractors, VISUAL_POINTS);
    let before = before.and_then(|before| match &before.template {
        Template::Compound(fit) => Some(&**fit),
        Template::Ellipsoid(_) => None,
    });
    let template = selection::fit(&attractors, &ledger.free_space, ledger.viewpoint.as_ref(), before);
    let global = template.chosen.shape.mesh(sphere);
    let index = SurfaceIndex::new(&global).expect("an icosphere has faces");
    let observe = |point: &Point, noise_m: f64| observe(&global, &index, point, noise_m);

    // A Gaussian process over it meets the attractors, with the symmetry that the evidence shows.
    let noise_m = |a: &Attractor| NOISE_M * (1.0 + NOISE_BY_UNCERTAINTY * a.uncertainty);
    let touches = attractors.iter().filter(|a| a.sense == Sense::Touch).count();
    let mut observations: Vec<Observation> =
        attractors.iter().map(|a| observe(&a.point, noise_m(a))).collect();
    let radius_m = (global.area() / (4.0 * std::f64::consts::PI)).sqrt();
    let process =
        displacement(&observations, touches, CORRELATION * radius_m, &template.chosen.shape.body, config);

    // Where the surface would cover what was swept freely, it is pulled back, twice.
    let free: Vec<Observation> =
        ledger.free_space.outside().iter().map(|point| observe(point, FREE_NOISE_M)).collect();
    let process = (0..2).fold(process, |process, _| {
        let covered = |o: &&Observation| process.mean_m(&o.place) > o.displacement_m + NOISE_M;
        let violated: Vec<Observation> = free.iter().filter(covered).copied().collect();
        if violated.is_empty() {
            return process;
        }
        observations.extend(violated);
        Displacement::fit(*process.prior(), &observations)
    });
    let normals = global.vertex_normals();
    let (heights_m, deviations_m) = process.predict(&global.vertices, &normals);
    let displace =
        |((vertex, normal), height_m): ((&Point, &Direction), &f64)| vertex + normal.into_inner() * *height_m;
    let places = global.vertices.iter().zip(&normals).map(|(p, n)| Place::new(p, n)).collect();
    let vertices = global.vertices.iter().zip(&normals).zip(&heights_m).map(displace).collect();
    let mesh = TriangleMesh { vertices, faces: global.faces };

    // Uncertainty spreads from the attractors as in the paper, as far as the budget asks for.
    let reach = Reach {
        hops: config.propagation_hops.unwrap_or(HOPS),
        length_m: config.propagation_length_m.unwrap_or_else(|| step_length_m(mesh.area(), config)),
    };
    let uncertainty = uncertainty::propagate(sphere, &mesh.vertices, &attractors, reach);
    let calibrate = |deviation_m: f64| (DEVIATION_SCALE * deviation_m).hypot(LEAST_DEVIATION_M);

    let local = LocalReport { residual_m: process.residual_m(&observations), condition: process.condition() };
    let std_m = deviations_m.iter().copied().map(calibrate).collect();
    let surface = Surface { mesh, uncertainty, std_m: Some(std_m) };
    Estimate::new(Template::Compound(Box::new(template)), local, surface, reach)
        .with_process(VertexProcess::new(process, places, deviations_m))
}

/// What a point says about the displacement of the template under it.
fn observe(template: &TriangleMesh, index: &SurfaceIndex, point: &Point, noise_m: f64) -> Observation {
    let closest = index.closest(point);
    let normal = template.face_normal(closest.face);
    Observation {
        place: Place::new(&closest.point, &normal),
        displacement_m: (point - closest.point).dot(&normal),
        noise_m,
    }
}

/// The process with the amplitude and the symmetry that the measurements ask for.
fn displacement(
    observations: &[Observation],
    touches: usize,
    length_m: f64,
    body: &Superquadric,
    config: &Config,
) -> Displacement {
    let fold = |symmetry| Fold { centre: body.centre, axes: body.base_from_template, symmetry };
    let prior = Prior { length_m, amplitude_m: EXPECTED_M, fold: fold(Symmetry::None) };
    let rescaled = |process: &Displacement| {
        let prior = *process.prior();
        let squares = process.surprise() * prior.amplitude_m.powi(2);
        let expected = EXPECTED_COUNT * EXPECTED_M.powi(2);
        let variance = (expected + squares) / (EXPECTED_COUNT + 4.0 + touches as f64);
        let amplitude_m = variance.sqrt().min(LARGEST_M);
        Displacement::fit(Prior { amplitude_m, ..prior }, observations)
    };
    let alone = rescaled(&rescaled(&Displacement::fit(prior, observations)));
    if touches < TOUCHES_FOR_SYMMETRY {
        return alone;
    }
    let amplitude_m = alone.prior().amplitude_m;
    // What the caller vouches for needs no further evidence.
    let margin = if config.symmetry.is_some() { f64::NEG_INFINITY } else { CLEARLY_BETTER };
    let mut least = alone.evidence() + margin;
    let mut best = alone;
    for symmetry in Symmetry::candidates(config.symmetry) {
        let prior = Prior { amplitude_m, fold: fold(symmetry), ..prior };
        let candidate = rescaled(&Displacement::fit(prior, observations));
        if candidate.evidence() > least {
            least = candidate.evidence();
            best = candidate;
        }
    }
    best
}

/// The length over which confidence halves so that the budget of touches covers the surface,
/// in metres.
fn step_length_m(area_m2: f64, config: &Config) -> f64 {
    let budget = f64::from(config.stop.max_attempts.unwrap_or(BUDGET));
    (2.5 * area_m2 / (budget * std::f64::consts::PI)).sqrt().clamp(0.010, 0.035)
}
