//! The path from the tool to where an approach starts: of two touches that teach as much, the
//! nearer one is sooner done.

use super::proposal::{ProposalRequest, ScoreTerm};
use super::situation::Situation;
use crate::geometry::Point;

/// The cost of getting to a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Travel {
    tool: Point,
    /// The diagonal of the object's bounding box, in metres: the unit of paths, so that
    /// one weight suits a strawberry and a bottle.
    size_m: f64,
    weight: f64,
}

impl Travel {
    /// Nothing where no tool was given or no weight was configured.
    pub(super) fn new(situation: &Situation<'_>, request: &ProposalRequest) -> Option<Self> {
        let weight = situation.config.alpha_travel;
        let tool = request.tool().filter(|_| weight > 0.0)?;
        Some(Self { tool, size_m: situation.size_m(), weight })
    }

    /// The term of a vertex: the path to the start of its approach, counted against it.
    pub(super) fn term(&self, situation: &Situation<'_>, vertex: u32) -> ScoreTerm {
        let (start, _) = situation.probe_segment(vertex as usize);
        ScoreTerm { term: "travel", weight: self.weight, value: -(start - self.tool).norm() / self.size_m }
    }
}
