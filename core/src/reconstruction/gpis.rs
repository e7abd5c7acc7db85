//! METHOD_GPIS on one page: a Gaussian process implicit surface, as the paper's related work has it.

use std::sync::Arc;

use super::{Detail, Estimate, GpisDetail, Surface};
use crate::config::Config;
use crate::evidence::ledger::Ledger;
use crate::evidence::{Reading, thin_visual};
use crate::geometry::Connectivity;
use crate::implicit::ImplicitObject;
use crate::uncertainty::Reach;

/// Visual points that are kept; more of them add no information.
const VISUAL_POINTS: usize = 100;
/// Cells of the grid along each side where the sphere of the other methods is not subdivided; each
/// subdivision doubles them.
const CELLS: usize = 2;

pub(super) fn estimate(ledger: &Ledger, config: &Config) -> Estimate {
    let reading = Reading::as_printed(ledger);
    let attractors = thin_visual(&reading.attractors(ledger, config.tactile_u_max), VISUAL_POINTS, true);
    let free_space = reading.free_space(ledger, config.probe_half_travel_m);

    // The field is 0 at the attractors, -1 in the middle of the object, 1 far around it, and positive where
    // the probe has swept freely.
    let object = ImplicitObject::fit(&attractors, &free_space, reading.viewpoint(ledger).as_ref());

    // Its zero level is the surface.
    let mesh = object.mesh(CELLS << config.icosphere_subdivisions);

    // How unsure the field still is there is the uncertainty.
    let uncertainty = object.uncertainty(&mesh.vertices);

    let detail = GpisDetail { centre: object.centre(), residual_m: object.residual_m(&attractors) };
    let connectivity = Arc::new(Connectivity::new(mesh.faces.clone(), mesh.vertices.len()));
    let surface = Surface { mesh, uncertainty, std_m: None };
    Estimate::new(surface, Reach::of(config), Detail::Gpis(detail), connectivity)
}
