//! METHOD_PALPATE on one page: from all evidence, failures included, to a surface with its
//! standard deviation.

use super::{Detail, Estimate, PalpateDetail, Surface};
use crate::config::Config;
use crate::evidence::FitEvidence;
use crate::evidence::ledger::Ledger;
use crate::geometry::Icosphere;
use crate::local;
use crate::schedule::Extras;
use crate::template::{self, TemplateSurface};
use crate::uncertainty::{self, Reach};

pub(super) fn estimate(
    ledger: &Ledger,
    before: Option<&PalpateDetail>,
    config: &Config,
    sphere: &'static Icosphere,
) -> Estimate {
    let number = before.map_or(1, |before| before.number + 1);
    let (extras, stages) = (Extras::of_fit(number), &config.stages);
    let evidence = FitEvidence::of(ledger, stages);

    // Section III-D: the template guesses the whole from the part.
    let template = template::select(&evidence, before.map(|b| &b.template), extras, stages);
    let surface = TemplateSurface::new(template.shape.mesh(sphere));

    // Section III-E: a Gaussian process over it meets what was measured and leaves free what was swept.
    let last = before.map(|b| &b.raised.hyperparameters);
    let raised = local::raise(&surface, &template.shape, &evidence, last, extras, config);
    let mesh = surface.raised(&raised.heights_m);

    // Section III-F: uncertainty spreads from the attractors, then to what a revolution makes symmetric.
    let (attractors, reach) = (&evidence.attractors, Reach::of(config));
    let mut uncertainty = uncertainty::propagate(&sphere.connectivity, &mesh.vertices, attractors, reach);
    if stages.symmetry_first {
        let symmetry = raised.process.symmetry();
        uncertainty = uncertainty::lowered_by_symmetry(uncertainty, &mesh, symmetry, attractors, reach);
    }

    let template_std_m = template.deviations_m(&surface.mesh().vertices);
    let std_m = Some(raised.std_m.clone());
    let detail = PalpateDetail { number, template, template_std_m, raised };
    let surface = Surface { mesh, uncertainty, std_m };
    Estimate::new(surface, reach, Detail::Palpate(Box::new(detail)), sphere.connectivity.clone())
}
