//! Whether the object has moved: what was touched lately is laid onto what was known before.
//!
//! ```text
//! several surprises among the latest attempts
//!      --> the surface as it was before them
//!      --> the motion that lays the touches since onto it, and frees what was swept   (point to plane, robust)
//!      --> another reading, kept where the measurements are clearly the more likely under it
//! ```

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use crate::evidence::attractor::Sense;
use crate::evidence::free_space::FreeSpace;
use crate::evidence::ledger::{Ledger, Motion};
use crate::evidence::{DOUBTED, Reading, RigidOffset};
use crate::geometry::{Cloud, Direction, Point, Pose, Vector};

/// The latest attempts that are looked at, and how many surprises among them ask for a closer look.
const LATEST: usize = 16;
/// A motion is found anew while there is less evidence after it.
const SETTLED_AFTER: usize = 24;
const SURPRISES: usize = 3;
/// Fewer pieces of evidence show too little to move.
const LEAST_KNOWN: usize = 11;
/// An object is pushed by about this along what it stands on, in metres, and up or down by the second: what is
/// known of an upright body from its sides alone fits at any height.
const PUSH_M: f64 = 0.015;
const LIFT_M: f64 = 0.003;
/// By less it does not matter, in metres.
const LEAST_M: f64 = 0.005;
/// Farther off nothing can be laid onto anything with certainty, in metres.
const FARTHEST_M: f64 = 0.045;
/// How well a motion is known when it is found, in metres.
const FOUND_M: f64 = 0.004;
/// Noise of a touch, and of what was swept, beside the surface's own deviation, in metres.
const TOUCH_M: f64 = 0.001;
const SWEPT_M: f64 = 0.003;
/// Residuals beyond this many deviations count less and less (Cauchy's loss).
const ROBUST: f64 = 2.0;
/// Vertices that are looked at: an icosphere begins with those of the coarser ones, and these lie evenly.
pub(super) const VERTICES: usize = 642;
/// Steps of each descent.
const STEPS: usize = 12;
/// A motion has to lay them better by this much than none, in nats.
const LEAST_GAIN: f64 = 3.0;

/// A surface as it was before a motion.
pub(super) struct Known<'a> {
    vertices: &'a [Point],
    normals: &'a [Direction],
    std_m: &'a [f64],
    /// The vertices that are looked at.
    cloud: Cloud,
}

impl<'a> Known<'a> {
    pub(super) fn new(vertices: &'a [Point], normals: &'a [Direction], std_m: &'a [f64]) -> Self {
        Self { vertices, normals, std_m, cloud: Cloud::new(&vertices[..vertices.len().min(VERTICES)]) }
    }
}

/// What was measured since.
struct Since {
    touches: Vec<Point>,
    free: Vec<Point>,
    /// The inverse of the covariance of the motion before it is known, per square metre.
    precision: Matrix3<f64>,
}

/// The inverse of the covariance of a motion before it is known, per square metre.
fn precision(ledger: &Ledger) -> Matrix3<f64> {
    let along = PUSH_M.powi(-2);
    Matrix3::identity() * along + ledger.up * ledger.up.transpose() * (LIFT_M.powi(-2) - along)
}

/// The same motion along what the object stands on, where it also goes up or down.
pub(super) fn level(motion: &Motion, ledger: &Ledger) -> Option<Motion> {
    let shift = motion.new_from_old.translation.vector;
    let lift_m = shift.dot(&ledger.up);
    let level = shift - ledger.up * lift_m;
    let new_from_old = Pose::from_parts(level.into(), nalgebra::one());
    (lift_m.abs() > LEAST_M && level.norm() > LEAST_M).then_some(Motion { new_from_old, ..*motion })
}

/// How unlikely a motion is before anything speaks for it, in nats.
pub(super) fn cost(motion: &Motion, ledger: &Ledger) -> f64 {
    let shift = motion.new_from_old.translation.vector;
    0.5 * shift.dot(&(precision(ledger) * shift))
}

/// The reading without a motion that was found so lately that it may be found better, or not at all.
pub(super) fn without_latest(reading: &Reading, ledger: &Ledger) -> Option<Reading> {
    let latest = reading.motions.last().filter(|motion| motion.is_found)?;
    let without = || {
        let mut reading = reading.clone();
        reading.motions.pop();
        Reading {
            motion_offset: RigidOffset::default(),
            doubts: Vec::new(),
            seen_doubts: BTreeMap::new(),
            ..reading
        }
    };
    (ledger.entries < latest.since + SETTLED_AFTER).then(without)
}

/// Evidence from which the object may have moved, the earliest first: of the latest attempts those from the
/// first surprise on and the one before it, or all of them in a fit that looks at everything. Nothing without
/// signs of a motion.
pub(super) fn suspected_since(reading: &Reading, ledger: &Ledger, looks_at_all: bool) -> Vec<usize> {
    let touches = ledger.touches.iter().enumerate();
    let touches = touches.map(|(number, touch)| (touch.at, reading.doubt(number) > DOUBTED));
    let misses = ledger.misses.iter().map(|(at, _)| (*at, true));
    let mut attempts: Vec<(usize, bool)> = touches.chain(misses).collect();
    attempts.sort_unstable();
    attempts.dedup_by_key(|(at, _)| *at);
    let known_from = reading.motions.last().map_or(LEAST_KNOWN, |motion| motion.since + LEAST_KNOWN);
    let latest: Vec<(usize, bool)> = attempts.into_iter().rev().take(LATEST).rev().collect();
    let first = latest.iter().position(|(_, surprise)| *surprise);
    let surprises = latest.iter().filter(|(_, surprise)| *surprise).count();
    let is_latest = latest.last().is_some_and(|(_, surprise)| *surprise);
    let from = match first {
        _ if looks_at_all => 0,
        Some(first) if is_latest && surprises >= SURPRISES => first.saturating_sub(1),
        _ => return Vec::new(),
    };
    // Two attempts at least are needed to lay anything onto anything.
    let last = latest.len().saturating_sub(1);
    latest
        .get(from..last)
        .unwrap_or_default()
        .iter()
        .map(|(at, _)| *at)
        .filter(|at| *at > known_from)
        .collect()
}

/// The motion that lays what was measured since best onto what was known before; nothing where the best is not
/// clearly better than none. `since` has the evidence that may be the first after it.
pub(super) fn found(
    reading: &Reading,
    ledger: &Ledger,
    known: &Known<'_>,
    since: &[usize],
) -> Option<Motion> {
    let mut best: Option<(Motion, f64)> = None;
    for &since in since {
        let measured = Since::of(reading, ledger, since);
        if measured.touches.len() < 2 {
            continue;
        }
        let directions = [
            Vector::zeros(),
            Vector::x(),
            Vector::y(),
            Vector::z(),
            -Vector::x(),
            -Vector::y(),
            -Vector::z(),
        ];
        let last = best.map(|(motion, _)| motion.new_from_old.translation.vector);
        let starts = directions.map(|direction| direction * PUSH_M).into_iter().chain(last);
        let descents =
            starts.map(|start| measured.descend(known, start)).filter(|(shift, _)| shift.norm() < FARTHEST_M);
        let unmoved = Vector::zeros();
        let none = measured.cost(&measured.residuals(known, &unmoved), &unmoved);
        let Some((shift, cost)) = descents.min_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        let gain = none - cost;
        if (LEAST_M..FARTHEST_M).contains(&shift.norm()) && gain > best.map_or(LEAST_GAIN, |(_, gain)| gain) {
            let new_from_old = Pose::from_parts(shift.into(), nalgebra::one());
            best = Some((Motion { since, new_from_old, std_m: FOUND_M, is_found: true }, gain));
        }
    }
    best.map(|(motion, _)| motion)
}

impl Since {
    fn of(reading: &Reading, ledger: &Ledger, since: usize) -> Self {
        let after = ledger.since(since);
        let believing = Reading { doubts: Vec::new(), seen_doubts: BTreeMap::new(), ..reading.clone() };
        let attractors = believing.attractors(&after, 0.0);
        let touches = attractors.iter().filter(|a| a.sense == Sense::Touch).map(|a| a.point).collect();
        let mut space = FreeSpace::within(reading.surroundings(ledger));
        after.misses.iter().for_each(|(_, sweep)| space.add_miss(sweep));
        Self { touches, free: space.thinned().outside().to_vec(), precision: precision(ledger) }
    }

    /// Each measurement's residual in deviations with its slope, where the object has moved by `shift`.
    fn residuals(&self, known: &Known<'_>, shift: &Vector) -> Vec<(f64, Vector)> {
        let at = move |point: &Point, noise_m: f64| {
            let before = point - shift;
            let nearest = known.cloud.nearest(&before).unwrap_or(0) as usize;
            let normal = known.normals[nearest].into_inner();
            let std_m = known.std_m[nearest].hypot(noise_m);
            ((before - known.vertices[nearest]).dot(&normal) / std_m, -normal / std_m)
        };
        let touches = self.touches.iter().map(move |point| at(point, TOUCH_M));
        // What was swept lies outside.
        let free =
            self.free.iter().map(move |point| at(point, SWEPT_M)).filter(|(residual, _)| *residual < 0.0);
        touches.chain(free).collect()
    }

    /// The cost of a shift with these residuals.
    fn cost(&self, residuals: &[(f64, Vector)], shift: &Vector) -> f64 {
        let loss = |residual: f64| 0.5 * ROBUST.powi(2) * (residual / ROBUST).powi(2).ln_1p();
        let data: f64 = residuals.iter().map(|(residual, _)| loss(*residual)).sum();
        data + 0.5 * shift.dot(&(self.precision * shift))
    }

    /// Gauss-Newton with Cauchy's weights from a start.
    fn descend(&self, known: &Known<'_>, start: Vector) -> (Vector, f64) {
        let mut residuals = self.residuals(known, &start);
        let mut best = (start, self.cost(&residuals, &start));
        for _ in 0..STEPS {
            let mut hessian = self.precision;
            let mut gradient: Vector3<f64> = self.precision * best.0;
            for (residual, slope) in &residuals {
                let weight = 1.0 / (1.0 + (residual / ROBUST).powi(2));
                hessian += slope * slope.transpose() * weight;
                gradient += slope * (weight * residual);
            }
            let Some(step) = hessian.cholesky().map(|factor| factor.solve(&gradient)) else { break };
            let trial = best.0 - step;
            let of_trial = self.residuals(known, &trial);
            let cost = self.cost(&of_trial, &trial);
            if cost >= best.1 - 1e-6 {
                break;
            }
            (best, residuals) = ((trial, cost), of_trial);
        }
        best
    }
}
