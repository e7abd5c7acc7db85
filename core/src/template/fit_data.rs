//! What a template is fitted to, and how far it is from a template.

use super::PatchFrame;
use super::field::Field;
use super::part::Part;
use crate::attractor::{Attractor, Sense};
use crate::free_space::FreeSpace;
use crate::geometry::{Point, Vector};

/// All visual points together weigh as much as this many touches: they show one side only.
const VISUAL_WEIGHT: f64 = 10.0;
/// A point of the plane that a measured normal tells of weighs this share of its touch.
const TANGENT_WEIGHT: f64 = 0.1;
/// Attractors further than this from the template count linearly, in lengths of the patch.
pub(super) const HUBER: f64 = 0.1;

/// What a template is fitted to, in the frame of the patch.
#[derive(Clone, Debug)]
pub(super) struct FitData {
    /// The frame.
    pub(super) frame: PatchFrame,
    /// Points of the surface, with the weights of their residuals.
    pub(super) surface: Vec<(Vector, f64)>,
    /// Points outside the object.
    pub(super) free: Vec<Vector>,
    /// Points inside the object.
    pub(super) occupied: Vec<Vector>,
}

impl FitData {
    pub(super) fn new(attractors: &[Attractor], free_space: &FreeSpace, frame: PatchFrame) -> Self {
        let visual_weight = (VISUAL_WEIGHT / frame.visual_points).min(1.0);
        let weigh = |a: &Attractor| {
            let weight = match a.sense {
                Sense::Vision => visual_weight,
                Sense::Touch => 1.0,
                Sense::Tangent => TANGENT_WEIGHT,
            };
            (frame.local(&a.point), weight.sqrt())
        };
        let local = |points: &[Point]| points.iter().map(|point| frame.local(point)).collect();
        Self {
            surface: attractors.iter().map(weigh).collect(),
            free: local(free_space.outside()),
            occupied: local(free_space.inside()),
            frame,
        }
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

/// For every point of the data the signed distance to the nearest of some parts; infinite for none,
/// and for a free point outside the boxes around all of them.
#[derive(Clone, Debug)]
pub(super) struct Distances {
    pub(super) surface: Vec<f64>,
    pub(super) free: Vec<f64>,
    pub(super) occupied: Vec<f64>,
}

impl Distances {
    pub(super) fn to<'a>(parts: impl Iterator<Item = &'a Part>, data: &FitData) -> Self {
        let parts: Vec<Field<'_>> = parts.map(Part::field).collect();
        let nearest =
            |point: &Vector| parts.iter().map(|part| part.residual(point).0).fold(f64::INFINITY, f64::min);
        let nearest_of_near = |point: &Vector| {
            let near = parts.iter().filter(|part| !part.is_beyond(point));
            near.map(|part| part.residual(point).0).fold(f64::INFINITY, f64::min)
        };
        Self {
            surface: data.surface.iter().map(|(point, _)| nearest(point)).collect(),
            free: data.free.iter().map(nearest_of_near).collect(),
            occupied: data.occupied.iter().map(nearest).collect(),
        }
    }

    /// The cost of a template at these distances, without its priors.
    pub(super) fn cost(&self, data: &FitData) -> f64 {
        let huber = |r: f64| {
            let size = r.abs();
            if size <= HUBER { 0.5 * size * size } else { HUBER * (size - 0.5 * HUBER) }
        };
        let weights = data.surface.iter().map(|(_, weight)| weight * weight);
        let surface: f64 = weights.zip(&self.surface).map(|(weight, r)| weight * huber(*r)).sum();
        let free: f64 = self.free.iter().map(|r| 0.5 * r.min(0.0).powi(2)).sum();
        let occupied: f64 = self.occupied.iter().map(|r| 0.5 * r.max(0.0).powi(2)).sum();
        surface + free + occupied
    }
}
