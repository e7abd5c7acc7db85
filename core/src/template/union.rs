//! A union of parts that is fitted part by part, and judged as a whole.

use super::compound::Compound;
use super::covariance::Covariance;
use super::distances::Distances;
use super::fit_data::FitData;
use super::part::Part;
use super::patch_frame::PatchFrame;
use super::split::splits;
use super::superquadric::Superquadric;
use crate::geometry::{Icosphere, Point};

/// Below this distance the criterion sees no difference, in metres: sensors are no better.
const RESOLUTION_M: f64 = 0.0007;
/// A part is unsupported where it is more than this share of the data's diagonal away from all data,
const UNSUPPORTED: f64 = 0.13;
/// and also more than this share of that distance outside the template of one part.
const BEYOND_SINGLE: f64 = 0.5;

/// How thoroughly a union is fitted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// How often all parts are fitted, one after the other.
    pub(super) sweeps: usize,
    /// Steps of each fit.
    pub(super) steps: usize,
}

/// Parts that are fitted together; the first may hold limbs.
#[derive(Clone, Debug)]
pub(super) struct Union {
    pub(super) parts: Vec<Part>,
    /// The cost of the data, without priors.
    pub(super) cost: f64,
}

impl Union {
    pub(super) fn new(parts: Vec<Part>, data: &FitData) -> Self {
        let cost = Distances::to(parts.iter(), data).cost(data);
        Self { parts, cost }
    }

    /// Fits each part in turn while the others stand still, but for limbs, which their host takes
    /// along.
    pub(super) fn refined(mut self, data: &FitData, Effort { sweeps, steps }: Effort) -> Self {
        for _ in 0..sweeps {
            for k in 0..self.parts.len() {
                let part = self.parts[k].clone();
                let (limbs, others): (Vec<_>, Vec<_>) =
                    self.others(k).cloned().partition(|other| k == 0 && other.along.is_some());
                let others = Distances::to(others.iter(), data);
                let fitted = if part.along.is_some() {
                    part.fit_limb(&self.parts[0], data, &others, steps)
                } else {
                    part.fit(&limbs, data, &others, steps)
                };
                self.parts[k] = fitted.parameters;
                let host = self.parts[0].clone();
                self.parts = self.parts.into_iter().map(|part| part.held_by(&host)).collect();
            }
        }
        Self::new(self.parts, data)
    }

    fn others(&self, k: usize) -> impl Iterator<Item = &Part> {
        self.parts.iter().enumerate().filter(move |(other, _)| *other != k).map(|(_, part)| part)
    }

    /// The Bayesian information criterion: lower is better.
    pub(super) fn criterion(&self, data: &FitData) -> f64 {
        let count = data.weight();
        let parameters: f64 = self.parts.iter().map(Part::parameters).sum();
        count * self.variance(data).ln() + parameters * count.ln()
    }

    /// Of a residual, in squared lengths of the patch.
    fn variance(&self, data: &FitData) -> f64 {
        2.0 * self.cost / data.weight() + (RESOLUTION_M / data.frame.length_m).powi(2)
    }

    /// Covariance of each part's parameters, as if the others were known.
    pub(super) fn covariances(&self, data: &FitData) -> Vec<Covariance> {
        let variance = self.variance(data);
        let of =
            |(k, part): (usize, &Part)| part.covariance(data, &Distances::to(self.others(k), data), variance);
        self.parts.iter().enumerate().map(of).collect()
    }

    /// Whether no part but the first sticks out where neither evidence nor the template of one part
    /// is: the end of a part that lies hidden in another fits whatever its other end does.
    pub(super) fn is_supported(&self, single: &Part, data: &FitData) -> bool {
        let far = UNSUPPORTED * data.diagonal();
        // In a frame of unit length a shape's metres are the data's lengths.
        let unit = PatchFrame { origin: Point::origin(), length_m: 1.0, ..data.frame };
        let single = single.shape(&unit);
        let shapes: Vec<Superquadric> = self.parts.iter().map(|part| part.shape(&unit)).collect();
        let sticks_out = |k: usize, point: &Point| {
            let outside =
                |(other, shape): (usize, &Superquadric)| other == k || shape.distance_m(point) > 0.0;
            shapes.iter().enumerate().all(outside)
                && data.nearest(&point.coords) > far
                && single.distance_m(point) > BEYOND_SINGLE * far
        };
        let directions = &Icosphere::get(2).directions;
        !shapes.iter().enumerate().skip(1).any(|(k, shape)| {
            directions
                .iter()
                .any(|direction| sticks_out(k, &(shape.centre + shape.offset_towards(direction))))
        })
    }

    pub(super) fn shape(&self, frame: &PatchFrame) -> Compound {
        let mut others: Vec<Superquadric> = self.parts.iter().map(|part| part.shape(frame)).collect();
        Compound { body: others.remove(0), others }
    }

    /// Unions with another part, which may be a limb where `limbs` says so.
    pub(super) fn splits(&self, data: &FitData, limbs: bool) -> Vec<Self> {
        let mut found = Vec::new();
        for (k, part) in self.parts.iter().enumerate() {
            for (rest, end) in splits(part, limbs && k == 0, data) {
                let mut parts = self.parts.clone();
                parts[k] = rest;
                parts.push(end);
                found.push(Self::new(parts, data));
            }
        }
        found
    }
}
