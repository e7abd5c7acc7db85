//! Exploration: where to touch next (Section III-G).
//!
//! A strategy ranks the vertices of the estimate; what is forbidden is left out, and the best few
//! that lie apart from each other become candidates. A proposal is a pure function of the state.

mod baselines;
mod expected_gain;
mod failures;
mod proactive;
mod risk;
mod template_error;
mod travel;

use self::travel::Travel;
use crate::config::{Config, Strategy};
use crate::displacement::VertexProcess;
use crate::geometry::{Direction, Icosphere, Point, TriangleMesh};
use crate::ledger::Ledger;
use crate::uncertainty::Reach;

/// Candidates of one proposal lie at least this far apart, in metres: a second one within it
/// would be no alternative.
const SEPARATION_M: f64 = 0.010;

/// What a caller asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    /// How many candidates at most.
    pub top_k: usize,
    /// Where the probe must not go.
    pub keep_out: Vec<KeepOut>,
    /// Where the tool is now, if that is to count, in metres.
    pub tool: Option<Point>,
}

/// A part of the workspace that the probe's way must not enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KeepOut {
    /// All points with `normal . p < offset_m`, such as below a table.
    HalfSpace {
        /// The direction out of the forbidden side.
        normal: Direction,
        /// Where the boundary lies along it, in metres.
        offset_m: f64,
    },
    /// A forbidden ball.
    Ball {
        /// Its centre, in metres.
        center: Point,
        /// Its radius, in metres.
        radius_m: f64,
    },
}

impl KeepOut {
    /// Whether the way from `start` to `end` enters.
    fn blocks(&self, start: &Point, end: &Point) -> bool {
        match self {
            Self::HalfSpace { normal, offset_m } => {
                normal.dot(&start.coords).min(normal.dot(&end.coords)) < *offset_m
            }
            Self::Ball { center, radius_m } => {
                let way = end - start;
                let along = ((center - start).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
                (start + way * along - center).norm() < *radius_m
            }
        }
    }
}

/// Candidates, the best first, and what was left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Proposal {
    /// Where to touch; empty when nothing is left to touch.
    pub candidates: Vec<Candidate>,
    /// How many vertices were left out, each for its first reason.
    pub excluded: Excluded,
}

/// How many vertices were left out for which reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Excluded {
    /// Their uncertainty is below what a candidate needs.
    pub already_certain: u32,
    /// No adjacent vertex is confident: too far a step into the unknown.
    pub no_confident_neighbour: u32,
    /// The way of the probe would enter a forbidden part of the workspace.
    pub keep_out: u32,
    /// Close to a candidate that failed not long ago.
    pub recently_failed: u32,
}

/// A place to touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The vertex of the current mesh.
    pub vertex: u32,
    /// Its position, in metres.
    pub point: Point,
    /// The outward normal of the estimate there.
    pub normal: Direction,
    /// Where the probe starts: `point + d normal`, in metres.
    pub probe_start: Point,
    /// Where it gives up: `point - d normal`, in metres.
    pub probe_end: Point,
    /// The value that was maximised: the sum of weight times value over `terms`.
    pub score: f64,
    /// What the score is made of.
    pub terms: Vec<ScoreTerm>,
    /// Uncertainty of the vertex, in [0, 1].
    pub uncertainty: f64,
    /// Standard deviation of the surface there, in metres, where the method knows it.
    pub std_m: Option<f64>,
    /// Mean geodesic distance to the confident vertices around it, in metres; 0 without any.
    pub mean_geodesic_m: f64,
    /// Probability that the attempt fails, where the method knows it.
    pub failure_risk: Option<f64>,
    /// Whether the thresholds had to be lowered to find it.
    pub relaxed: bool,
    /// Why it was chosen, in words.
    pub why: String,
}

/// One term of a score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreTerm {
    /// Its name.
    pub term: &'static str,
    /// Its weight.
    pub weight: f64,
    /// Its value.
    pub value: f64,
}

/// What a strategy looks at.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The parameters.
    pub config: &'a Config,
    /// The evidence so far.
    pub ledger: &'a Ledger,
    /// The sphere whose faces the mesh has.
    pub sphere: &'static Icosphere,
    /// The estimate.
    pub mesh: &'a TriangleMesh,
    /// Its vertex normals.
    pub normals: &'a [Direction],
    /// Its vertex uncertainties, in [0, 1].
    pub uncertainty: &'a [f64],
    /// Its standard deviations, in metres, where the method knows them.
    pub std_m: Option<&'a [f64]>,
    /// How far the confidence of an attractor spreads.
    pub reach: Reach,
    /// The centre of the template, in metres.
    pub centre: Point,
    /// The process that the deviations come from, where the method has one.
    pub process: Option<&'a VertexProcess>,
    /// Standard deviation of the template under each vertex, in metres, where the method knows it.
    pub template_std_m: Option<&'a [f64]>,
}

#[cfg(test)]
impl<'a> View<'a> {
    /// A view of a mesh with the icosphere's normals, half uncertain everywhere, that knows nothing more.
    fn plain(
        config: &'a Config,
        ledger: &'a Ledger,
        sphere: &'static Icosphere,
        mesh: &'a TriangleMesh,
    ) -> Self {
        View {
            config,
            ledger,
            sphere,
            mesh,
            normals: &sphere.directions,
            uncertainty: vec![0.5; mesh.vertices.len()].leak(),
            std_m: None,
            reach: Reach { hops: 5, length_m: 0.02 },
            centre: Point::origin(),
            process: None,
            template_std_m: None,
        }
    }
}

impl View<'_> {
    /// The way of the probe to a vertex: from outside to inside.
    fn probe_way(&self, vertex: usize) -> (Point, Point) {
        let travel = self.normals[vertex].into_inner() * self.config.probe_half_travel_m;
        (self.mesh.vertices[vertex] + travel, self.mesh.vertices[vertex] - travel)
    }

    /// `u <= u'_max`, Eq. (3).
    fn is_confident(&self, vertex: u32) -> bool {
        self.uncertainty[vertex as usize] <= self.config.confident_max
    }

    fn has_confident_neighbour(&self, vertex: u32) -> bool {
        self.sphere.neighbours(vertex as usize).iter().any(|&next| self.is_confident(next))
    }
}

/// A vertex that a strategy offers.
#[derive(Clone, Debug)]
struct Ranked {
    vertex: u32,
    terms: Vec<ScoreTerm>,
    /// Mean geodesic distance to the confident vertices around it, where the strategy asked for it.
    mean_geodesic_m: Option<f64>,
}

impl Ranked {
    fn score(&self) -> f64 {
        total(&self.terms)
    }
}

/// The sum of weight times value.
fn total(terms: &[ScoreTerm]) -> f64 {
    terms.iter().map(|term| term.weight * term.value).sum()
}

/// Vertices in the order of their preference, and what was left out.
struct Ranking<'a> {
    /// The best first, each found when it is asked for: few ever are.
    ranked: Box<dyn Iterator<Item = Ranked> + 'a>,
    relaxed: bool,
    excluded: Excluded,
    /// Why a vertex is offered, in words; asked only of those that become candidates.
    why: Box<dyn Fn(&Ranked) -> String>,
}

/// Proposes the next contacts.
pub fn propose(view: &View<'_>, request: &Request) -> Proposal {
    let mut excluded = Excluded::default();
    let reachable: Vec<u32> = (0..view.mesh.vertices.len() as u32)
        .filter(|&vertex| {
            let (start, end) = view.probe_way(vertex as usize);
            let blocked = request.keep_out.iter().any(|region| region.blocks(&start, &end));
            excluded.keep_out += u32::from(blocked);
            !blocked
        })
        .collect();
    let travel = Travel::new(view, request);
    let mut ranking = match view.config.strategy {
        Strategy::Proactive => proactive::rank(view, &reachable, travel),
        Strategy::ExpectedGain => expected_gain::rank(view, &reachable, travel),
        Strategy::MinUncertainty => baselines::min_uncertainty(view, &reachable),
        Strategy::Uniform => baselines::uniform(view, &reachable),
        Strategy::Random => baselines::random(view, &reachable),
    };
    let mut candidates: Vec<Candidate> = Vec::new();
    while candidates.len() < request.top_k {
        let Some(ranked) = ranking.ranked.next() else { break };
        let point = view.mesh.vertices[ranked.vertex as usize];
        if candidates.iter().all(|other| (other.point - point).norm() >= SEPARATION_M) {
            candidates.push(candidate(view, &ranked, &ranking));
        }
    }
    let excluded = Excluded { keep_out: excluded.keep_out, ..ranking.excluded };
    Proposal { candidates, excluded }
}

/// Whether a strategy that avoids what has failed has nothing left to offer.
pub fn is_exhausted(view: &View<'_>) -> bool {
    view.config.strategy.weighs_terms()
        && (0..view.mesh.vertices.len() as u32).all(|vertex| failures::is_taboo(view, vertex))
}

fn candidate(view: &View<'_>, ranked: &Ranked, ranking: &Ranking<'_>) -> Candidate {
    let vertex = ranked.vertex as usize;
    let (probe_start, probe_end) = view.probe_way(vertex);
    let measure = || proactive::Frontier::new(view).mean_geodesic_m(ranked.vertex);
    let std_m = view.std_m.map(|std_m| std_m[vertex]);
    Candidate {
        vertex: ranked.vertex,
        point: view.mesh.vertices[vertex],
        normal: view.normals[vertex],
        probe_start,
        probe_end,
        score: ranked.score(),
        terms: ranked.terms.clone(),
        uncertainty: view.uncertainty[vertex],
        std_m,
        mean_geodesic_m: ranked.mean_geodesic_m.or_else(measure).unwrap_or(0.0),
        failure_risk: std_m.map(|std_m| risk::of_failure(view.config, std_m)),
        relaxed: ranking.relaxed,
        why: (ranking.why)(ranked),
    }
}
