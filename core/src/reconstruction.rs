//! The whole method: evidence in, a surface with its uncertainty out, and the next place to touch.
//!
//! The state is a fold over the evidence and nothing else: the same evidence in the same order
//! gives the same bits. What lies between evidence and surface is one page for each method,
//! [`paper`], [`palpate`] and [`gpis`]; they are made of the stages that the other modules hold.

mod belief;
mod findings;
mod gpis;
mod motion;
mod palpate;
mod paper;
mod summary;
mod warm_start;

pub use findings::{Findings, FoundDoubt, FoundMotion, FoundOffset};
pub use summary::{Stats, StopReason};
pub use warm_start::WarmStart;

use std::sync::{Arc, LazyLock};

use crate::arithmetic;
use crate::config::{Config, Method, Strategy};
use crate::error::{Error, FieldError};
use crate::evidence::attractor::Attractor;
use crate::evidence::ledger::Ledger;
use crate::evidence::{Evidence, Reading, WorkFrame};
use crate::exploration::{self, Deviations, DoubtedTouch, Proposal, ProposalRequest, Situation};
use crate::geometry::{Connectivity, Direction, Icosphere, Point, SurfaceIndex, TriangleMesh, Vector};
use crate::local::Raised;
use crate::template::{EllipsoidFit, SelectedFit};
use crate::uncertainty::Reach;
use crate::warning::Warning;

/// Changes with every change of the method's results.
pub const ALGORITHM_VERSION: &str = "12";

/// The version of the method and, after a dash, a tag of this machine's arithmetic: a stored state hash holds where
/// both are the same, since last bits differ between kinds of processors.
pub fn version() -> &'static str {
    static VERSION: LazyLock<String> = LazyLock::new(|| format!("{ALGORITHM_VERSION}-{}", *arithmetic::TAG));
    &VERSION
}

/// A session's state: its evidence, and the estimate that follows from it.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    config: Config,
    /// The frame that ledger and estimate are in.
    frame: WorkFrame,
    ledger: Ledger,
    estimate: Option<Arc<Estimate>>,
    /// Whether estimates are left out for now.
    defers: bool,
}

/// What the evidence says about the object.
#[derive(Clone, Debug)]
pub struct Estimate {
    surface: Surface,
    normals: Vec<Direction>,
    connectivity: Arc<Connectivity>,
    reach: Reach,
    detail: Detail,
    /// What its fit took from the one before.
    began_with: WarmStart,
}

/// How the stages of a method went, from which its next fit goes on.
#[derive(Clone, Debug)]
enum Detail {
    Paper(PaperDetail),
    Gpis(GpisDetail),
    Palpate(Box<PalpateDetail>),
}

/// How the stages of METHOD_PAPER went.
#[derive(Clone, Debug)]
struct PaperDetail {
    template: EllipsoidFit,
    /// Root mean square of what the surface leaves of the attractors' heights, in metres.
    residual_m: f64,
}

/// How the stages of METHOD_GPIS went.
#[derive(Clone, Debug)]
struct GpisDetail {
    /// A point inside, in metres.
    centre: Point,
    /// Root mean square distance of the attractors from the surface, in metres.
    residual_m: f64,
}

/// How the stages of METHOD_PALPATE went.
#[derive(Clone, Debug)]
struct PalpateDetail {
    /// How many fits there were, this one included.
    number: usize,
    /// How the next fit is to read the evidence.
    reading: Reading,
    template: SelectedFit,
    /// Standard deviation of the template under each vertex, in metres.
    template_std_m: Vec<f64>,
    raised: Raised,
}

/// A mesh with its uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// The mesh, in metres.
    pub mesh: TriangleMesh,
    /// Uncertainty of each vertex, in [0, 1].
    pub uncertainty: Vec<f64>,
    /// Standard deviation of each vertex along its normal, in metres, where the method knows it.
    pub std_m: Option<Vec<f64>>,
}

impl Surface {
    /// The same surface in the session's frame.
    fn in_base(&self, frame: &WorkFrame) -> Self {
        let vertices = self.mesh.vertices.iter().map(|vertex| frame.point_in_base(vertex)).collect();
        let mesh = TriangleMesh { vertices, faces: self.mesh.faces.clone() };
        Self { mesh, uncertainty: self.uncertainty.clone(), std_m: self.std_m.clone() }
    }
}

/// What one piece of evidence changed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Update {
    /// The uncertainty of the touch, in [0, 1], where there was one.
    pub contact_uncertainty: Option<f64>,
    /// The farthest that the surface moved along its normal, in metres.
    pub max_vertex_move_m: f64,
    /// What the caller should know.
    pub warnings: Vec<Warning>,
}

impl Reconstruction {
    /// A session without evidence.
    pub fn new(config: Config) -> Self {
        Self { config, frame: WorkFrame::Session, ledger: Ledger::default(), estimate: None, defers: false }
    }

    /// The state after one more piece of evidence.
    ///
    /// # Errors
    /// [`Error::NoVisualPrior`] for an attempt before anything was seen.
    pub fn absorb(&self, evidence: &Evidence) -> Result<(Self, Update), Error> {
        let mut next = self.clone();
        if let (Evidence::VisualPrior(prior), false) = (evidence, self.has_seen()) {
            next.frame = WorkFrame::of(self.config.method, prior);
            next.ledger.support = self.config.support.map(|plane| next.frame.plane(&plane));
            let up = self.config.support.map_or(Vector::z_axis(), |plane| *plane.normal());
            next.ledger.up = next.frame.direction(&up).into_inner();
        }
        let entry = next.ledger.enter(&next.frame.enter(evidence), &next.config)?;
        let mut max_vertex_move_m = 0.0;
        if entry.changes_estimate && !self.defers {
            let estimate = next.fitted(WarmStart::after(self.last_estimate()));
            max_vertex_move_m = self.estimate.as_ref().map_or(0.0, |before| estimate.farthest_move_m(before));
            next.estimate = Some(Arc::new(estimate));
        }
        let warnings = entry.warnings.into_iter().chain(next.findings().warnings_since(&self.findings()));
        let update = Update {
            contact_uncertainty: entry.contact_uncertainty.map(|u| next.contact_uncertainty().unwrap_or(u)),
            max_vertex_move_m,
            warnings: warnings.collect(),
        };
        Ok((next, update))
    }

    /// The uncertainty of the latest touch as it is read, in [0, 1].
    fn contact_uncertainty(&self) -> Option<f64> {
        let latest = self.ledger.entries.checked_sub(1)?;
        let touch = self.ledger.touches.iter().find(|touch| touch.at == latest)?;
        Some(self.reading().uncertainty(touch, self.config.tactile_u_max))
    }

    /// From evidence to surface (Sections III-D to III-F).
    fn fitted(&self, start: WarmStart) -> Estimate {
        let (ledger, config, sphere) = (&self.ledger, &self.config, self.sphere());
        let estimate = match config.method {
            Method::Paper => paper::estimate(ledger, config, sphere),
            Method::Gpis => gpis::estimate(ledger, config),
            Method::Palpate => palpate::estimate(ledger, start.palpate(), config, sphere),
        };
        Estimate { began_with: start, ..estimate }
    }

    /// Where to touch next (Section III-G); nothing before the first visual prior.
    pub fn propose(&self, request: &ProposalRequest) -> Proposal {
        let request = request.entered(&self.frame);
        let proposal = self.situation().map(|situation| exploration::propose(&situation, &request));
        proposal.unwrap_or_default().in_base(&self.frame)
    }

    /// Where another strategy than the session's own would touch next, from the same evidence.
    ///
    /// # Errors
    /// The method refuses the strategy.
    pub fn propose_by(&self, strategy: Strategy, request: &ProposalRequest) -> Result<Proposal, FieldError> {
        let config = self.config.with_strategy(strategy)?;
        let request = request.entered(&self.frame);
        let situation = self.situation().map(|situation| Situation { config: &config, ..situation });
        let proposal = situation.map(|situation| exploration::propose(&situation, &request));
        Ok(proposal.unwrap_or_default().in_base(&self.frame))
    }

    /// Whether nothing is left that may be touched.
    pub fn is_exhausted(&self) -> bool {
        self.situation().is_some_and(|situation| exploration::is_exhausted(&situation))
    }

    fn situation(&self) -> Option<Situation<'_>> {
        self.estimate.as_ref().map(|estimate| Situation {
            config: &self.config,
            ledger: &self.ledger,
            connectivity: &estimate.connectivity,
            mesh: &estimate.surface.mesh,
            normals: &estimate.normals,
            uncertainty: &estimate.surface.uncertainty,
            reach: estimate.reach,
            centre: estimate.template_centre(),
            deviations: estimate.deviations(),
            doubted: estimate.doubted(&self.ledger),
        })
    }

    /// The parameters.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The evidence, sorted, in the frame that the method works in.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// The estimate with how each stage went; nothing before the first visual prior.
    pub fn last_estimate(&self) -> Option<&Estimate> {
        self.estimate.as_deref()
    }

    /// Whether anything was seen.
    pub fn has_seen(&self) -> bool {
        !self.ledger.views.is_empty()
    }

    /// The surface in the session's frame; nothing before the first visual prior.
    pub fn surface(&self) -> Option<Surface> {
        self.estimate.as_ref().map(|estimate| estimate.surface.in_base(&self.frame))
    }

    /// Whether another state has the same surface.
    pub fn has_surface_of(&self, other: &Self) -> bool {
        fn surface(state: &Reconstruction) -> Option<&Surface> {
            state.estimate.as_ref().map(|estimate| &estimate.surface)
        }
        self.frame == other.frame && surface(self) == surface(other)
    }

    /// The centre of the template's body, in metres; nothing before the first visual prior.
    pub fn template_centre(&self) -> Option<Point> {
        self.estimate.as_ref().map(|estimate| self.frame.point_in_base(&estimate.template_centre()))
    }

    /// What pulls the surface, as the evidence is read, in the frame that the method works in.
    pub fn attractors(&self) -> Vec<Attractor> {
        self.reading().attractors(&self.ledger, self.config.tactile_u_max)
    }

    /// How the evidence is read.
    fn reading(&self) -> Reading {
        match self.estimate.as_ref().map(|estimate| &estimate.detail) {
            Some(Detail::Palpate(detail)) => detail.reading.clone(),
            _ => Reading::as_printed(&self.ledger),
        }
    }

    fn sphere(&self) -> &'static Icosphere {
        Icosphere::get(self.config.icosphere_subdivisions as usize)
    }
}

impl Estimate {
    fn new(surface: Surface, reach: Reach, detail: Detail, connectivity: Arc<Connectivity>) -> Self {
        let normals = surface.mesh.vertex_normals();
        Self { normals, surface, connectivity, reach, detail, began_with: WarmStart::default() }
    }

    /// The centre of the template's body, in metres.
    fn template_centre(&self) -> Point {
        match &self.detail {
            Detail::Paper(detail) => detail.template.shape.centre,
            Detail::Gpis(detail) => detail.centre,
            Detail::Palpate(detail) => detail.template.shape.body.centre,
        }
    }

    /// What the template looks like, in a word.
    pub fn template_family(&self) -> &'static str {
        match &self.detail {
            Detail::Paper(_) => "ellipsoid",
            Detail::Gpis(_) => "implicit surface",
            Detail::Palpate(detail) => detail.template.shape.family(),
        }
    }

    /// Whether the template grew to the bound of its size.
    pub fn has_diverged(&self) -> bool {
        match &self.detail {
            Detail::Paper(_) | Detail::Gpis(_) => false,
            Detail::Palpate(detail) => detail.template.diverged,
        }
    }

    /// Root mean square of what the surface leaves of the attractors' heights over the template, in
    /// metres.
    pub fn residual_m(&self) -> f64 {
        match &self.detail {
            Detail::Paper(detail) => detail.residual_m,
            Detail::Gpis(detail) => detail.residual_m,
            Detail::Palpate(detail) => detail.raised.residual_m,
        }
    }

    /// Touches that contradict what else is known, in the frame that the method works in.
    fn doubted(&self, ledger: &Ledger) -> Vec<DoubtedTouch> {
        match &self.detail {
            Detail::Paper(_) | Detail::Gpis(_) => Vec::new(),
            Detail::Palpate(detail) => belief::doubted(&detail.reading, ledger),
        }
    }

    fn deviations(&self) -> Option<Deviations<'_>> {
        match &self.detail {
            Detail::Paper(_) | Detail::Gpis(_) => None,
            Detail::Palpate(detail) => Some(Deviations {
                std_m: &detail.raised.std_m,
                template_std_m: &detail.template_std_m,
                process: &detail.raised.process,
            }),
        }
    }

    /// The farthest that this surface lies from another along its normals, in metres.
    fn farthest_move_m(&self, before: &Self) -> f64 {
        if Arc::ptr_eq(&self.connectivity, &before.connectivity) {
            self.farthest_move_of_vertices_m(before)
        } else {
            let old = SurfaceIndex::new(&before.surface.mesh);
            let distances = self
                .surface
                .mesh
                .vertices
                .iter()
                .filter_map(|vertex| Some(old.as_ref()?.closest(vertex).distance_m));
            distances.fold(0.0, f64::max)
        }
    }

    /// The same where both surfaces have the same faces.
    ///
    /// A fit may renumber the vertices, so each looks for its nearest one before, starting from
    /// the one with its number.
    fn farthest_move_of_vertices_m(&self, before: &Self) -> f64 {
        let old = &before.surface.mesh.vertices;
        let mut farthest = 0.0_f64;
        for (start, vertex) in self.surface.mesh.vertices.iter().enumerate() {
            let square = |at: usize| (old[at] - vertex).norm_squared();
            let mut nearest = start;
            while let Some(&nearer) = self
                .connectivity
                .neighbours(nearest)
                .iter()
                .filter(|&&next| square(next as usize) < square(nearest))
                .min_by(|&&a, &&b| square(a as usize).total_cmp(&square(b as usize)))
            {
                nearest = nearer as usize;
            }
            farthest = farthest.max((vertex - old[nearest]).dot(&before.normals[nearest]).abs());
        }
        farthest
    }
}
