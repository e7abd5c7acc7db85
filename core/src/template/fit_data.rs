//! What a template is fitted to: points of the surface with their weights, and points known to lie
//! outside or inside.

use super::patch_frame::PatchFrame;
use super::samples::{Block, Side};
use crate::evidence::attractor::{Attractor, Sense};
use crate::evidence::free_space::FreeSpace;
use crate::geometry::{Point, Vector};

/// All visual points together weigh at most as much as this many touches: they show one side only.
/// METHOD_PAPER has a weight of its own, 80.
const VISUAL_TOUCHES: f64 = 10.0;
/// A point of the plane that a measured normal tells of weighs this share of its touch.
const TANGENT_WEIGHT: f64 = 0.1;

/// The point that the object stands on weighs less than a touch: where it is on the plane is a guess.
const SUPPORT_WEIGHT: f64 = 0.5;

/// What a template is fitted to, in the frame of the patch.
#[derive(Clone, Debug)]
pub(super) struct FitData {
    /// The frame.
    pub(super) frame: PatchFrame,
    /// Points of the surface, with the weights of their residuals.
    pub(super) surface: Vec<(Vector, f64)>,
    /// The same points, then those outside the object and those inside, in blocks.
    pub(super) blocks: Vec<Block>,
    /// Whether it costs a template to reach beyond the points of the surface.
    pub(super) bounded: bool,
}

impl FitData {
    pub(super) fn new(attractors: &[Attractor], free_space: &FreeSpace, frame: PatchFrame) -> Self {
        let visual_weight = (VISUAL_TOUCHES / frame.visual_points).min(1.0);
        let weigh = |a: &Attractor| {
            let weight = match a.sense {
                Sense::Vision => visual_weight,
                Sense::Touch => 1.0,
                Sense::Tangent => TANGENT_WEIGHT,
                Sense::Support => SUPPORT_WEIGHT,
            };
            (frame.local(&a.point), (weight * (1.0 - a.provenance.doubt)).sqrt())
        };
        let local = |points: &[Point]| points.iter().map(|point| (frame.local(point), 1.0)).collect();
        let (outside, inside): (Vec<_>, Vec<_>) = (local(free_space.outside()), local(free_space.inside()));
        Self::of(frame, attractors.iter().map(weigh).collect(), &outside, &inside)
    }

    /// Points of the surface, outside and inside, with the weights of their residuals.
    pub(super) fn of(
        frame: PatchFrame,
        surface: Vec<(Vector, f64)>,
        outside: &[(Vector, f64)],
        inside: &[(Vector, f64)],
    ) -> Self {
        let of_surface = Block::of(Side::Surface, &surface);
        let others = Block::of(Side::Outside, outside).chain(Block::of(Side::Inside, inside));
        Self { blocks: of_surface.chain(others).collect(), surface, frame, bounded: false }
    }

    /// How many touches all points of the surface weigh together.
    pub(super) fn weight(&self) -> f64 {
        self.surface.iter().map(|(_, weight)| weight * weight).sum()
    }

    /// The diagonal of the box around all points of the surface, in lengths of the patch.
    pub(super) fn diagonal(&self) -> f64 {
        let points = || self.surface.iter().map(|(point, _)| point);
        let low = points().fold(Vector::repeat(f64::INFINITY), |low, point| low.inf(point));
        let high = points().fold(Vector::repeat(f64::NEG_INFINITY), |high, point| high.sup(point));
        (high - low).norm()
    }

    /// How far a point is from the nearest point of the surface, in lengths of the patch.
    pub(super) fn nearest(&self, to: &Vector) -> f64 {
        let squares = self.surface.iter().map(|(point, _)| (point - to).norm_squared());
        squares.fold(f64::INFINITY, f64::min).sqrt()
    }
}
