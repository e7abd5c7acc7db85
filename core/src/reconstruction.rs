//! The whole method: evidence in, a surface with its uncertainty out, and the next place to touch.
//!
//! The state is a fold over the evidence and nothing else: the same evidence in the same order
//! gives the same bits. What lies between evidence and surface is one page for each method,
//! [`paper`] and [`palpate`]; both are made of the stages that the other modules hold.

mod palpate;
mod paper;

use crate::config::{Config, Method};
use crate::displacement::VertexProcess;
use crate::error::Error;
use crate::evidence::Evidence;
use crate::exploration::{self, Proposal, Request, View};
use crate::geometry::{Direction, Icosphere, Point, TriangleMesh};
use crate::ledger::Ledger;
use crate::process_choice::Choice;
pub use crate::summary::{Stats, StopReason};
use crate::template::selection::SelectedFit;
use crate::template::{Ellipsoid, TemplateFit};
use crate::uncertainty::Reach;

/// Changes with every change of a result: a stored state hash holds for one version only.
pub const ALGORITHM_VERSION: &str = "4";

/// A session's state: its evidence, and the estimate that follows from it.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    config: Config,
    ledger: Ledger,
    estimate: Option<Estimate>,
}

/// What the evidence says about the object.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The fitted template, from which the next fit goes on.
    pub template: Template,
    /// How the local stage went.
    pub local: LocalReport,
    /// The surface.
    pub surface: Surface,
    reach: Reach,
    normals: Vec<Direction>,
    process: Option<VertexProcess>,
    choice: Option<Choice>,
    template_std_m: Option<Vec<f64>>,
}

/// The template of a method, with how its fit went.
#[derive(Clone, Debug)]
pub enum Template {
    /// The paper's.
    Ellipsoid(TemplateFit<Ellipsoid>),
    /// Superquadrics, selected by the evidence.
    Compound(Box<SelectedFit>),
}

impl Template {
    /// The centre of its body, in metres.
    pub fn centre(&self) -> Point {
        match self {
            Self::Ellipsoid(fit) => fit.shape.centre,
            Self::Compound(fit) => fit.chosen.shape.body.centre,
        }
    }

    /// What it looks like, in a word.
    pub fn family(&self) -> &'static str {
        match self {
            Self::Ellipsoid(_) => "ellipsoid",
            Self::Compound(fit) => fit.chosen.shape.family(),
        }
    }

    /// Root mean square distance of the attractors to it, in metres.
    pub fn rms_m(&self) -> f64 {
        match self {
            Self::Ellipsoid(fit) => fit.rms_m,
            Self::Compound(fit) => fit.chosen.rms_m,
        }
    }

    /// Whether it grew to the bound of its size.
    pub fn diverged(&self) -> bool {
        match self {
            Self::Ellipsoid(fit) => fit.diverged,
            Self::Compound(fit) => fit.chosen.diverged,
        }
    }
}

/// How a local stage went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalReport {
    /// Root mean square of what is left of the attractors' displacements, in metres.
    pub residual_m: f64,
    /// A lower bound of the condition number of its system.
    pub condition: f64,
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

/// What one piece of evidence changed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Update {
    /// The uncertainty of the touch, in [0, 1], where there was one.
    pub contact_uncertainty: Option<f64>,
    /// The farthest that the surface moved along its normal, in metres.
    pub max_vertex_move_m: f64,
    /// What the caller should know.
    pub warnings: Vec<String>,
}

impl Reconstruction {
    /// A session without evidence.
    pub fn new(config: Config) -> Self {
        Self { config, ledger: Ledger::default(), estimate: None }
    }

    /// The state after one more piece of evidence.
    ///
    /// # Errors
    /// [`Error::NoVisualPrior`] for an attempt before anything was seen.
    pub fn absorb(&self, evidence: &Evidence) -> Result<(Self, Update), Error> {
        let mut next = self.clone();
        let entry = next.ledger.enter(evidence, &next.config)?;
        let mut max_vertex_move_m = 0.0;
        if entry.changes_estimate {
            let estimate = next.estimate();
            max_vertex_move_m =
                self.estimate.as_ref().map_or(0.0, |before| estimate.farthest_move_m(before, self.sphere()));
            next.estimate = Some(estimate);
        }
        let update = Update {
            contact_uncertainty: entry.contact_uncertainty,
            max_vertex_move_m,
            warnings: entry.warnings,
        };
        Ok((next, update))
    }

    /// From evidence to surface (Sections III-D to III-F).
    fn estimate(&self) -> Estimate {
        let (ledger, before, config) = (&self.ledger, self.estimate.as_ref(), &self.config);
        match config.method {
            Method::Paper => paper::estimate(ledger, before, config, self.sphere()),
            Method::Palpate => palpate::estimate(ledger, before, config, self.sphere()),
        }
    }

    /// Where to touch next (Section III-G); nothing before the first visual prior.
    pub fn propose(&self, request: &Request) -> Proposal {
        self.view().map_or_else(Proposal::default, |view| exploration::propose(&view, request))
    }

    /// Whether nothing is left that may be touched.
    pub fn is_exhausted(&self) -> bool {
        self.view().is_some_and(|view| exploration::is_exhausted(&view))
    }

    fn view(&self) -> Option<View<'_>> {
        self.estimate.as_ref().map(|estimate| View {
            config: &self.config,
            ledger: &self.ledger,
            sphere: self.sphere(),
            mesh: &estimate.surface.mesh,
            normals: &estimate.normals,
            uncertainty: &estimate.surface.uncertainty,
            std_m: estimate.surface.std_m.as_deref(),
            reach: estimate.reach,
            centre: estimate.template.centre(),
            process: estimate.process.as_ref(),
            template_std_m: estimate.template_std_m.as_deref(),
        })
    }

    /// The parameters.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The evidence, sorted.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// The estimate with how each stage went; nothing before the first visual prior.
    pub fn last_estimate(&self) -> Option<&Estimate> {
        self.estimate.as_ref()
    }

    /// The surface; nothing before the first visual prior.
    pub fn surface(&self) -> Option<&Surface> {
        self.estimate.as_ref().map(|estimate| &estimate.surface)
    }

    fn sphere(&self) -> &'static Icosphere {
        Icosphere::get(self.config.icosphere_subdivisions as usize)
    }
}

impl Estimate {
    fn new(template: Template, local: LocalReport, surface: Surface, reach: Reach) -> Self {
        let normals = surface.mesh.vertex_normals();
        Self { template, local, surface, reach, normals, process: None, choice: None, template_std_m: None }
    }

    /// The same with the process that the surface's deviations come from, and how it was chosen.
    fn with_process(self, process: VertexProcess, choice: Choice) -> Self {
        Self { process: Some(process), choice: Some(choice), ..self }
    }

    /// The same with the template's deviation under each vertex, in metres.
    fn with_template_std(self, template_std_m: Vec<f64>) -> Self {
        Self { template_std_m: Some(template_std_m), ..self }
    }

    /// The farthest that this surface lies from another along its normals, in metres.
    ///
    /// A fit may renumber the vertices, so each looks for its nearest one before, starting from
    /// the one with its number.
    fn farthest_move_m(&self, before: &Self, sphere: &Icosphere) -> f64 {
        let old = &before.surface.mesh.vertices;
        let mut farthest = 0.0_f64;
        for (start, vertex) in self.surface.mesh.vertices.iter().enumerate() {
            let mut nearest = start;
            while let Some(&nearer) = sphere
                .neighbours(nearest)
                .iter()
                .filter(|&&next| {
                    (old[next as usize] - vertex).norm_squared() < (old[nearest] - vertex).norm_squared()
                })
                .min_by(|&&a, &&b| {
                    (old[a as usize] - vertex)
                        .norm_squared()
                        .total_cmp(&(old[b as usize] - vertex).norm_squared())
                })
            {
                nearest = nearer as usize;
            }
            farthest = farthest.max((vertex - old[nearest]).dot(&before.normals[nearest]).abs());
        }
        farthest
    }
}
