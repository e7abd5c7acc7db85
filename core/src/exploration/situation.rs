//! What a strategy looks at: the estimate, the evidence and the parameters.

use crate::config::Config;
use crate::evidence::ledger::Ledger;
use crate::geometry::{Connectivity, Direction, Point, TriangleMesh};
use crate::local::VertexProcess;
use crate::uncertainty::Reach;

/// What a strategy looks at.
#[derive(Clone, Debug)]
pub struct Situation<'a> {
    /// The parameters.
    pub config: &'a Config,
    /// The evidence so far.
    pub ledger: &'a Ledger,
    /// What of the mesh lies next to each other.
    pub connectivity: &'a Connectivity,
    /// The estimate.
    pub mesh: &'a TriangleMesh,
    /// Its vertex normals.
    pub normals: &'a [Direction],
    /// Its vertex uncertainties, in [0, 1].
    pub uncertainty: &'a [f64],
    /// How far off it may be, where the method knows that.
    pub deviations: Option<Deviations<'a>>,
    /// How far the confidence of an attractor spreads.
    pub reach: Reach,
    /// The centre of the template, in metres.
    pub centre: Point,
    /// Touches that contradict what else is known.
    pub doubted: Vec<DoubtedTouch>,
}

/// A touch that contradicts what else is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubtedTouch {
    /// The number of its piece of evidence, from 0.
    pub at: usize,
    /// The touched point, in metres.
    pub point: Point,
    /// The direction of its approach.
    pub approach: Direction,
    /// The probability that it is none, in [0, 1].
    pub doubt: f64,
    /// Whether its place was touched or swept again.
    pub is_settled: bool,
}

/// How far off an estimate may be.
#[derive(Clone, Copy, Debug)]
pub struct Deviations<'a> {
    /// Standard deviation of the surface at each vertex, in metres.
    pub std_m: &'a [f64],
    /// Standard deviation of the template under each vertex, in metres.
    pub template_std_m: &'a [f64],
    /// The process that the former come from.
    pub process: &'a VertexProcess,
}

#[cfg(test)]
impl<'a> Situation<'a> {
    /// A mesh with the icosphere's normals, half uncertain everywhere, that knows nothing more.
    pub(super) fn plain(
        config: &'a Config,
        ledger: &'a Ledger,
        sphere: &'static crate::geometry::Icosphere,
        mesh: &'a TriangleMesh,
    ) -> Self {
        Situation {
            config,
            ledger,
            connectivity: &sphere.connectivity,
            mesh,
            normals: &sphere.directions,
            uncertainty: vec![0.5; mesh.vertices.len()].leak(),
            deviations: None,
            reach: Reach { hops: 5, length_m: 0.02 },
            centre: Point::origin(),
            doubted: Vec::new(),
        }
    }
}

impl Situation<'_> {
    /// The segment that the probe travels to a vertex: from outside to inside.
    pub(super) fn probe_segment(&self, vertex: usize) -> (Point, Point) {
        let travel = self.normals[vertex].into_inner() * self.config.probe_half_travel_m;
        (self.mesh.vertices[vertex] + travel, self.mesh.vertices[vertex] - travel)
    }

    /// The diagonal of the estimate's bounding box, in metres.
    pub(super) fn size_m(&self) -> f64 {
        let vertices = &self.mesh.vertices;
        let (low, high) = vertices
            .iter()
            .fold((vertices[0], vertices[0]), |(low, high), vertex| (low.inf(vertex), high.sup(vertex)));
        (high - low).norm()
    }

    /// Whether the estimate has such a vertex.
    pub(super) fn has(&self, vertex: u32) -> bool {
        (vertex as usize) < self.mesh.vertices.len()
    }

    /// `u <= u'_max`, Eq. (3).
    pub(super) fn is_confident(&self, vertex: u32) -> bool {
        self.uncertainty[vertex as usize] <= self.config.confident_max
    }

    pub(super) fn has_confident_neighbour(&self, vertex: u32) -> bool {
        self.connectivity.neighbours(vertex as usize).iter().any(|&next| self.is_confident(next))
    }
}
