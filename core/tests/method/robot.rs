//! A robot whose touches go wrong in the ways that real ones do, on an object that stays analytic.

use nalgebra::UnitQuaternion;
use palpate_core::config::{Config, Settings};
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Outcome, Pad, Sweep, Target, TouchedPoint, VisualPrior, Wrench,
};
use palpate_core::exploration::Candidate;
use palpate_core::geometry::{Point, Pose, Vector};
use palpate_core::reconstruction::Reconstruction;
use palpate_core::warning::WarningKind;

use crate::object::{Object, best};

/// Half the side of the pad's face, in metres.
pub(crate) const HALF_SIDE_M: f64 = 0.009;
/// Rays over half of the pad's face.
const RAYS: i32 = 8;

/// A session, what it was told, and the object as it is now.
pub(crate) struct Robot {
    pub(crate) object: Object,
    pub(crate) state: Reconstruction,
    pub(crate) log: Vec<Evidence>,
    pub(crate) pad: Pad,
    /// All that was warned about.
    pub(crate) warned: Vec<WarningKind>,
}

impl Robot {
    /// A session that was shown the object, off by `shift`.
    pub(crate) fn begin(object: Object, settings: Settings, shift: Vector) -> Self {
        let seen = object.prior();
        let points = seen.points().iter().map(|point| point + shift).collect();
        let viewpoint = seen.viewpoint().map(|viewpoint| viewpoint + shift);
        Self::shown(object, settings, VisualPrior::new(points, None, viewpoint).unwrap())
    }

    /// A session that was shown this of the object.
    pub(crate) fn shown(object: Object, settings: Settings, seen: VisualPrior) -> Self {
        let state = Reconstruction::new(Config::new(settings).unwrap());
        let mut robot =
            Self { object, state, log: Vec::new(), pad: Pad::new(HALF_SIDE_M).unwrap(), warned: Vec::new() };
        robot.tell(Evidence::VisualPrior(seen));
        robot
    }

    pub(crate) fn tell(&mut self, evidence: Evidence) {
        let (state, update) = self.state.absorb(&evidence).unwrap();
        self.state = state;
        self.warned.extend(update.warnings.iter().map(|warning| warning.kind));
        self.log.push(evidence);
    }

    fn next(&self) -> Candidate {
        self.state.propose(&best()).candidates[0].clone()
    }

    /// Touches with a point, told exactly.
    pub(crate) fn touch(&mut self) {
        self.tell(self.object.touch(&self.next()));
    }

    /// The same with a wrench that acts elsewhere on the pad than where it touched.
    pub(crate) fn touch_with_torque_at(&mut self, offset: Vector) {
        let told = self.object.touch(&self.next());
        let Evidence::Attempt(Attempt { target, outcome: Outcome::Contact(contact) }) = &told else {
            return self.tell(told);
        };
        let contact = pressed(*contact.base_from_sensor(), offset, self.pad);
        self.tell(Evidence::Attempt(Attempt { target: *target, outcome: Outcome::Contact(contact) }));
    }

    /// Touches with a flat pad that is held a little askew, and tells its centre.
    pub(crate) fn touch_flat(&mut self) {
        let number = self.log.len() as f64;
        let tilt = UnitQuaternion::new(Vector::new((2.4 * number).cos(), (2.4 * number).sin(), 0.0) * 0.15);
        self.tell(flat_touch(&self.object, &self.next(), self.pad, tilt));
    }

    /// The fold of what was told.
    pub(crate) fn folded(&self) -> Reconstruction {
        let fresh = Reconstruction::new(self.state.config().clone());
        self.log.iter().fold(fresh, |state, evidence| state.absorb(evidence).unwrap().0)
    }

    pub(crate) fn error_m(&self) -> f64 {
        self.object.mean_error_m(&self.state)
    }

    /// How the latest contact was read.
    pub(crate) fn touched_with(&self) -> TouchedPoint {
        self.state.latest_touches().1
    }
}

/// A contact at this pose whose force acts at an offset on the pad.
fn pressed(pose: Pose, offset: Vector, pad: Pad) -> Contact {
    let force = Vector::new(0.0, 0.0, -5.0);
    Contact::new(pose, Wrench { force, torque: offset.cross(&force) }, pad, ContactDetail::default()).unwrap()
}

/// What a flat pad meets first along a candidate's way, with whichever point of its face.
fn flat_touch(object: &Object, next: &Candidate, pad: Pad, tilt: UnitQuaternion<f64>) -> Evidence {
    let target = Some(Target::new(next.point, next.normal.into_inner()).unwrap());
    let facing = UnitQuaternion::rotation_between(&Vector::z(), &-next.normal.into_inner());
    let rotation = facing.unwrap_or_else(UnitQuaternion::identity) * tilt;
    let way = next.probe_end - next.probe_start;
    let rays = (-RAYS..=RAYS).flat_map(|x| (-RAYS..=RAYS).map(move |y| (f64::from(x), f64::from(y))));
    let first = rays
        .map(|(x, y)| Vector::new(x, y, 0.0) * (HALF_SIDE_M / f64::from(RAYS)))
        .filter_map(|offset| {
            object.met_at(&(next.probe_start + rotation * offset), &way).map(|at| (at, offset))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let outcome = match first {
        Some((at, offset)) => {
            let centre = next.probe_start + way * at;
            Outcome::Contact(pressed(Pose::from_parts(centre.coords.into(), rotation), offset, pad))
        }
        None => Outcome::NoContact(Sweep::new(next.probe_start, next.probe_end, 0.0).unwrap()),
    };
    Evidence::Attempt(Attempt { target, outcome })
}

/// A place outside an object, in metres off its surface, and the way to it.
pub(crate) fn contact_in_the_air(object: &Object, direction: Vector, off_m: f64) -> Evidence {
    let local = direction.normalize().component_mul(&object.semi_axes);
    let normal = (object.base_from_object.rotation * direction.normalize().component_div(&object.semi_axes))
        .normalize();
    let point: Point = object.base_from_object * Point::from(local) + normal * off_m;
    let facing = UnitQuaternion::rotation_between(&Vector::z(), &-normal).unwrap();
    let pose = Pose::from_parts(point.coords.into(), facing);
    let contact = pressed(pose, Vector::zeros(), Pad::new(HALF_SIDE_M).unwrap());
    Evidence::Attempt(Attempt { target: None, outcome: Outcome::Contact(contact) })
}

/// Evidence as it would have been told of an object that stood elsewhere.
pub(crate) fn moved_along(evidence: &Evidence, motion: &Pose) -> Evidence {
    let Attempt { target, outcome } = match evidence {
        Evidence::VisualPrior(seen) => {
            let points = seen.points().iter().map(|point| motion * point).collect();
            let viewpoint = seen.viewpoint().map(|viewpoint| motion * viewpoint);
            return Evidence::VisualPrior(VisualPrior::new(points, seen.uncertainty(), viewpoint).unwrap());
        }
        Evidence::Attempt(attempt) => attempt,
        Evidence::Moved(_) => panic!("not of a robot that was told of a motion"),
    };
    let target = target.map(|target| {
        Target::new(motion * target.point(), motion.rotation * target.normal().into_inner()).unwrap()
    });
    let outcome = match outcome {
        Outcome::Contact(contact) => {
            let pose = motion * contact.base_from_sensor();
            let detail = ContactDetail::default();
            Outcome::Contact(Contact::new(pose, *contact.wrench(), *contact.pad(), detail).unwrap())
        }
        Outcome::NoContact(sweep) => Outcome::NoContact(
            Sweep::new(motion * sweep.from(), motion * sweep.to(), sweep.radius_m()).unwrap(),
        ),
        other => panic!("{other:?} is not what this robot tells"),
    };
    Evidence::Attempt(Attempt { target, outcome })
}
