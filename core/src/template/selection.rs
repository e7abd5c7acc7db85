//! Which template: the selection "in real time" that the paper leaves to the future.
//!
//! Every fit goes on from the one before; some ([`Extras`]) also start afresh from an ellipsoid, a
//! cylinder about each axis, a box, a slab and shapes that just hold what was measured, or try
//! whether another part explains the evidence better. Parts are counted by the Bayesian information
//! criterion, with some hysteresis, so that the template does not change with every touch.

use serde::{Deserialize, Serialize};

use super::compound::Compound;
use super::covariance::Covariance;
use super::distances::Distances;
use super::ellipsoid::{self, Ellipsoid};
use super::extent;
use super::field::{Field, Linearised};
use super::fit_data::FitData;
use super::part::{Part, Row};
use super::patch_frame::PatchFrame;
use super::samples::{LANES, Lanes};
use super::starts;
use super::superquadric::Superquadric;
use super::union::{Effort, Union};
use crate::config::Stages;
use crate::evidence::FitEvidence;
use crate::fingerprint::Fingerprint;
use crate::geometry::Point;
use crate::schedule::Extras;

/// More parts cannot be told apart by 50 touches.
const MOST_PARTS: usize = 3;
/// Steps of the very first fit, which starts from a sphere, and of every later one.
const FIRST_STEPS: usize = 60;
const STEPS: usize = 15;
/// A new start has to lower the cost of the best so far to this share of it.
const CLEARLY_LOWER: f64 = 0.98;
/// Another number of parts has to be this much better, in units of the criterion.
const CLEARLY_BETTER: f64 = 2.0;
/// How thoroughly the parts of a template are fitted while it is kept or among the best of the new
/// ones, and when it is one of many new ones.
const FULL: Effort = Effort { sweeps: 2, steps: 5 };
const QUICK: Effort = Effort { sweeps: 1, steps: 3 };
/// This many new templates are fitted to the end.
const FINALISTS: usize = 4;

/// A fit of the compound template, with what the next one goes on from.
#[derive(Clone, Debug)]
pub struct SelectedFit {
    /// The chosen template.
    pub shape: Compound,
    /// Whether one of its semi-axes ran into the bound of its size.
    pub diverged: bool,
    /// How sure each of its parts is of its parameters.
    covariances: Vec<Covariance>,
    /// The parts that it is made of, and what the next fit goes on from.
    pub(crate) start: TemplateStart,
}

/// What a fit of the compound template leaves to the next.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct TemplateStart {
    /// The frame that the parts are fitted in.
    frame: PatchFrame,
    /// The parts of the chosen template.
    parts: Vec<Part>,
    /// The best template of one part.
    single: Part,
    /// The best ellipsoid, from which fresh starts are made.
    ellipsoid: Part,
}

impl SelectedFit {
    /// Adds itself to a fingerprint.
    pub(crate) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        // Shape and covariances follow from the parts and the evidence.
        let Self { shape: _, diverged: _, covariances: _, start } = self;
        let TemplateStart { frame, parts, single, ellipsoid } = start;
        frame.fingerprint(fingerprint);
        fingerprint.count(parts.len());
        parts.iter().chain([single, ellipsoid]).for_each(|part| part.fingerprint(fingerprint));
    }

    /// How many parameters it has.
    pub(crate) fn parameters(&self) -> f64 {
        self.start.parts.iter().map(Part::parameters).sum()
    }

    /// Standard deviations of the template along its normal near some points, each by the covariance
    /// of the nearest part's parameters, in metres.
    pub fn deviations_m(&self, points: &[Point]) -> Vec<f64> {
        let TemplateStart { frame, parts, .. } = &self.start;
        let fields: Vec<(Field<'_>, &Covariance)> =
            parts.iter().map(Part::field).zip(&self.covariances).collect();
        let deviations = |points: &[Point]| {
            let at = |axis: usize, lane: usize| frame.local(&points[lane.min(points.len() - 1)])[axis];
            let block: [Lanes; 3] = std::array::from_fn(|axis| std::array::from_fn(|lane| at(axis, lane)));
            let of_parts: Vec<Linearised> =
                fields.iter().map(|(field, _)| field.linearised(&block)).collect();
            let variance = |lane: usize| {
                let nearest = of_parts
                    .iter()
                    .zip(&fields)
                    .min_by(|(a, _), (b, _)| a.residual[lane].total_cmp(&b.residual[lane]));
                nearest.map_or(0.0, |(part, (_, covariance))| {
                    let row = Row::from_fn(|k, _| part.rows[k][lane]);
                    row.dot(&(*covariance * row))
                })
            };
            let deviation = |lane: usize| variance(lane).max(0.0).sqrt() * frame.length_m;
            (0..points.len()).map(deviation).collect::<Vec<f64>>()
        };
        points.chunks(LANES).flat_map(deviations).collect()
    }
}

/// Selects and fits the template, going on from the fit before.
pub(crate) fn select(
    evidence: &FitEvidence,
    before: Option<&TemplateStart>,
    extras: Extras,
    stages: &Stages,
) -> SelectedFit {
    let (attractors, viewpoint) = (&evidence.measured, evidence.viewpoint.as_ref());
    let frame = PatchFrame::of(attractors, viewpoint);
    let data = FitData { bounded: stages.extent, ..FitData::new(attractors, &evidence.free_space, frame) };
    let alone = Distances::to(std::iter::empty(), &data);

    let (start, steps) = match before {
        Some(before) => (before.ellipsoid.moved(&before.frame, &frame), STEPS),
        None => (Part::of(&sphere(&ellipsoid::initial(attractors, viewpoint)), &frame), FIRST_STEPS),
    };
    let mut best = start.fit_ellipsoid(&data, &alone, steps);
    let ellipsoid = best.parameters.clone();

    if stages.superquadrics {
        let warm =
            before.map_or_else(|| ellipsoid.clone(), |before| before.single.moved(&before.frame, &frame));
        best = warm.fit(&[], &data, &alone, STEPS);
        let mut starts = vec![ellipsoid.clone()];
        if extras.starts {
            starts.extend(starts::squared(&ellipsoid));
            if stages.extent && before.is_some() {
                starts.extend(extent::holding(&data));
            }
            if stages.slab {
                starts.push(starts::slab(&ellipsoid, attractors, &frame));
            }
        }
        for start in starts {
            let found = start.fit(&[], &data, &alone, STEPS);
            if found.cost < CLEARLY_LOWER * best.cost {
                best = found;
            }
        }
    }
    let mut chosen = Union::new(vec![best.parameters.clone()], &data);
    if stages.superquadrics && stages.parts {
        chosen = select_parts(&chosen, before, extras, &data, stages.limbs);
    }

    SelectedFit {
        shape: chosen.shape(&frame),
        diverged: chosen.parts.iter().any(Part::is_unbounded),
        covariances: chosen.covariances(&data),
        start: TemplateStart { frame, parts: chosen.parts, single: best.parameters, ellipsoid },
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

/// The number of parts: one, those of the fit before, or one more where that is clearly better.
fn select_parts(
    single: &Union,
    before: Option<&TemplateStart>,
    extras: Extras,
    data: &FitData,
    limbs: bool,
) -> Union {
    let mut chosen = single.clone();
    let mut criterion = chosen.criterion(data);
    if let Some(before) = before.filter(|before| before.parts.len() > 1) {
        let parts = before.parts.iter().map(|part| part.moved(&before.frame, &data.frame)).collect();
        let kept = Union::new(parts, data);
        let refined = kept.clone().refined(data, FULL);
        let kept = if refined.cost <= kept.cost { refined } else { kept };
        if kept.criterion(data) - CLEARLY_BETTER < criterion {
            criterion = kept.criterion(data);
            chosen = kept;
        }
    }
    let mut larger = Vec::new();
    if extras.splits {
        larger.extend(single.splits(data, limbs));
        if chosen.parts.len() > 1 {
            larger.extend(chosen.splits(data, limbs));
        }
    }
    let mut finalists: Vec<(f64, Union)> = larger
        .into_iter()
        .filter(|union| union.parts.len() <= MOST_PARTS)
        .map(|union| union.refined(data, QUICK))
        .map(|union| (union.criterion(data), union))
        .collect();
    finalists.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, candidate) in finalists.into_iter().take(FINALISTS) {
        let candidate = candidate.refined(data, FULL);
        if candidate.criterion(data) < criterion - CLEARLY_BETTER
            && candidate.is_supported(&single.parts[0], data)
        {
            criterion = candidate.criterion(data);
            chosen = candidate;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::attractor::{Attractor, Sense};
    use crate::evidence::free_space::FreeSpace;
    use crate::geometry::{Icosphere, Vector};

    #[test]
    fn the_template_is_unsure_of_an_end_that_nothing_has_touched() {
        // The sides of an ellipsoid that stands upright; what was seen of it is one of them.
        let touches = Icosphere::get(3).directions.iter().filter(|direction| direction.z.abs() < 0.6);
        let on_side = |direction: &Vector, sense| {
            let point = Point::from(direction.component_mul(&Vector::new(0.03, 0.03, 0.06)));
            Attractor::new(point, 0.1, sense)
        };
        let attractors: Vec<Attractor> = touches
            .map(|direction| on_side(direction, if direction.x > 0.8 { Sense::Vision } else { Sense::Touch }))
            .collect();
        let camera = Point::new(0.5, 0.0, 0.0);
        let evidence = FitEvidence {
            attractors: attractors.clone(),
            measured: attractors,
            detail: Vec::new(),
            free_space: FreeSpace::default(),
            viewpoint: Some(camera),
        };
        let fit = select(&evidence, None, Extras::of_fit(1), &Stages::default());
        let places = [Point::new(0.0, 0.03, 0.0), Point::new(0.0, 0.0, 0.06)];
        let [side_m, end_m] = fit.deviations_m(&places)[..] else { panic!("one for each place") };
        assert!(side_m > 0.0 && end_m > 5.0 * side_m, "{side_m} {end_m}");
    }
}
