//! Which template: the selection "in real time" that the paper leaves to the future.
//!
//! Every fit goes on from the one before; now and then it also starts afresh from an ellipsoid, a
//! cylinder about each axis and a box, and tries whether one part more explains the evidence
//! better. Parts are counted by the Bayesian information criterion, with some hysteresis, so that
//! the template does not change with every touch.

use super::compound::Compound;
use super::ellipsoid::{self, Ellipsoid};
use super::part::{Distances, FitData, Part};
use super::superquadric::Superquadric;
use super::{PatchFrame, TemplateFit, clamp_log_size, root_mean_square};
use crate::attractor::{Attractor, Sense};
use crate::free_space::FreeSpace;
use crate::geometry::{Point, Vector};

/// All visual points together weigh as much as this many touches: they show one side only.
const VISUAL_WEIGHT: f64 = 10.0;
const MOST_PARTS: usize = 3;
const FIRST_STEPS: usize = 60;
const STEPS: usize = 15;
/// New starts are tried in the first fits, and then in every so many.
const FIRST_FITS: usize = 3;
const FRESH_EVERY: usize = 4;
const SPLIT_EVERY: usize = 5;
/// A fresh start has to lower the cost of the best so far to this share of it.
const CLEARLY_LOWER: f64 = 0.98;
/// Another number of parts has to be this much better, in units of the criterion.
const CLEARLY_BETTER: f64 = 2.0;
/// Parameters of a part.
const PARAMETERS: f64 = 11.0;
/// Below this distance the criterion sees no difference, in metres: sensors are no better.
const RESOLUTION_M: f64 = 0.0007;
/// The end of a part beyond this share of its semi-axis may become a part of its own.
const SPLIT_AT: f64 = 0.4;

/// A fit of the compound template, with what the next one goes on from.
#[derive(Clone, Debug)]
pub struct SelectedFit {
    /// The chosen template and how its fit went.
    pub chosen: TemplateFit<Compound>,
    /// The best template of one part.
    single: Superquadric,
    /// The best ellipsoid, from which fresh starts are made.
    ellipsoid: Superquadric,
    /// How many fits there were, this one included.
    fits: usize,
}

/// Selects and fits the template. `attractors` may be thinned; each counts.
pub fn fit(
    attractors: &[Attractor],
    free_space: &FreeSpace,
    viewpoint: Option<&Point>,
    before: Option<&SelectedFit>,
) -> SelectedFit {
    let frame = PatchFrame::of(attractors, viewpoint);
    let data = fit_data(attractors, free_space, frame);
    let alone = Distances::to(&[], &data);
    let fits = before.map_or(1, |before| before.fits + 1);

    let (start, steps) = match before {
        Some(before) => (before.ellipsoid, STEPS),
        None => (sphere(&ellipsoid::initial(attractors, viewpoint)), FIRST_STEPS),
    };
    let ellipsoid = Part::of(&start, &frame).fit_ellipsoid(&data, &alone, steps).parameters;

    let warm = before.map_or_else(|| ellipsoid.clone(), |before| Part::of(&before.single, &frame));
    let mut best = warm.fit(&data, &alone, STEPS);
    for start in fresh_starts(&ellipsoid, fits) {
        let found = start.fit(&data, &alone, STEPS);
        if found.cost < CLEARLY_LOWER * best.cost {
            best = found;
        }
    }
    let single = Union::new(vec![best.parameters.clone()], &data);
    let chosen = select_parts(&single, before, fits, &data);

    let diverged = chosen.parts.iter().any(Part::is_unbounded);
    let shape = chosen.shape(&frame);
    SelectedFit {
        chosen: TemplateFit {
            iterations: best.iterations,
            converged: best.converged,
            cost: chosen.cost,
            rms_m: root_mean_square(attractors.iter().map(|a| shape.distance_m(&a.point))),
            diverged,
            shape,
        },
        single: best.parameters.shape(&frame),
        ellipsoid: ellipsoid.shape(&frame),
        fits,
    }
}

fn fit_data(attractors: &[Attractor], free_space: &FreeSpace, frame: PatchFrame) -> FitData {
    let visual_weight = (VISUAL_WEIGHT / frame.visual_points).sqrt().min(1.0);
    let weigh = |a: &Attractor| {
        let weight = if a.sense == Sense::Vision { visual_weight } else { 1.0 };
        (frame.local(&a.point), weight)
    };
    let local = |points: &[Point]| points.iter().map(|point| frame.local(point)).collect();
    FitData {
        surface: attractors.iter().map(weigh).collect(),
        free: local(free_space.outside()),
        occupied: local(free_space.inside()),
        frame,
    }
}

fn sphere(start: &Ellipsoid) -> Superquadric {
    Superquadric {
        centre: start.centre,
        semi_axes: start.semi_axes,
        base_from_template: start.base_from_template,
        exponents: [1.0, 1.0],
    }
}

/// The ellipsoid itself, and in some fits a cylinder about each of its axes and a box.
fn fresh_starts(ellipsoid: &Part, fits: usize) -> Vec<Part> {
    let mut starts = vec![ellipsoid.clone()];
    if fits <= FIRST_FITS || fits.is_multiple_of(FRESH_EVERY) {
        starts.extend((0..3).map(|axis| ellipsoid.squared(axis, [0.2, 1.0])));
        starts.push(ellipsoid.squared(2, [0.2, 0.2]));
    }
    starts
}

/// The number of parts: one, those of the fit before, or one more where that is clearly better.
fn select_parts(single: &Union, before: Option<&SelectedFit>, fits: usize, data: &FitData) -> Union {
    let mut chosen = single.clone();
    let mut criterion = chosen.criterion(data);
    if let Some(before) = before.filter(|before| !before.chosen.shape.limbs.is_empty()) {
        let parts = before.chosen.shape.parts().map(|part| Part::of(part, &data.frame)).collect();
        let kept = Union::new(parts, data).refined(data, 2);
        if kept.criterion(data) - CLEARLY_BETTER < criterion {
            criterion = kept.criterion(data);
            chosen = kept;
        }
    }
    let mut larger = Vec::new();
    if fits.is_multiple_of(SPLIT_EVERY) {
        larger.extend(single.split(data));
        if chosen.parts.len() > 1 {
            larger.extend(chosen.split(data));
        }
    }
    for candidate in larger.into_iter().filter(|union| union.parts.len() <= MOST_PARTS) {
        let candidate = candidate.refined(data, 3);
        if candidate.criterion(data) < criterion - CLEARLY_BETTER {
            criterion = candidate.criterion(data);
            chosen = candidate;
        }
    }
    chosen
}

/// Parts that are fitted together.
#[derive(Clone, Debug)]
struct Union {
    parts: Vec<Part>,
    /// The cost of the data, without priors.
    cost: f64,
}

impl Union {
    fn new(parts: Vec<Part>, data: &FitData) -> Self {
        let cost = Distances::to(&parts.iter().collect::<Vec<_>>(), data).cost(data);
        Self { parts, cost }
    }

    /// Fits each part in turn while the others stand still.
    fn refined(mut self, data: &FitData, sweeps: usize) -> Self {
        const STEPS_A_TURN: usize = 5;
        for _ in 0..sweeps {
            for k in 0..self.parts.len() {
                let others: Vec<&Part> = self
                    .parts
                    .iter()
                    .enumerate()
                    .filter(|(other, _)| *other != k)
                    .map(|(_, part)| part)
                    .collect();
                let others = Distances::to(&others, data);
                self.parts[k] = self.parts[k].clone().fit(data, &others, STEPS_A_TURN).parameters;
            }
        }
        Self::new(self.parts, data)
    }

    /// The Bayesian information criterion: lower is better.
    fn criterion(&self, data: &FitData) -> f64 {
        let count: f64 = data.surface.iter().map(|(_, weight)| weight * weight).sum();
        let resolution = (RESOLUTION_M / data.frame.length_m).powi(2);
        let parameters = PARAMETERS * self.parts.len() as f64;
        count * (2.0 * self.cost / count + resolution).ln() + parameters * count.ln()
    }

    fn shape(&self, frame: &PatchFrame) -> Compound {
        let mut limbs: Vec<Superquadric> = self.parts.iter().map(|part| part.shape(frame)).collect();
        Compound { body: limbs.remove(0), limbs }
    }

    fn with(&self, part: Part, data: &FitData) -> Self {
        Self::new(self.parts.iter().cloned().chain([part]).collect(), data)
    }

    /// Unions with one part more: an end of a part, along one of its axes, becomes its own.
    fn split(&self, data: &FitData) -> Vec<Self> {
        let mut found = Vec::new();
        for (k, part) in self.parts.iter().enumerate() {
            for axis in 0..3 {
                for side in [-1.0, 1.0] {
                    if let Some((rest, end)) = split_end(part, axis, side, data) {
                        let mut union = self.clone();
                        union.parts[k] = rest;
                        found.push(union.with(end, data));
                    }
                }
            }
        }
        found
    }
}

/// A part without its end on one side of an axis, and that end as a part that reaches into it.
fn split_end(part: &Part, axis: usize, side: f64, data: &FitData) -> Option<(Part, Part)> {
    let axes = part.log_axes.map(f64::exp);
    let unit =
        |point: &Vector| part.rotation.inverse_transform_vector(&(point - part.centre)).component_div(&axes);
    let beyond: Vec<Vector> =
        data.surface.iter().map(|(point, _)| unit(point)).filter(|y| side * y[axis] > SPLIT_AT).collect();
    if beyond.len() < 4 {
        return None;
    }
    let mut low = beyond.iter().fold(Vector::repeat(f64::INFINITY), |low, y| low.inf(y));
    let mut high = beyond.iter().fold(Vector::repeat(f64::NEG_INFINITY), |high, y| high.sup(y));
    if side > 0.0 {
        low[axis] = 0.0;
    } else {
        high[axis] = 0.0;
    }
    let half = ((high - low) * 0.5).map(|s| s.max(0.05)).component_mul(&axes);
    let middle = ((high + low) * 0.5).component_mul(&axes);
    let end = Part {
        centre: part.centre + part.rotation * middle,
        log_axes: half.map(|a| clamp_log_size(a.ln())),
        ..part.clone()
    };
    let mut rest = part.clone();
    let mut shift = Vector::zeros();
    shift[axis] = -0.5 * side * (1.0 - SPLIT_AT) * axes[axis];
    rest.centre += part.rotation * shift;
    rest.log_axes[axis] = clamp_log_size((0.5 * (1.0 + SPLIT_AT) * axes[axis]).ln());
    Some((rest, end))
}
