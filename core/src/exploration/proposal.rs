//! What is asked of a proposal, and what it answers: candidates and what was left out.

use super::keep_out::KeepOut;
use crate::error::FieldError;
use crate::evidence::{WorkFrame, check_point};
use crate::geometry::{Direction, Point};

/// What a caller asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProposalRequest {
    top_k: usize,
    keep_out: Vec<KeepOut>,
    pad_half_side_m: f64,
    tool: Option<Point>,
}

impl ProposalRequest {
    /// At most `top_k` candidates.
    pub fn best(top_k: usize) -> Self {
        Self { top_k, ..Self::default() }
    }

    /// The same where the probe must not enter some regions, beside those named before.
    pub fn keeping_out_of(mut self, keep_out: Vec<KeepOut>) -> Self {
        self.keep_out.extend(keep_out);
        self
    }

    /// The same for a square pad, across the approach, of half this side in metres: no part of it may
    /// enter a region. A point without it.
    pub fn for_pad(self, pad_half_side_m: f64) -> Self {
        Self { pad_half_side_m, ..self }
    }

    /// The same with the tool at a place, in metres, from which the path to a candidate counts.
    ///
    /// # Errors
    /// A number that is not finite.
    pub fn with_tool_at(self, tool: Point) -> Result<Self, FieldError> {
        check_point("tool", &tool)?;
        Ok(Self { tool: Some(tool), ..self })
    }

    /// How many candidates at most.
    pub fn top_k(&self) -> usize {
        self.top_k
    }

    /// Where the probe must not go.
    pub(super) fn keep_out(&self) -> &[KeepOut] {
        &self.keep_out
    }

    /// Radius of the disc around the pad, in metres.
    pub(super) fn pad_radius_m(&self) -> f64 {
        std::f64::consts::SQRT_2 * self.pad_half_side_m
    }

    /// Whether some region is named.
    pub fn keeps_out(&self) -> bool {
        !self.keep_out.is_empty()
    }

    /// Where the tool is, if that is to count, in metres.
    pub(super) fn tool(&self) -> Option<Point> {
        self.tool
    }

    /// The same request in the frame that a method works in.
    pub(crate) fn entered(&self, frame: &WorkFrame) -> Self {
        Self {
            top_k: self.top_k,
            keep_out: self.keep_out.iter().map(|region| region.entered(frame)).collect(),
            pad_half_side_m: self.pad_half_side_m,
            tool: self.tool.as_ref().map(|tool| frame.exact_point(tool)),
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
    /// The approach would enter a forbidden part of the workspace.
    pub keep_out: u32,
    /// Close to a candidate that failed not long ago.
    pub recently_failed: u32,
}

impl Proposal {
    /// The same proposal in the session's frame.
    pub(crate) fn in_base(self, frame: &WorkFrame) -> Self {
        let in_base = |candidate: Candidate| Candidate {
            point: frame.point_in_base(&candidate.point),
            normal: frame.direction_in_base(&candidate.normal),
            probe_start: frame.point_in_base(&candidate.probe_start),
            probe_end: frame.point_in_base(&candidate.probe_end),
            ..candidate
        };
        Self { candidates: self.candidates.into_iter().map(in_base).collect(), ..self }
    }
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
