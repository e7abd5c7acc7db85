//! Fitting one part, with the limbs that it holds, while the others of its template stand still.
//!
//! Residuals are metric, so the far side of an object weighs like its near side. Their loss is
//! Huber's, so that a handle or a label does not bend the body. What the probe has swept freely
//! must not lie inside, whatever was touched: that keeps a template from growing past what is
//! known, and is the "repulsor" of the paper's future work.

use super::distances::Distances;
use super::field::{Field, Linearised};
use super::fit_data::FitData;
use super::least_squares::{Minimum, NormalEquations, Slopes, minimise};
use super::part::{Freedom, Part, Row};
use super::samples::{Block, LANES, Lanes, Side};
use crate::geometry::Vector;

/// Strength of the prior on size; on position it is half of it.
const SIZE_PRIOR: f64 = 0.3;
/// Strength of the prior that draws the exponents to those of an ellipsoid.
const EXPONENT_PRIOR: f64 = 0.1;

impl Part {
    /// Fits this part, with the limbs that it holds, while the others of its template stand still
    /// at the given distances.
    pub(super) fn fit(
        self,
        limbs: &[Self],
        data: &FitData,
        others: &Distances,
        steps: usize,
    ) -> Minimum<Self> {
        minimise(self, steps, |part| part.linearise(limbs, data, others), Self::retract)
    }

    /// Fits it as an ellipsoid: with exponents that stand still.
    pub(super) fn fit_ellipsoid(self, data: &FitData, others: &Distances, steps: usize) -> Minimum<Self> {
        let mut freedom = Freedom::identity();
        freedom[(9, 9)] = 0.0;
        freedom[(10, 10)] = 0.0;
        let linearise = |part: &Self| part.linearise(&[], data, others).within(&freedom);
        minimise(self, steps, linearise, Self::retract)
    }

    /// Fits a limb while its host and the others stand still.
    pub(super) fn fit_limb(
        self,
        host: &Self,
        data: &FitData,
        others: &Distances,
        steps: usize,
    ) -> Minimum<Self> {
        let linearise = |limb: &Self| limb.linearise(&[], data, others).within(&limb.freedom());
        let retract = |limb: &Self, step: &Row| limb.retract(&(limb.freedom() * step)).held_by(host);
        minimise(self, steps, linearise, retract)
    }

    /// The normal equations of all data and of the priors.
    fn linearise(&self, limbs: &[Self], data: &FitData, others: &Distances) -> NormalEquations<11> {
        let limbs: Vec<Self> = limbs.iter().map(|limb| limb.clone().held_by(self)).collect();
        let (own, limb_fields) = (self.field(), limbs.iter().map(Self::field).collect::<Vec<_>>());
        let (mut equations, mut slopes) = (NormalEquations::zero(), Slopes::zero());
        let mut add = |block: &Block, others: &Lanes| {
            let mut nearest = own.linearised(&block.points);
            limb_fields
                .iter()
                .for_each(|limb| nearest.or_limb(&limb.linearised(&block.points), limb.part, self));
            equations.cost += slopes.add_nearest(block, &nearest, others);
        };
        let (free, bound): (Vec<_>, Vec<_>) =
            data.blocks.iter().zip(&others.blocks).partition(|(block, _)| block.side == Side::Outside);
        bound.into_iter().for_each(|(block, others)| add(block, others));
        // What is outside costs nothing and pulls nowhere, as most of what is free does: of it only the points in the
        // boxes around the parts are looked at, and their derivatives only where one of them is inside.
        for (block, others) in
            Block::packed(&free, |block, others| Self::near(&own, &limb_fields, block, others))
        {
            let is_inside = |field: &Field<'_>| field.distances(&block.points).iter().any(|d| *d < 0.0);
            if others.iter().any(|d| *d < 0.0) || is_inside(&own) || limb_fields.iter().any(is_inside) {
                add(&block, &others);
            }
        }
        equations.add_slopes(&slopes);
        self.add_priors(&mut equations, &data.frame.centre);
        if data.bounded {
            self.add_overreach(&mut equations, data);
        }
        equations
    }

    /// Which free points of a block are in the box around this part or one of its limbs, or inside the others.
    fn near(own: &Field<'_>, limbs: &[Field<'_>], block: &Block, others: &Lanes) -> [bool; LANES] {
        let mut near = others.map(|distance| distance < 0.0);
        for field in std::iter::once(own).chain(limbs) {
            let beyond = field.beyond(&block.points);
            (0..LANES).for_each(|lane| near[lane] |= !beyond[lane]);
        }
        near
    }

    fn add_priors(&self, equations: &mut NormalEquations<11>, expected_centre: &Vector) {
        let mut prior = |parameter: usize, weight: f64, value: f64| {
            let mut row = Row::zeros();
            row[parameter] = weight;
            equations.add(weight * value, &row);
        };
        for axis in 0..3 {
            prior(axis, 0.5 * SIZE_PRIOR, self.centre[axis] - expected_centre[axis]);
            prior(3 + axis, SIZE_PRIOR, self.log_axes[axis]);
        }
        for k in 0..2 {
            prior(9 + k, EXPONENT_PRIOR, self.exponents[k] - 1.0);
        }
    }
}

impl Linearised {
    /// The same with a limb in the place of its host where it is the nearer.
    fn or_limb(&mut self, of_limb: &Self, limb: &Part, host: &Part) {
        let is_nearer: [bool; LANES] =
            std::array::from_fn(|lane| of_limb.residual[lane] < self.residual[lane]);
        for lane in (0..LANES).filter(|lane| is_nearer[*lane]) {
            self.residual[lane] = of_limb.residual[lane];
            let row = limb.row_of_host(host, &Row::from_fn(|k, _| of_limb.rows[k][lane]));
            (0..11).for_each(|k| self.rows[k][lane] = row[k]);
        }
    }
}

impl Slopes<11> {
    /// Adds a block of data, and returns what it costs. A union is as near as its nearest part; where that is one of
    /// the others, this one changes nothing.
    pub(super) fn add_nearest(&mut self, block: &Block, own: &Linearised, others: &Lanes) -> f64 {
        let residuals = std::array::from_fn(|lane| own.residual[lane].min(others[lane]));
        let (cost, mut slopes) = block.cost(&residuals);
        for lane in (0..LANES).filter(|lane| own.residual[*lane] > others[*lane]) {
            slopes[lane] = 0.0;
        }
        if slopes.iter().any(|slope| *slope != 0.0) {
            self.add(&residuals, &own.rows, &slopes);
        }
        cost
    }
}
