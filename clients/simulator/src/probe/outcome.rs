//! An approach, how it ended, and what was measured of it.

use palpate_core::geometry::{Direction, Point, Pose, Vector};

/// Where to touch: from `start` to `end`, both in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Outside the estimated surface.
    pub start: Point,
    /// Inside the estimated surface.
    pub end: Point,
}

impl Approach {
    /// The same motion elsewhere.
    #[must_use]
    pub(crate) fn moved(&self, by: &Vector) -> Self {
        Self { start: self.start + by, end: self.end + by }
    }
}

/// How an approach ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Touched within the window from start to end.
    Hit(Touch),
    /// Touched before the window: a failure of the estimate, but a measurement all the same.
    Early(Touch),
    /// Nothing between start and end.
    Miss,
    /// Reported as a contact, though nothing was touched.
    False(Touch),
}

impl Outcome {
    /// What is reported as a contact, true or not.
    pub fn contact(&self) -> Option<&Touch> {
        match self {
            Self::Hit(touch) | Self::Early(touch) | Self::False(touch) => Some(touch),
            Self::Miss => None,
        }
    }

    /// The same outcome elsewhere.
    #[must_use]
    pub(crate) fn moved(self, by: &Vector) -> Self {
        match self {
            Self::Hit(touch) => Self::Hit(touch.moved(by)),
            Self::Early(touch) => Self::Early(touch.moved(by)),
            Self::Miss => Self::Miss,
            Self::False(touch) => Self::False(touch.moved(by)),
        }
    }
}

/// A measured contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The pad's face, z out of the pad and into the object: a point is centred on what it touched, the centre
    /// of a flat pad may lie beside it.
    pub base_from_sensor: Pose,
    /// What the object does to the pad, in the sensor's frame, in newtons: pressing gives z < 0.
    pub force_n: Vector,
    /// Likewise, in newton metres.
    pub torque_nm: Vector,
    /// Where the free motion that ended here began.
    pub swept_from: Point,
    /// Outward normal of the touched surface, if it is measured.
    pub normal: Option<Direction>,
}

impl Touch {
    fn moved(mut self, by: &Vector) -> Self {
        self.base_from_sensor.translation.vector += by;
        self.swept_from += by;
        self
    }
}
