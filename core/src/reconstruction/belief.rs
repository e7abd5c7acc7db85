//! What a fit of METHOD_PALPATE makes of its evidence: the reading that the next one goes on from.

use crate::evidence::attractor::{Attractor, Group, Provenance, Sense};
use crate::evidence::ledger::{Ledger, Touch};
use crate::evidence::{DOUBTED, Reading, RigidOffset, TouchedPoint};
use crate::exploration::DoubtedTouch;
use crate::geometry::Point;
use crate::local::Conditioned;

/// A reading as it is after a fit with it.
pub(super) fn learnt(reading: &Reading, conditioned: &Conditioned) -> Reading {
    let mut next = reading.clone();
    if reading.doubts_touches {
        next.seen_doubts.clear();
        for Attractor { sense, provenance, .. } in &conditioned.judged {
            let Provenance { source, index, doubt, .. } = *provenance;
            match sense {
                Sense::Touch => {
                    next.doubts.resize(next.doubts.len().max(source + 1), 0.0);
                    next.doubts[source] = doubt;
                }
                Sense::Vision if doubt > 0.0 => {
                    next.seen_doubts.insert((source, index), doubt);
                }
                Sense::Vision | Sense::Tangent | Sense::Support => {}
            }
        }
    }
    next.view_offsets.clear();
    for &(group, offset) in &conditioned.rigid {
        match group {
            Group::View(view) => {
                let known = next.view_offsets.len().max(view + 1);
                next.view_offsets.resize(known, RigidOffset::default());
                next.view_offsets[view] = offset;
            }
            Group::BeforeMotion => next.motion_offset = offset,
        }
    }
    next
}

/// Fewer touches tell no reading from another.
const TOUCHES_FOR_READINGS: usize = 6;
/// Torques tell of other points than the pads' centres where one is this far from its centre, in metres.
const OFF_CENTRE_M: f64 = 0.001;

/// Other readings that are worth a fit: with or without rigid offsets of the views, and with the other point
/// of the pads where they leave it open.
pub(super) fn alternatives(reading: &Reading, ledger: &Ledger) -> Vec<Reading> {
    if ledger.touches.len() < TOUCHES_FOR_READINGS {
        return Vec::new();
    }
    let mut others = Vec::new();
    if reading.may_find_offsets {
        let found = !reading.finds_offsets;
        others.push(Reading {
            finds_offsets: found,
            offsets_needed: usize::from(found),
            view_offsets: Vec::new(),
            ..reading.clone()
        });
    }
    let is_open = |touch: &Touch| {
        touch.contact.pad().touched() == TouchedPoint::Open
            && touch.contact.pressure().offset.norm() > OFF_CENTRE_M
    };
    if reading.may_take_pressure && ledger.touches.iter().any(is_open) {
        let touched = match reading.touched {
            TouchedPoint::CentreOfPressure => TouchedPoint::PadCentre,
            TouchedPoint::Open | TouchedPoint::PadCentre => TouchedPoint::CentreOfPressure,
        };
        others.push(Reading { touched, ..reading.clone() });
    }
    others
}

/// A path this near to a touch says whether there is something, in metres: one beside it may be beside a spout.
const NEAR_M: f64 = 0.003;

/// The touches that are taken for none.
pub(super) fn doubted(reading: &Reading, ledger: &Ledger) -> Vec<DoubtedTouch> {
    let numbered = ledger.touches.iter().enumerate();
    let doubted = numbered.filter(|(number, touch)| touch.pulls && reading.doubt(*number) > DOUBTED);
    doubted
        .map(|(number, touch)| {
            let at = touch.at;
            let now = reading.now_from_then(at);
            let point = now * reading.touched_point(touch).0;
            DoubtedTouch {
                at,
                point,
                approach: now.rotation * touch.contact.approach(),
                doubt: reading.doubt(number),
                is_settled: was_tried_again(reading, ledger, at, &point),
            }
        })
        .collect()
}

/// Whether a later approach came by a point.
fn was_tried_again(reading: &Reading, ledger: &Ledger, at: usize, point: &Point) -> bool {
    let now = |then: usize, place: &Point| reading.now_from_then(then) * place;
    let misses = ledger.misses.iter().map(|(then, sweep)| (*then, *sweep.from(), *sweep.to()));
    let touches = ledger.touches.iter().map(|touch| {
        let to = reading.touched_point(touch).0;
        // The touched point of the pad travelled beside its centre.
        let beside = to - touch.contact.point();
        (touch.at, touch.contact.swept_from().map_or(to, |from| from + beside), to)
    });
    misses.chain(touches).filter(|(then, _, _)| *then > at).any(|(then, from, to)| {
        let (from, to) = (now(then, &from), now(then, &to));
        let along = to - from;
        let share =
            ((point - from).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (from + along * share - point).norm() < NEAR_M
    })
}
