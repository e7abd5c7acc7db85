//! METHOD_PAPER on one page: from attractors to a surface with uncertainty.

use super::{Detail, Estimate, PaperDetail, Surface};
use crate::config::Config;
use crate::evidence::Reading;
use crate::evidence::ledger::Ledger;
use crate::geometry::Icosphere;
use crate::local::thin_plate::ThinPlate;
use crate::template::{TemplateSurface, ellipsoid};
use crate::uncertainty::{self, Reach};

pub(super) fn estimate(ledger: &Ledger, config: &Config, sphere: &'static Icosphere) -> Estimate {
    let reading = Reading::as_printed(ledger);
    let attractors = &reading.attractors(ledger, config.tactile_u_max);
    let viewpoint = reading.viewpoint(ledger);

    // Section III-D: the template guesses the whole from the part.
    let template = ellipsoid::fit(attractors, viewpoint.as_ref(), config.template_axes);
    let surface = TemplateSurface::new(template.shape.mesh(sphere));

    // Section III-E: a thin plate over it meets the attractors, Eq. (2).
    let projections: Vec<_> = attractors.iter().map(|a| surface.project(&a.point)).collect();
    let plate = ThinPlate::fit(&projections);
    let mesh = surface.raised(&plate.heights_m(&surface.mesh().vertices));

    // Section III-F: uncertainty spreads from the attractors.
    let reach = Reach::of(config);
    let uncertainty = uncertainty::propagate(&sphere.connectivity, &mesh.vertices, attractors, reach);

    let detail = PaperDetail { template, residual_m: plate.residual_m() };
    Estimate::new(
        Surface { mesh, uncertainty, std_m: None },
        reach,
        Detail::Paper(detail),
        sphere.connectivity.clone(),
    )
}
