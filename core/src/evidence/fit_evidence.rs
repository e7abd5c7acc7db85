//! What METHOD_PALPATE fits: all that was seen, touched and swept, thinned.

use super::attractor::Attractor;
use super::free_space::FreeSpace;
use super::ledger::Ledger;
use super::thinning;
use crate::config::Stages;
use crate::geometry::Point;

/// Visual points that are kept: they lie so close together that more of them add no information.
const VISUAL_POINTS: usize = 100;

/// The evidence as template and local stage read it, in the work frame.
#[derive(Debug)]
pub(crate) struct FitEvidence<'a> {
    /// Thinned visual points, then all touches.
    pub(crate) attractors: Vec<Attractor>,
    /// The attractors, and after them the points that measured normals add.
    pub(crate) measured: Vec<Attractor>,
    /// Where the object is not, and where it is.
    pub(crate) free_space: &'a FreeSpace,
    /// Where the camera stood, in metres.
    pub(crate) viewpoint: Option<&'a Point>,
}

impl<'a> FitEvidence<'a> {
    /// The evidence of a ledger, as far as the stages in use look at it.
    pub(crate) fn of(ledger: &'a Ledger, stages: &Stages) -> Self {
        let attractors = thinning::thin_visual(&ledger.attractors, VISUAL_POINTS, stages.visual_means);
        let free_space = if stages.free_space { &ledger.free_space } else { FreeSpace::unknown() };
        Self {
            measured: [&attractors[..], &ledger.tangents].concat(),
            attractors,
            free_space,
            viewpoint: ledger.viewpoint.as_ref(),
        }
    }
}
