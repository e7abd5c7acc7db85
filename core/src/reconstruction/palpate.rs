//! METHOD_PALPATE on one page: from all evidence, failures included, to a surface with its
//! standard deviation.

use super::{Estimate, LocalReport, Surface, Template, paper};
use crate::attractor::Sense;
use crate::config::Config;
use crate::displacement::{Displacement, Observation, VertexProcess};
use crate::free_space::FreeSpace;
use crate::geometry::{Icosphere, Point, SurfaceIndex, TriangleMesh};
use crate::ledger::Ledger;
use crate::process_choice::Question;
use crate::symmetry::{Place, Symmetry};
use crate::template::selection;
use crate::thinning;
use crate::uncertainty::{self, Reach};

/// Visual points that are kept: they lie so close that more of them tell nothing new.
const VISUAL_POINTS: usize = 100;
/// The budget of touches where none is configured.
const BUDGET: u32 = 50;
/// Noise of a point that is merely known to be free, and what of it may be covered, in metres.
const FREE_NOISE_M: f64 = 0.003;
const COVERED_M: f64 = 0.0005;
/// Over this share of the object's mean radius displacements are alike.
const CORRELATION: f64 = 0.6;
/// A touch that its neighbours foresee worse than this spreads its confidence less far, in metres.
const SURPRISE_M: f64 = 0.003;
/// The least share of the length over which it does.
const LEAST_SHARE: f64 = 0.5;
/// The error of the surface, template included, against the process's deviation, and the least of it.
const DEVIATION_SCALE: f64 = 1.5;
const LEAST_DEVIATION_M: f64 = 0.0003;

pub(super) fn estimate(
    ledger: &Ledger,
    before: Option<&Estimate>,
    config: &Config,
    sphere: &'static Icosphere,
) -> Estimate {
    let stages = &config.stages;

    // The template is chosen and fitted to all that was seen, touched and swept.
    let attractors = thinning::thin_visual(&ledger.attractors, VISUAL_POINTS, stages.visual_means);
    let last_fit = before.and_then(|before| match &before.template {
        Template::Compound(fit) => Some(&**fit),
        Template::Ellipsoid(_) => None,
    });
    let measured = [&attractors[..], &ledger.tangents].concat();
    let unknown = FreeSpace::default();
    let free_space = if stages.free_space { &ledger.free_space } else { &unknown };
    let template = selection::fit(&measured, free_space, ledger.viewpoint.as_ref(), last_fit, stages);
    let global = template.chosen.shape.mesh(sphere);
    let index = SurfaceIndex::new(&global).expect("an icosphere has faces");
    let observe = |point: &Point, noise_m: f64| observe(&global, &index, point, noise_m);

    // A Gaussian process over it meets the attractors, with the noise and the symmetry that the
    // evidence shows.
    let mut observations: Vec<Observation> = measured.iter().map(|a| observe(&a.point, 0.0)).collect();
    let question = Question {
        attractors: &measured,
        length_m: CORRELATION * (global.area() / (4.0 * std::f64::consts::PI)).sqrt(),
        shape: &template.chosen.shape,
        fits: template.fits,
        declared: config.symmetry,
        stages,
    };
    let last_choice = before.and_then(|before| before.choice.as_ref());
    let (process, choice) = question.answer(&mut observations, last_choice);

    // Where the surface would cover what was swept freely, it is pulled back, twice.
    let free: Vec<Observation> =
        free_space.outside().iter().map(|point| observe(point, FREE_NOISE_M)).collect();
    let free_places: Vec<Place> = free.iter().map(|o| o.place).collect();
    let process = (0..2).fold(process, |process, _| {
        let heights_m = process.means_m(&free_places);
        let covered = |(o, height_m): &(&Observation, f64)| *height_m > o.displacement_m + COVERED_M;
        let violated: Vec<Observation> =
            free.iter().zip(heights_m).filter(covered).map(|(o, _)| *o).collect();
        if violated.is_empty() {
            return process;
        }
        observations.extend(violated);
        Displacement::fit(*process.prior(), &observations)
    });
    let normals = global.vertex_normals();
    let places: Vec<Place> = global.vertices.iter().zip(&normals).map(|(p, n)| Place::new(p, n)).collect();
    let (heights_m, deviations_m) = process.predict(&places);
    let displaced = |(place, height_m): (&Place, &f64)| Point::from(place.point + place.normal * *height_m);
    let vertices = places.iter().zip(&heights_m).map(displaced).collect();
    let template_std_m = template.deviations_m(&global.vertices);
    let mesh = TriangleMesh { vertices, faces: global.faces };

    // Uncertainty spreads from the attractors as in the paper, as far as the budget asks for, and
    // less far from those that came as a surprise.
    let own_length_m = if stages.step_length { step_length_m(mesh.area(), config) } else { paper::LENGTH_M };
    let reach = Reach {
        hops: config.propagation_hops,
        length_m: config.propagation_length_m.unwrap_or(own_length_m),
    };
    let surprises_m = process.left_out_m();
    let share = |index: usize| match attractors[index].sense {
        Sense::Touch if stages.surprise => {
            (surprises_m[index] / SURPRISE_M).hypot(1.0).recip().max(LEAST_SHARE)
        }
        _ => 1.0,
    };
    let mut uncertainty = uncertainty::propagate(sphere, &mesh.vertices, &attractors, reach, share);
    if let Symmetry::Revolution(_) = choice.symmetry
        && stages.symmetry_first
    {
        let fold = process.prior().fold;
        let displaced = mesh.vertices.iter().zip(mesh.vertex_normals());
        let folded: Vec<Place> = displaced.map(|(p, n)| fold.apply(&Place::new(p, &n))).collect();
        let known = (&attractors[..], reach);
        uncertainty::propagate_by_symmetry(&mut uncertainty, &mesh.vertices, &folded, known, share);
    }

    let calibrate = |deviation_m: &f64| (DEVIATION_SCALE * deviation_m).hypot(LEAST_DEVIATION_M);
    let std_m = deviations_m.iter().map(calibrate).collect();

    let local = LocalReport { residual_m: process.residual_m(&observations), condition: process.condition() };
    let surface = Surface { mesh, uncertainty, std_m: Some(std_m) };
    Estimate::new(Template::Compound(Box::new(template)), local, surface, reach)
        .with_process(VertexProcess::new(process, places, deviations_m), choice)
        .with_template_std(template_std_m)
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

/// The length over which confidence halves so that the budget of touches covers the surface,
/// in metres.
fn step_length_m(area_m2: f64, config: &Config) -> f64 {
    let budget = f64::from(config.stop.max_attempts.unwrap_or(BUDGET));
    (2.5 * area_m2 / (budget * std::f64::consts::PI)).sqrt().clamp(0.010, 0.035)
}
