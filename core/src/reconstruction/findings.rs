//! What a session found out about its own evidence, for the caller: in the session's frame.

use super::{Detail, Reconstruction, belief};
use crate::evidence::TouchedPoint;
use crate::geometry::{Point, Vector};
use crate::warning::{Warning, WarningKind};

/// A touch that is doubted by less is not warned about: an odd shape is doubted, too.
const DOUBT_TO_WARN: f64 = 0.95;
/// A rigid offset of a view below this is what calibrations leave, in metres, as is one below so many of its
/// deviations.
const OFFSET_M: f64 = 0.004;
/// The same of its rotation, in radians.
const OFFSET_TURN: f64 = 0.02;
/// It has to be needed so often in a row, some touches apart: an odd shape looks like an offset until the template
/// has found it.
const OFFSET_NEEDED: usize = 2;
const OFFSET_DEVIATIONS: f64 = 2.0;

/// What was found out about the evidence.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// The touches that contradict what else is known.
    pub doubted: Vec<FoundDoubt>,
    /// How many points of the views contradict what else is known, of those that were fitted.
    pub doubted_points: usize,
    /// How each view is off as a whole, for those that are.
    pub offsets: Vec<FoundOffset>,
    /// How the object moved.
    pub motion: Option<FoundMotion>,
}

/// A touch that contradicts what else is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundDoubt {
    /// The number of its piece of evidence, from 0.
    pub at: usize,
    /// The touched point, in metres.
    pub point: Point,
    /// The probability that it is none, in [0, 1].
    pub doubt: f64,
    /// Whether its place was touched or swept again since.
    pub is_settled: bool,
}

/// A rigid offset of a view against the touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundOffset {
    /// The number of the view's piece of evidence, from 0.
    pub at: usize,
    /// What its points are to be moved by, in metres.
    pub translation_m: Vector,
    /// Standard deviation in the least certain direction, in metres.
    pub std_m: f64,
    /// What they are to be turned by about their mean: axis times angle, in radians.
    pub rotation: Vector,
    /// Standard deviation about the least certain axis, in radians.
    pub rotation_std: f64,
    /// Whether the measurements are clearly less likely without it, and stay so.
    pub is_needed: bool,
}

/// A motion of the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundMotion {
    /// The number of the first piece of evidence after it.
    pub since: usize,
    /// By what its points moved, in metres.
    pub translation_m: Vector,
    /// Standard deviation in the least certain direction, in metres.
    pub std_m: f64,
    /// Whether earlier evidence was taken along.
    pub is_followed: bool,
    /// Whether it was found in the evidence, and not reported.
    pub is_found: bool,
}

impl Reconstruction {
    /// What was found out about the evidence; nothing but in METHOD_PALPATE.
    pub fn findings(&self) -> Findings {
        let Some(Detail::Palpate(detail)) = self.estimate.as_ref().map(|estimate| &estimate.detail) else {
            return Findings::default();
        };
        let (reading, ledger, frame) = (&detail.reading, &self.ledger, &self.frame);
        let doubted = belief::doubted(reading, ledger).into_iter().map(|touch| FoundDoubt {
            at: touch.at,
            point: frame.point_in_base(&touch.point),
            doubt: touch.doubt,
            is_settled: touch.is_settled,
        });
        let offsets = ledger.views.iter().zip(&reading.view_offsets).map(|(view, offset)| FoundOffset {
            at: view.at,
            translation_m: frame.vector_in_base(&offset.mean),
            std_m: offset.std_m,
            rotation: frame.vector_in_base(&offset.turn),
            rotation_std: offset.turn_std,
            is_needed: reading.offsets_needed >= OFFSET_NEEDED,
        });
        let followed = reading.motions.last().map(|motion| (motion, true));
        let suspected = reading.suspected.as_ref().map(|motion| (motion, false));
        let motion = suspected.or(followed).map(|(motion, is_followed)| {
            // The body of the template is what moved, whatever it turned about.
            let centre = detail.template.shape.body.centre;
            let moved = centre - motion.new_from_old.inverse_transform_point(&centre);
            let rest = if is_followed { reading.motion_offset.mean } else { Vector::zeros() };
            FoundMotion {
                since: motion.since,
                translation_m: frame.vector_in_base(&(moved + rest)),
                std_m: if is_followed && reading.motion_offset.std_m > 0.0 {
                    reading.motion_offset.std_m
                } else {
                    motion.std_m
                },
                is_followed,
                is_found: motion.is_found,
            }
        });
        Findings {
            doubted: doubted.collect(),
            doubted_points: reading.seen_doubts.len(),
            offsets: offsets.collect(),
            motion,
        }
    }

    /// The points that were taken as touched in the latest piece of evidence, in metres, and how they were
    /// found; nothing but for contacts.
    pub fn latest_touches(&self) -> (Vec<Point>, TouchedPoint) {
        let latest = self.ledger.entries.saturating_sub(1);
        let touches = self.ledger.touches.iter().filter(|touch| touch.at == latest);
        let reading = self.reading();
        let by_pressure = touches.clone().any(|touch| reading.is_by_pressure(touch));
        let touched = if by_pressure { TouchedPoint::CentreOfPressure } else { TouchedPoint::PadCentre };
        (touches.map(|touch| self.frame.point_in_base(&reading.touched_point(touch).0)).collect(), touched)
    }
}

impl Findings {
    /// What is new since others, in words for the caller.
    pub(super) fn warnings_since(&self, before: &Self) -> Vec<Warning> {
        let is_to_be_told = |doubt: &&FoundDoubt| doubt.is_settled && doubt.doubt > DOUBT_TO_WARN;
        let doubts =
            self.doubted.iter().filter(is_to_be_told).filter(|doubt| {
                !before.doubted.iter().filter(is_to_be_told).any(|other| other.at == doubt.at)
            });
        let doubts = doubts.map(|doubt| {
            let FoundDoubt { at, point, doubt, .. } = *doubt;
            let message = format!(
                "the touch at ({:.4}, {:.4}, {:.4}) m is doubted ({:.0} %): its place was tried again, and other \
                 touches and free space contradict it; it hardly counts until something confirms it",
                point.x,
                point.y,
                point.z,
                100.0 * doubt
            );
            Warning::new(WarningKind::DoubtedContact, message).with("doubt", doubt).with("evidence", at as f64)
        });
        let is_off = |offset: &&FoundOffset| {
            let (length_m, angle) = (offset.translation_m.norm(), offset.rotation.norm());
            let is_moved = length_m > OFFSET_M && length_m > OFFSET_DEVIATIONS * offset.std_m;
            let is_turned = angle > OFFSET_TURN && angle > OFFSET_DEVIATIONS * offset.rotation_std;
            offset.is_needed && (is_moved || is_turned)
        };
        let offsets = self
            .offsets
            .iter()
            .filter(is_off)
            .filter(|offset| !before.offsets.iter().filter(is_off).any(|other| other.at == offset.at));
        let offsets = offsets.map(|offset| {
            let FoundOffset { translation_m: t, std_m, rotation, rotation_std, .. } = *offset;
            let message = format!(
                "camera and robot disagree by {:.1} mm (± {:.1} mm) and {:.1}° (± {:.1}°): the view's points are \
                 moved by ({:.4}, {:.4}, {:.4}) m and turned about their mean; calibrate the camera against the \
                 robot",
                1e3 * t.norm(),
                1e3 * std_m,
                rotation.norm().to_degrees(),
                rotation_std.to_degrees(),
                t.x,
                t.y,
                t.z
            );
            Warning::new(WarningKind::CameraOffset, message)
                .with("offset_m", t.norm())
                .with("std_m", std_m)
                .with("rotation_rad", rotation.norm())
                .with("rotation_std_rad", rotation_std)
        });
        let motion = self.motion.filter(|motion| motion.is_found).filter(|motion| {
            before
                .motion
                .is_none_or(|other| (other.since, other.is_followed) != (motion.since, motion.is_followed))
        });
        let motion = motion.map(|motion| {
            let FoundMotion { translation_m: t, std_m, is_followed, .. } = motion;
            let what = if is_followed {
                "earlier evidence is taken along; report object_moved if you know better"
            } else {
                "earlier evidence stays where it was: report object_moved, or create sessions with on_motion \
                 ON_MOTION_FOLLOW"
            };
            let message = format!(
                "the object seems to have moved by {:.1} mm (± {:.1} mm), by ({:.4}, {:.4}, {:.4}) m: {what}",
                1e3 * t.norm(),
                1e3 * std_m,
                t.x,
                t.y,
                t.z
            );
            Warning::new(WarningKind::ObjectMoved, message).with("distance_m", t.norm()).with("std_m", std_m)
        });
        doubts.chain(offsets).chain(motion).collect()
    }
}
