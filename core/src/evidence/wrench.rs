//! What a tactile sensor measures.

use crate::geometry::Vector;

/// Force and torque on the sensor, in its own frame (N, N m); z is the pad's outward normal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, in newtons; pressing on an object gives a negative z.
    pub force: Vector,
    /// Torque about the centre of the pad, in newton metres.
    pub torque: Vector,
}

impl Wrench {
    /// Whether nothing was measured at all.
    pub(super) fn is_zero(&self) -> bool {
        self.force == Vector::zeros() && self.torque == Vector::zeros()
    }
}
