//! One approach of the probe and what became of it.

use nalgebra::{Quaternion, UnitQuaternion};

use super::check::{check_direction, check_point, check_unit, check_vector};
use super::pad::{Pad, Pressure};
use super::rejection::RejectReason;
use super::wrench::Wrench;
use crate::error::FieldError;
use crate::geometry::{Direction, Point, Pose, Vector};

/// The candidate that an attempt aimed at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    point: Point,
    normal: Direction,
}

impl Target {
    /// A point of the estimated surface and the outward normal there.
    ///
    /// # Errors
    /// A number that is not finite, or a normal without length.
    pub fn new(point: Point, normal: Vector) -> Result<Self, FieldError> {
        check_point("candidate.point", &point)?;
        let normal = check_direction("candidate.normal", normal)?;
        Ok(Self { point, normal })
    }

    /// The same candidate with its point and normal mapped.
    pub(super) fn mapped(
        &self,
        point: impl Fn(&Point) -> Point,
        direction: impl Fn(&Direction) -> Direction,
    ) -> Self {
        Self { point: point(&self.point), normal: direction(&self.normal) }
    }

    /// The point of the estimated surface, in metres.
    pub fn point(&self) -> &Point {
        &self.point
    }

    /// The outward normal there.
    pub fn normal(&self) -> &Direction {
        &self.normal
    }
}

/// One approach of the probe and what became of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Attempt {
    /// The candidate it aimed at; `None` for a motion that the robot chose itself.
    pub target: Option<Target>,
    /// What became of it.
    pub outcome: Outcome,
}

impl Attempt {
    /// The contacts, the one that was aimed first; none unless something was touched.
    pub fn contacts(&self) -> impl Iterator<Item = &Contact> {
        let (aimed, others) = match &self.outcome {
            Outcome::Contact(contact) => (Some(contact), &[][..]),
            Outcome::Contacts { aimed, others } => (Some(aimed), others.as_slice()),
            Outcome::NoContact(_) | Outcome::Rejected(_) | Outcome::InvalidContact(_) => (None, &[][..]),
        };
        aimed.into_iter().chain(others)
    }
}

/// What became of an approach.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The pad touched the object.
    Contact(Contact),
    /// Several pads touched at once.
    Contacts {
        /// By the pad that aimed at the candidate: whether the attempt succeeded is judged by it.
        aimed: Contact,
        /// By the others.
        others: Vec<Contact>,
    },
    /// The whole path was free.
    NoContact(Sweep),
    /// Never tried: out of reach, in collision, stopped.
    Rejected(RejectReason),
    /// Something other than the pad touched, at this pose of the sensor.
    InvalidContact(Pose),
}

/// A touch by the pad.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    base_from_sensor: Pose,
    /// Without what the sensor showed at rest.
    wrench: Wrench,
    rest_wrench: Option<Wrench>,
    pad: Pad,
    uncertainty: Option<f64>,
    swept_from: Option<Point>,
    normal: Option<Direction>,
}

/// What a touch may tell beyond its pose and wrench.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactDetail {
    /// The caller's own uncertainty in [0, 1], instead of Eq. (1).
    pub uncertainty: Option<f64>,
    /// Where the approach began, in metres: the path from there to the contact was free.
    pub swept_from: Option<Point>,
    /// The measured outward normal of the surface.
    pub normal: Option<Vector>,
    /// What the sensor showed before the approach, touching nothing.
    pub rest_wrench: Option<Wrench>,
}

impl Contact {
    /// Checks a touch. `base_from_sensor` is the centre of the pad's face at the moment of contact.
    ///
    /// # Errors
    /// A number that is not finite, or a normal without length.
    pub fn new(
        base_from_sensor: Pose,
        wrench: Wrench,
        pad: Pad,
        detail: ContactDetail,
    ) -> Result<Self, FieldError> {
        check_point("sensor_pose.position", &base_from_sensor.translation.vector.into())?;
        check_vector("wrench.force", &wrench.force)?;
        check_vector("wrench.torque", &wrench.torque)?;
        if let Some(rest) = &detail.rest_wrench {
            check_vector("rest_wrench.force", &rest.force)?;
            check_vector("rest_wrench.torque", &rest.torque)?;
        }
        if let Some(u) = detail.uncertainty {
            check_unit("uncertainty", u)?;
        }
        if let Some(from) = &detail.swept_from {
            check_point("swept_from", from)?;
        }
        let normal = detail.normal.map(|normal| check_direction("normal", normal)).transpose()?;
        let rest = detail.rest_wrench.unwrap_or_default();
        Ok(Self {
            base_from_sensor,
            wrench: Wrench { force: wrench.force - rest.force, torque: wrench.torque - rest.torque },
            rest_wrench: detail.rest_wrench,
            pad,
            uncertainty: detail.uncertainty,
            swept_from: detail.swept_from,
            normal,
        })
    }

    /// The same touch with its pose, point and direction mapped.
    pub(super) fn mapped(
        &self,
        pose: impl Fn(&Pose) -> Pose,
        point: impl Fn(&Point) -> Point,
        direction: impl Fn(&Direction) -> Direction,
    ) -> Self {
        Self {
            base_from_sensor: pose(&self.base_from_sensor),
            wrench: self.wrench,
            rest_wrench: self.rest_wrench,
            pad: self.pad,
            uncertainty: self.uncertainty,
            swept_from: self.swept_from.as_ref().map(point),
            normal: self.normal.as_ref().map(direction),
        }
    }

    /// The centre of the pad's face, in metres.
    pub fn point(&self) -> Point {
        self.base_from_sensor.translation.vector.into()
    }

    /// Pose of the sensor's frame.
    pub fn base_from_sensor(&self) -> &Pose {
        &self.base_from_sensor
    }

    /// Where on the pad the force acts.
    pub fn pressure(&self) -> Pressure {
        self.pad.pressure(&self.wrench)
    }

    /// The direction in which the pad faces, which is that of the approach.
    pub fn approach(&self) -> Direction {
        self.base_from_sensor.rotation * Vector::z_axis()
    }

    /// The direction in which the pad would face if its quaternion had been sent with w first.
    pub(super) fn approach_if_w_first(&self) -> Direction {
        let sent = self.base_from_sensor.rotation.coords;
        let meant = Quaternion::new(sent.x, sent.y, sent.z, sent.w);
        UnitQuaternion::from_quaternion(meant) * Vector::z_axis()
    }

    /// Force and torque on the sensor, without what it showed at rest.
    pub fn wrench(&self) -> &Wrench {
        &self.wrench
    }

    /// What the sensor showed at rest, where it was given.
    pub fn rest_wrench(&self) -> Option<&Wrench> {
        self.rest_wrench.as_ref()
    }

    /// The pad.
    pub fn pad(&self) -> &Pad {
        &self.pad
    }

    /// The caller's own uncertainty, where it was given.
    pub fn uncertainty(&self) -> Option<f64> {
        self.uncertainty
    }

    /// Where the approach began, where it was given.
    pub fn swept_from(&self) -> Option<&Point> {
        self.swept_from.as_ref()
    }

    /// The measured outward normal of the surface, where it was given.
    pub fn normal(&self) -> Option<&Direction> {
        self.normal.as_ref()
    }
}

/// A motion of the object that the caller knows of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    new_from_old: Pose,
    std_m: f64,
}

impl Moved {
    /// A point of the object that was at `p` is at `new_from_old * p`, known up to `std_m` metres.
    ///
    /// # Errors
    /// A number that is not finite, or a deviation outside 0..1 m.
    pub fn new(new_from_old: Pose, std_m: f64) -> Result<Self, FieldError> {
        check_point("new_from_old.position", &new_from_old.translation.vector.into())?;
        if !(0.0..=1.0).contains(&std_m) {
            return Err(FieldError::invalid("std_m", format!("{std_m} m is not between 0 m and 1 m")));
        }
        Ok(Self { new_from_old, std_m })
    }

    /// The motion.
    pub fn new_from_old(&self) -> &Pose {
        &self.new_from_old
    }

    /// How well it is known, in metres.
    pub fn std_m(&self) -> f64 {
        self.std_m
    }

    /// The same motion in another frame, `frame_from_base` of which is given.
    pub(super) fn seen_from(&self, frame_from_base: &Pose) -> Self {
        Self { new_from_old: frame_from_base * self.new_from_old * frame_from_base.inverse(), ..*self }
    }
}

/// A straight path of the probe on which nothing was touched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    from: Point,
    to: Point,
    radius_m: f64,
}

impl Sweep {
    /// A free path from `from` to `to` of a probe of `radius_m` (zero for a thin one).
    ///
    /// # Errors
    /// A number that is not finite, or a radius outside 0..1 m.
    pub fn new(from: Point, to: Point, radius_m: f64) -> Result<Self, FieldError> {
        check_point("swept_from", &from)?;
        check_point("swept_to", &to)?;
        if !(0.0..=1.0).contains(&radius_m) {
            let reason = format!("{radius_m} m is not between 0 m and 1 m");
            return Err(FieldError::invalid("sweep_radius_m", reason));
        }
        Ok(Self { from, to, radius_m })
    }

    /// The same path with its ends mapped.
    pub(super) fn mapped(&self, map: impl Fn(&Point) -> Point) -> Self {
        Self { from: map(&self.from), to: map(&self.to), radius_m: self.radius_m }
    }

    /// Where it began, in metres.
    pub fn from(&self) -> &Point {
        &self.from
    }

    /// Where it ended, in metres.
    pub fn to(&self) -> &Point {
        &self.to
    }

    /// The probe's radius, in metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// The middle of the path: the candidate, for a probe that travelled evenly about it.
    pub fn middle(&self) -> Point {
        nalgebra::center(&self.from, &self.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_that_are_not_finite_are_refused_by_name() {
        let error = Sweep::new(Point::origin(), Point::new(2e4, 0.0, 0.0), 0.0).unwrap_err();
        assert_eq!((error.field, error.non_finite), ("swept_to", true));
    }

    #[test]
    fn a_normal_without_length_is_refused() {
        let detail = ContactDetail { normal: Some(Vector::zeros()), ..ContactDetail::default() };
        let error =
            Contact::new(Pose::identity(), Wrench::default(), Pad::new(0.009).unwrap(), detail).unwrap_err();
        assert_eq!(error.field, "normal");
    }
}
