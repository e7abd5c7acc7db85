//! What is asked of a proposal, and what it answers: candidates and what was left out.

use super::keep_out::KeepOut;
use super::pads::{Approach, Hand, MountedPad};
use crate::error::FieldError;
use crate::evidence::{WorkFrame, check_point};
use crate::geometry::{Direction, Point, Pose};

/// Candidates of one proposal lie at least this far apart, in metres: a second one within it
/// would be no alternative.
pub const SEPARATION_M: f64 = 0.010;
/// Around a place that is promised to another robot nothing nearer is proposed, in metres, however
/// small the pads.
const LEAST_LEASE_RADIUS_M: f64 = 0.030;

/// What a caller asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProposalRequest {
    top_k: usize,
    keep_out: Vec<KeepOut>,
    hand: Hand,
    tool: Option<Point>,
    leased: Vec<Point>,
    asked: Vec<u32>,
    /// The frame of regions, leased places and tool; the hand's is always the session's.
    frame: WorkFrame,
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

    /// The same for a tool with these pads: no part of the one that touches may enter a region. A point
    /// at the tool's origin, looking along its z axis, without them.
    pub fn for_pads(self, pads: Vec<MountedPad>) -> Self {
        Self { hand: self.hand.with_pads(pads), ..self }
    }

    /// The same away from places that are promised to others, in metres, beside those named before.
    pub fn leaving(mut self, leased: Vec<Point>) -> Self {
        self.leased.extend(leased);
        self
    }

    /// The same with the tool at this pose in the session's frame: the path to a candidate counts from
    /// there, and the tool is turned from there as little as possible.
    ///
    /// # Errors
    /// A number that is not finite.
    pub fn with_tool(self, base_from_tool: &Pose) -> Result<Self, FieldError> {
        let hand = self.hand.clone().held_at(base_from_tool.rotation);
        Ok(Self { hand, ..self.with_tool_at(base_from_tool.translation.vector.into())? })
    }

    /// The same with the tool at a place, in metres, from which the path to a candidate counts.
    ///
    /// # Errors
    /// A number that is not finite.
    pub fn with_tool_at(self, tool: Point) -> Result<Self, FieldError> {
        check_point("tool", &tool)?;
        Ok(Self { tool: Some(tool), ..self })
    }

    /// The same with the score of these vertices of the estimate, whether they can be proposed or not.
    pub fn explaining(self, asked: Vec<u32>) -> Self {
        Self { asked, ..self }
    }

    /// How many candidates at most.
    pub fn top_k(&self) -> usize {
        self.top_k
    }

    /// The vertices whose score is asked.
    pub fn asked(&self) -> &[u32] {
        &self.asked
    }

    /// Where the probe must not go.
    pub(super) fn keep_out(&self) -> &[KeepOut] {
        &self.keep_out
    }

    /// Radius of the disc around the pad that touches a surface with this normal, in metres: no turn of
    /// the pad about the normal reaches farther.
    pub(super) fn pad_radius_m(&self, normal: &Direction) -> f64 {
        let pad = self.hand.pad_for(&self.frame.direction_in_base(normal));
        std::f64::consts::SQRT_2 * pad.map_or(0.0, |(_, pad)| pad.half_side_m)
    }

    /// The tool before an approach that begins at `start` towards a surface with this normal.
    pub(super) fn approach(&self, start: &Point, normal: &Direction) -> Approach {
        self.hand.approach(&self.frame.point_in_base(start), &self.frame.direction_in_base(normal))
    }

    /// Places promised to others, in metres.
    pub(super) fn leased(&self) -> &[Point] {
        &self.leased
    }

    /// How far from a promised place the next candidate must be, in metres: two pads beside each other,
    /// whatever their turn, do not touch.
    pub(super) fn lease_radius_m(&self) -> f64 {
        (std::f64::consts::SQRT_2 * self.hand.largest_side_m() + SEPARATION_M).max(LEAST_LEASE_RADIUS_M)
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
            hand: self.hand.clone(),
            tool: self.tool.as_ref().map(|tool| frame.exact_point(tool)),
            leased: self.leased.iter().map(|place| frame.exact_point(place)).collect(),
            asked: self.asked.clone(),
            frame: *frame,
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
    /// The vertices whose score was asked, in that order, as far as the mesh has them.
    pub explained: Vec<Explained>,
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
    /// Close to a candidate that a robot did not try, for a reason that still holds.
    pub unreachable: u32,
    /// Close to a place that is promised to another robot.
    pub leased: u32,
}

/// Why a vertex is no candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exclusion {
    /// Its uncertainty is below what a candidate needs.
    AlreadyCertain,
    /// No adjacent vertex is confident: too far a step into the unknown.
    NoConfidentNeighbour,
    /// The approach would enter a forbidden part of the workspace.
    KeepOut,
    /// Close to a candidate that failed not long ago.
    RecentlyFailed,
    /// Close to a candidate that a robot did not try, for a reason that still holds.
    Unreachable,
    /// Close to a place that is promised to another robot.
    Leased,
    /// Not in the even selection of vertices that the strategy compares.
    NotCompared,
}

/// The score of a vertex, whether it can be proposed or not.
#[derive(Clone, Debug, PartialEq)]
pub struct Explained {
    /// The vertex of the current mesh.
    pub vertex: u32,
    /// The sum of weight times value over `terms`.
    pub score: f64,
    /// What the score is made of, each term as the candidates of the same proposal have it.
    pub terms: Vec<ScoreTerm>,
    /// Uncertainty of the vertex, in [0, 1].
    pub uncertainty: f64,
    /// Standard deviation of the surface there, in metres, where the method knows it.
    pub std_m: Option<f64>,
    /// Mean geodesic distance to the confident vertices around it, in metres; 0 without any.
    pub mean_geodesic_m: f64,
    /// Probability that an attempt there fails, where the method knows it.
    pub failure_risk: Option<f64>,
    /// Why it cannot be proposed; nothing where it can.
    pub excluded: Option<Exclusion>,
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
    /// The pad that touches, and the tool before the approach, in the session's frame.
    pub approach: Approach,
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
