//! Splits: ways to split a part in two.
//!
//! An end of a part becomes a part of its own, along any of its axes. It is either free, or a limb
//! that stays on the axis.

use super::fit_data::FitData;
use super::part::{Along, Part, cycle};
use super::patch_frame::clamp_log_size;
use super::superquadric::LIMB;
use crate::geometry::Vector;

/// A free end begins beyond this share of the semi-axis.
const SPLIT_AT: f64 = 0.4;
/// Limbs are tried from each of these shares on.
const LIMBS_FROM: [f64; 3] = [0.0, 0.4, 0.7];
/// Fewer points do not determine an end.
const LEAST_POINTS: usize = 4;
/// The least half width of an end, in lengths of the patch.
const LEAST_HALF: f64 = 0.05;

/// All splits of a part into what is left of it and an end; limbs only where it may `host` them.
pub(super) fn splits(part: &Part, host: bool, data: &FitData) -> Vec<(Part, Part)> {
    let mut found = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            if host {
                found.extend(LIMBS_FROM.iter().filter_map(|from| split_limb(part, axis, side, *from, data)));
            }
            found.extend(split_end(part, axis, side, data));
        }
    }
    found
}

/// Points of the surface along a part's axes, seen from its centre, in lengths of the patch.
fn local<'a>(part: &'a Part, data: &'a FitData) -> impl Iterator<Item = Vector> + 'a {
    data.surface.iter().map(|(point, _)| part.rotation.inverse_transform_vector(&(point - part.centre)))
}

/// A part without what lies beyond a share of its semi-axis on one side.
fn shortened(part: &Part, axis: usize, side: f64, from: f64) -> Part {
    let length = part.log_axes[axis].exp();
    let mut rest = part.clone();
    let mut shift = Vector::zeros();
    shift[axis] = -0.5 * side * (1.0 - from) * length;
    rest.centre += part.rotation * shift;
    rest.log_axes[axis] = clamp_log_size((0.5 * (1.0 + from) * length).ln());
    rest
}

/// A part without its end on one side of an axis, and that end as a limb as wide as its points.
fn split_limb(part: &Part, axis: usize, side: f64, from: f64, data: &FitData) -> Option<(Part, Part)> {
    let begin = from * part.log_axes[axis].exp();
    let beyond: Vec<Vector> = local(part, data).filter(|y| side * y[axis] > begin).collect();
    if beyond.len() < LEAST_POINTS {
        return None;
    }
    let farthest = beyond.iter().fold(Vector::repeat(LEAST_HALF), |far, y| far.sup(&y.abs()));
    let rest = shortened(part, axis, side, from);
    let [first, second, _] = cycle(axis);
    // Its inner end is in the middle of its host, which has moved away from the tip.
    let tip = part.rotation.matrix().column(axis).dot(&(part.centre - rest.centre)) * side + farthest[axis];
    let half = Vector::new(farthest[first], farthest[second], 0.5 * tip);
    let end = Part {
        log_axes: half.map(|a| clamp_log_size(a.ln())),
        exponents: LIMB,
        along: Some(Along { axis, side }),
        ..part.clone()
    };
    Some((rest.clone(), end.held_by(&rest)))
}

/// A part without its end on one side of an axis, and that end as a part that reaches into it.
fn split_end(part: &Part, axis: usize, side: f64, data: &FitData) -> Option<(Part, Part)> {
    let axes = part.log_axes.map(f64::exp);
    let beyond: Vec<Vector> =
        local(part, data).map(|y| y.component_div(&axes)).filter(|y| side * y[axis] > SPLIT_AT).collect();
    if beyond.len() < LEAST_POINTS {
        return None;
    }
    let mut low = beyond.iter().fold(Vector::repeat(f64::INFINITY), |low, y| low.inf(y));
    let mut high = beyond.iter().fold(Vector::repeat(f64::NEG_INFINITY), |high, y| high.sup(y));
    if side > 0.0 {
        low[axis] = 0.0;
    } else {
        high[axis] = 0.0;
    }
    let half = ((high - low) * 0.5).map(|s| s.max(LEAST_HALF)).component_mul(&axes);
    let middle = ((high + low) * 0.5).component_mul(&axes);
    let end = Part {
        centre: part.centre + part.rotation * middle,
        log_axes: half.map(|a| clamp_log_size(a.ln())),
        along: None,
        ..part.clone()
    };
    Some((shortened(part, axis, side, SPLIT_AT), end))
}
