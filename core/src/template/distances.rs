//! How far the data are from a template: the nearest of its parts counts.

use super::field::Field;
use super::fit_data::FitData;
use super::least_squares::huber;
use super::part::Part;
use crate::geometry::Vector;

/// Attractors further than this from the template count linearly, in lengths of the patch.
pub(super) const HUBER: f64 = 0.1;

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
        let weights = data.surface.iter().map(|(_, weight)| weight * weight);
        let surface: f64 = weights.zip(&self.surface).map(|(weight, r)| weight * huber(*r, HUBER)).sum();
        let free: f64 = self.free.iter().map(|r| 0.5 * r.min(0.0).powi(2)).sum();
        let occupied: f64 = self.occupied.iter().map(|r| 0.5 * r.max(0.0).powi(2)).sum();
        surface + free + occupied
    }
}
