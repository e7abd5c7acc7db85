//! What METHOD_PALPATE fits: all that was seen, touched and swept, as it is read, thinned.

use super::attractor::{Attractor, Sense};
use super::crowding::Crowd;
use super::free_space::FreeSpace;
use super::ledger::Ledger;
use super::reading::{DOUBTED, Reading};
use super::thinning;
use crate::config::Config;
use crate::geometry::Point;

/// Visual points that are kept: they lie so close together that more of them add no information.
const VISUAL_POINTS: usize = 100;

/// Samples of what was swept that are kept.
const FREE_SAMPLES: usize = 600;

/// The evidence as template and local stage read it, in the work frame.
#[derive(Debug)]
pub(crate) struct FitEvidence {
    /// Thinned visual points, then all touches.
    pub(crate) attractors: Vec<Attractor>,
    /// Of the attractors those that a fit judges, and after them the points that measured normals add.
    pub(crate) measured: Vec<Attractor>,
    /// Further touches, in which the surface has its detail.
    pub(crate) detail: Vec<Attractor>,
    /// Where the object is not, and where it is.
    pub(crate) free_space: FreeSpace,
    /// Where the camera stood, in metres.
    pub(crate) viewpoint: Option<Point>,
}

impl FitEvidence {
    /// The attractors that are not doubted.
    pub(crate) fn believed(&self) -> impl Iterator<Item = &Attractor> {
        self.attractors.iter().filter(|attractor| attractor.provenance.doubt < DOUBTED)
    }

    /// The evidence of a ledger, as far as the stages in use look at it.
    pub(crate) fn of(ledger: &Ledger, reading: &Reading, config: &Config) -> Self {
        let stages = &config.stages;
        let attractors = reading.attractors(ledger, config.tactile_u_max);
        let mut measured = thinning::thin_visual(&attractors, VISUAL_POINTS, stages.visual_means);
        let is_attractor = |attractor: &Attractor| matches!(attractor.sense, Sense::Vision | Sense::Touch);
        let mut free_space = if stages.free_space {
            reading.free_space(ledger, config.probe_half_travel_m)
        } else {
            FreeSpace::default()
        };
        if let Some(support) = &ledger.support {
            free_space.add_support(support, &measured);
            measured.extend(reading.stands_at.map(|foot| Attractor::new(foot, 0.0, Sense::Support)));
        }
        let attractors = measured.iter().copied().filter(is_attractor).collect();
        let Crowd { judged, detail } = Crowd::of(measured);
        Self {
            attractors,
            measured: judged,
            detail,
            free_space: free_space.spread(FREE_SAMPLES),
            viewpoint: reading.viewpoint(ledger),
        }
    }
}
