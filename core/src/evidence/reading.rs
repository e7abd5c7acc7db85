//! A reading of the evidence: what METHOD_PALPATE believes of what it was told.
//!
//! The ledger keeps what was reported. How it is to be read is estimated with the surface: which point of
//! a pad touched, which touches are no touches, by how much each view is off as a whole, and whether the
//! object moved. All else reads the ledger through this.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::attractor::{Attractor, Group, Provenance, Rigid, Sense};
use super::free_space::FreeSpace;
use super::ledger::{Ledger, Motion, Touch};
use super::pad::TouchedPoint;
use super::surroundings::Surroundings;
use super::tangent;
use crate::config::Config;
use crate::fingerprint::Fingerprint;
use crate::geometry::{Point, Pose, Vector};

/// A view is off by this as a whole, in metres, before any touch says more: the calibration of a camera
/// against the robot.
const CALIBRATION_M: f64 = 0.003;
/// And turned by this about each axis, in radians.
const CALIBRATION_TURN: f64 = 0.01;
/// A touch farther than this share of the pad's half side from its centre shows that the pad is flat.
const OFF_CENTRE: f64 = 0.3;
/// A touch is taken for none where its doubt is above this.
pub(crate) const DOUBTED: f64 = 0.5;

/// A reading of the evidence.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Reading {
    /// Which point of a pad touches, where the pad leaves it open.
    pub(crate) touched: TouchedPoint,
    /// The probability of each touch to be none, in [0, 1]; none of those that are not listed.
    pub(crate) doubts: Vec<f64>,
    /// The same of what was seen, by view and point.
    pub(crate) seen_doubts: BTreeMap<(usize, usize), f64>,
    /// What each view is to be moved by; nothing for those that are not listed.
    pub(crate) view_offsets: Vec<RigidOffset>,
    /// How the object moved, as it was reported and found, in that order of time.
    pub(crate) motions: Vec<Motion>,
    /// How many of the reported motions are among them.
    pub(crate) reported: usize,
    /// Where the object seems to stand on its support, in metres.
    pub(crate) stands_at: Option<Point>,
    /// A motion that was found and is not followed.
    pub(crate) suspected: Option<Motion>,
    /// A motion that was found once, with how much evidence there was then: it is to be found again.
    pub(crate) awaited: Option<(Motion, usize)>,
    /// What is left of that motion.
    pub(crate) motion_offset: RigidOffset,
    /// Whether rigid offsets are looked for.
    pub(crate) finds_offsets: bool,
    /// How often in a row the measurements were clearly less likely without them.
    pub(crate) offsets_needed: usize,
    /// Whether touches are doubted.
    pub(crate) doubts_touches: bool,
    /// Whether rigid offsets may be looked for, and whether centres of pressure may be taken.
    pub(crate) may_find_offsets: bool,
    pub(crate) may_take_pressure: bool,
}

/// A rigid offset that was estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RigidOffset {
    /// The translation, in metres.
    pub mean: Vector,
    /// Its standard deviation in the least certain direction, in metres.
    pub std_m: f64,
    /// The small rotation: its axis times its angle, in radians.
    pub turn: Vector,
    /// Its standard deviation about the least certain axis, in radians.
    pub turn_std: f64,
}

impl RigidOffset {
    /// What it moves a point by that lies at `lever` from what it turns about, in metres.
    fn at(&self, lever: &Vector) -> Vector {
        self.mean + self.turn.cross(lever)
    }
}

impl Reading {
    /// As printed: pads touch with their centre, unless they are declared otherwise, and all is believed.
    pub(crate) fn as_printed(ledger: &Ledger) -> Self {
        Self { touched: TouchedPoint::PadCentre, ..Self::default() }.told(ledger)
    }

    /// The reading before anything was fitted.
    pub(crate) fn first(config: &Config) -> Self {
        let touched =
            if config.stages.pressure { TouchedPoint::CentreOfPressure } else { TouchedPoint::PadCentre };
        Self {
            touched,
            finds_offsets: config.stages.offsets,
            may_find_offsets: config.stages.offsets,
            may_take_pressure: config.stages.pressure,
            doubts_touches: config.stages.doubts,
            ..Self::default()
        }
    }

    /// What is taken for no point of the surface: touches by their number, and what was seen by view and point.
    pub(crate) fn doubted(&self) -> BTreeSet<(Option<usize>, usize)> {
        let touches = (0..self.doubts.len()).filter(|touch| self.doubt(*touch) > DOUBTED);
        let seen = self.seen_doubts.iter().filter(|(_, doubt)| **doubt > DOUBTED);
        let seen = seen.map(|(&(view, point), _)| (Some(view), point));
        touches.map(|touch| (None, touch)).chain(seen).collect()
    }

    /// Adds itself to a fingerprint.
    pub(crate) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self {
            stands_at,
            suspected,
            awaited,
            touched,
            doubts,
            seen_doubts,
            view_offsets,
            motions,
            reported,
            motion_offset,
            finds_offsets,
            offsets_needed,
            doubts_touches,
            may_find_offsets: _,
            may_take_pressure: _,
        } = self;
        fingerprint.count(*touched as usize);
        fingerprint.numbers(doubts);
        for (&(view, point), doubt) in seen_doubts {
            fingerprint.count(view);
            fingerprint.count(point);
            fingerprint.number(*doubt);
        }
        fingerprint.count(view_offsets.len());
        for RigidOffset { mean, std_m, turn, turn_std } in view_offsets.iter().chain([motion_offset]) {
            fingerprint.vector(mean);
            fingerprint.number(*std_m);
            fingerprint.vector(turn);
            fingerprint.number(*turn_std);
        }
        fingerprint.points(stands_at.as_slice());
        fingerprint.count(suspected.map_or(0, |motion| motion.since));
        let (motion, at) = awaited.map_or((0, 0), |(motion, at)| (motion.since, at));
        fingerprint.count(motion);
        fingerprint.count(at);
        fingerprint.count(*reported);
        for Motion { since, new_from_old, std_m, is_found } in motions {
            fingerprint.count(usize::from(*is_found));
            fingerprint.count(*since);
            fingerprint.pose(new_from_old);
            fingerprint.number(*std_m);
        }
        fingerprint.count(usize::from(*finds_offsets));
        fingerprint.count(*offsets_needed);
        fingerprint.count(usize::from(*doubts_touches));
    }

    /// Where a touch touched, in metres: on the pad as it was then.
    pub(crate) fn touched_point(&self, touch: &Touch) -> (Point, f64) {
        let contact = &touch.contact;
        if !self.is_by_pressure(touch) {
            return (contact.point(), 0.0);
        }
        let pressure = contact.pressure();
        (contact.base_from_sensor() * Point::from(pressure.offset), pressure.std_m)
    }

    /// Whether the centre of pressure is taken for a touch.
    pub(crate) fn is_by_pressure(&self, touch: &Touch) -> bool {
        match (touch.contact.pad().touched(), self.touched) {
            (TouchedPoint::Open, TouchedPoint::CentreOfPressure) => !touch.contact.wrench().is_zero(),
            (TouchedPoint::Open, TouchedPoint::Open | TouchedPoint::PadCentre) => false,
            (TouchedPoint::PadCentre, _) => false,
            (TouchedPoint::CentreOfPressure, _) => true,
        }
    }

    /// The uncertainty of a touch, in [0, 1]: of a centre of pressure by how well it is known, against the
    /// pad's half side.
    pub(crate) fn uncertainty(&self, touch: &Touch, u_max: f64) -> f64 {
        let lateral_m = self.touched_point(touch).1;
        if !self.is_by_pressure(touch) || touch.contact.uncertainty().is_some() {
            return touch.uncertainty;
        }
        u_max * (lateral_m / touch.contact.pad().half_side_m()).min(1.0)
    }

    /// How likely a touch is none, in [0, 1].
    pub(crate) fn doubt(&self, touch: usize) -> f64 {
        self.doubts.get(touch).copied().unwrap_or(0.0)
    }

    /// The same reading with the motions that were reported since. What is reported after a motion was found
    /// is taken for that motion, as the caller knows it better.
    pub(crate) fn told(&self, ledger: &Ledger) -> Self {
        let mut next = self.clone();
        for reported in &ledger.motions[self.reported.min(ledger.motions.len())..] {
            match next.motions.last_mut() {
                Some(found) if found.is_found => {
                    *found = Motion { since: found.since, ..*reported };
                }
                _ => next.motions.push(*reported),
            }
            next.motion_offset = RigidOffset::default();
        }
        if next.reported < ledger.motions.len() {
            next.suspected = None;
        }
        next.reported = ledger.motions.len();
        next
    }

    /// The same reading with one more motion, after which all is believed again.
    pub(crate) fn moved(&self, motion: Motion) -> Self {
        let motions = self.motions.iter().copied().filter(|other| other.since < motion.since).chain([motion]);
        Self {
            motions: motions.collect(),
            motion_offset: RigidOffset::default(),
            doubts: Vec::new(),
            seen_doubts: BTreeMap::new(),
            ..self.clone()
        }
    }

    /// What moves a point of the object that was measured as evidence `at` to where it is now.
    pub(crate) fn now_from_then(&self, at: usize) -> Pose {
        let after = self.motions.iter().filter(|motion| at < motion.since);
        after.fold(Pose::identity(), |pose, motion| motion.new_from_old * pose)
    }

    /// The last motion that is not known exactly, whose remainder is estimated.
    fn uncertain_motion(&self) -> Option<&Motion> {
        self.motions.iter().rev().find(|motion| motion.std_m > 0.0)
    }

    /// What a point of evidence `at` shares with others, and what it is corrected by. A point of a view comes with
    /// the view's number and its own lever about the view's centre.
    fn rigid(&self, at: usize, seen: Option<(usize, Vector)>) -> ([Option<Rigid>; 2], Vector) {
        let seen = seen.filter(|_| self.finds_offsets);
        let of_view = seen.map(|(view, lever)| Rigid {
            group: Group::View(view),
            std_m: CALIBRATION_M,
            turn_std: CALIBRATION_TURN,
            lever,
        });
        let before = self.uncertain_motion().filter(|motion| at < motion.since);
        let of_motion = before.map(|motion| Rigid {
            group: Group::BeforeMotion,
            std_m: motion.std_m,
            turn_std: 0.0,
            lever: Vector::zeros(),
        });
        let view_offset =
            seen.and_then(|(view, lever)| Some(self.view_offsets.get(view)?.at(&lever))).unwrap_or_default();
        let motion_offset = before.map(|_| self.motion_offset.mean).unwrap_or_default();
        ([of_view, of_motion], view_offset + motion_offset)
    }

    /// What pulls the surface: all that was seen, then all touches, then what measured normals add.
    pub(crate) fn attractors(&self, ledger: &Ledger, u_max: f64) -> Vec<Attractor> {
        let mut attractors = self.seen(ledger);
        let mut tangents = Vec::new();
        for (number, touch) in ledger.touches.iter().enumerate().filter(|(_, touch)| touch.pulls) {
            let now = self.now_from_then(touch.at);
            let (rigid, correction) = self.rigid(touch.at, None);
            let (point, lateral_m) = self.touched_point(touch);
            let attractor = Attractor {
                point: now * point + correction,
                uncertainty: self.uncertainty(touch, u_max),
                sense: Sense::Touch,
                provenance: Provenance {
                    source: number,
                    index: 0,
                    doubt: self.doubt(number),
                    lateral_m,
                    approach: now * touch.contact.approach().into_inner(),
                    correction,
                    rigid,
                },
            };
            attractors.push(attractor);
            if let Some(normal) = &touch.normal {
                tangents.extend(tangent::around(&attractor, &(now.rotation * *normal)));
            }
        }
        attractors.extend(tangents);
        attractors
    }

    fn seen(&self, ledger: &Ledger) -> Vec<Attractor> {
        let mut attractors = Vec::new();
        for (number, view) in ledger.views.iter().enumerate() {
            let now = self.now_from_then(view.at);
            let centre = view.prior.centre();
            let doubt = |index| self.seen_doubts.get(&(number, index)).copied().unwrap_or(0.0);
            attractors.extend(view.prior.points().iter().enumerate().map(|(index, point)| {
                let lever = now * (point - centre);
                let (rigid, correction) = self.rigid(view.at, Some((number, lever)));
                Attractor {
                    point: now * point + correction,
                    uncertainty: view.uncertainty,
                    sense: Sense::Vision,
                    provenance: Provenance {
                        source: number,
                        index,
                        doubt: doubt(index),
                        correction,
                        rigid,
                        ..Provenance::default()
                    },
                }
            }));
        }
        attractors
    }

    /// Where the camera stood, as the object lies now, in metres.
    pub(crate) fn viewpoint(&self, ledger: &Ledger) -> Option<Point> {
        let (at, viewpoint) = ledger.viewpoint()?;
        Some(self.now_from_then(at) * viewpoint)
    }

    /// What is near enough to say something of the object, as it lies now: around all that was seen and touched.
    pub(crate) fn surroundings(&self, ledger: &Ledger) -> Option<Surroundings> {
        let seen = ledger.views.iter().flat_map(|view| {
            let now = self.now_from_then(view.at);
            view.prior.points().iter().map(move |point| now * point)
        });
        let pulling = ledger.touches.iter().filter(|touch| touch.pulls);
        let touched = pulling.map(|touch| self.now_from_then(touch.at) * touch.contact.point());
        Surroundings::around(seen.chain(touched))
    }

    /// Where the object is not, and where it is. `travel_m` is how far outside its candidate a probe starts.
    pub(crate) fn free_space(&self, ledger: &Ledger, travel_m: f64) -> FreeSpace {
        let mut space = FreeSpace::within(self.surroundings(ledger));
        for (at, sweep) in &ledger.misses {
            let (now, correction) = (self.now_from_then(*at), self.rigid(*at, None).1);
            space.add_miss(&sweep.mapped(|point| now * point + correction));
        }
        for (number, touch) in ledger.touches.iter().enumerate() {
            let now = self.now_from_then(touch.at);
            let correction = self.rigid(touch.at, None).1;
            let map = |point: &Point| now * point + correction;
            let turn = |direction: &_| now.rotation * *direction;
            let pose = |pose: &Pose| Pose::from_parts(correction.into(), nalgebra::one()) * now * pose;
            let contact = touch.contact.mapped(pose, map, turn);
            let target = touch.target.map(|target| target.mapped(map, turn));
            let touched = map(&self.touched_point(touch).0);
            // What was no touch says nothing of what lies behind it.
            let target = target.filter(|_| self.doubt(number) < DOUBTED);
            space.add_approach(&touched, &contact, target.as_ref(), travel_m);
            let off_centre_m = (touched - contact.point()).norm();
            if off_centre_m > OFF_CENTRE * contact.pad().half_side_m() {
                space.add_face(&touched, &contact);
            }
        }
        space.thinned()
    }
}
