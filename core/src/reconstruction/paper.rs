//! METHOD_PAPER on one page: from attractors to a surface with uncertainty.

use super::{Estimate, LocalReport, Surface, Template};
use crate::config::Config;
use crate::deformation::{self, ThinPlate};
use crate::geometry::{Icosphere, SurfaceIndex};
use crate::ledger::Ledger;
use crate::template::ellipsoid;
use crate::uncertainty::{self, Reach};

/// The length over which confidence halves, in metres; the paper does not give it.
pub(super) const LENGTH_M: f64 = 0.020;

pub(super) fn estimate(
    ledger: &Ledger,
    before: Option<&Estimate>,
    config: &Config,
    sphere: &'static Icosphere,
) -> Estimate {
    let attractors = &ledger.attractors;
    let viewpoint = ledger.viewpoint.as_ref();

    // Section III-D: the template guesses the whole from the part.
    let template = match before.map(|before| &before.template) {
        Some(Template::Ellipsoid(before)) => ellipsoid::fit(attractors, viewpoint, &before.shape, true),
        _ => ellipsoid::fit(attractors, viewpoint, &ellipsoid::initial(attractors, viewpoint), false),
    };
    let global = template.shape.mesh(sphere);

    // Section III-E: a thin plate over it meets the attractors, Eq. (2).
    let index = SurfaceIndex::new(&global).expect("an icosphere has faces");
    let projections = deformation::project(&global, &index, attractors);
    let (plate, report) = ThinPlate::fit(&projections);
    let mesh = plate.displace(&global, &global.vertex_normals());

    // Section III-F: uncertainty spreads from the attractors.
    let reach =
        Reach { hops: config.propagation_hops, length_m: config.propagation_length_m.unwrap_or(LENGTH_M) };
    let uncertainty = uncertainty::propagate(sphere, &mesh.vertices, attractors, reach, |_| 1.0);

    let local = LocalReport { residual_m: report.residual_m, condition: report.condition };
    let surface = Surface { mesh, uncertainty, std_m: None };
    Estimate::new(Template::Ellipsoid(template), local, surface, reach)
}
