//! What is asked of a proposal, and what it answers: candidates and what was left out.

use super::keep_out::KeepOut;
use crate::geometry::{Direction, Point};

/// What a caller asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProposalRequest {
    /// How many candidates at most.
    pub top_k: usize,
    /// Where the probe must not go.
    pub keep_out: Vec<KeepOut>,
    /// Where the tool is now, if that is to count, in metres.
    pub tool: Option<Point>,
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
