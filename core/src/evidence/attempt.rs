//! One approach of the probe and what became of it.

use super::check::{check_direction, check_point, check_unit, check_vector};
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

/// What became of an approach.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The pad touched the object.
    Contact(Contact),
    /// The whole path was free.
    NoContact(Sweep),
    /// Never tried: out of reach, in collision, stopped.
    Rejected,
    /// Something other than the pad touched, at this pose of the sensor.
    InvalidContact(Pose),
}

/// Force and torque on the sensor, in its own frame (N, N m); z is the pad's outward normal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, in newtons; pressing on an object gives a negative z.
    pub force: Vector,
    /// Torque about the centre of the pad, in newton metres.
    pub torque: Vector,
}

/// A touch by the pad.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    base_from_sensor: Pose,
    wrench: Wrench,
    pad_half_side_m: f64,
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
}

impl Contact {
    /// Checks a touch. `base_from_sensor` is the centre of the pad's face at the moment of contact.
    ///
    /// # Errors
    /// A number that is not finite, a pad without size, or a normal without length.
    pub fn new(
        base_from_sensor: Pose,
        wrench: Wrench,
        pad_half_side_m: f64,
        detail: ContactDetail,
    ) -> Result<Self, FieldError> {
        check_point("sensor_pose.position", &base_from_sensor.translation.vector.into())?;
        check_vector("wrench.force", &wrench.force)?;
        check_vector("wrench.torque", &wrench.torque)?;
        if !(1e-5..=1.0).contains(&pad_half_side_m) {
            let reason = format!("{pad_half_side_m} m is not between 0.00001 m and 1 m");
            return Err(FieldError::invalid("pad_half_side_m", reason));
        }
        if let Some(u) = detail.uncertainty {
            check_unit("uncertainty", u)?;
        }
        if let Some(from) = &detail.swept_from {
            check_point("swept_from", from)?;
        }
        let normal = detail.normal.map(|normal| check_direction("normal", normal)).transpose()?;
        Ok(Self {
            base_from_sensor,
            wrench,
            pad_half_side_m,
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
            pad_half_side_m: self.pad_half_side_m,
            uncertainty: self.uncertainty,
            swept_from: self.swept_from.as_ref().map(point),
            normal: self.normal.as_ref().map(direction),
        }
    }

    /// The touched point: the centre of the pad's face, in metres.
    pub fn point(&self) -> Point {
        self.base_from_sensor.translation.vector.into()
    }

    /// The direction in which the pad faces, which is that of the approach.
    pub fn approach(&self) -> Direction {
        self.base_from_sensor.rotation * Vector::z_axis()
    }

    /// Force and torque on the sensor.
    pub fn wrench(&self) -> &Wrench {
        &self.wrench
    }

    /// Half the side of the pad's square face, in metres.
    pub fn pad_half_side_m(&self) -> f64 {
        self.pad_half_side_m
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
        let error = Contact::new(Pose::identity(), Wrench::default(), 0.009, detail).unwrap_err();
        assert_eq!(error.field, "normal");
    }
}
