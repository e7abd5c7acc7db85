//! A point of a surface with the normal there.

use super::{Direction, Point, Vector};

/// Where on a surface, and which way it faces there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// In metres.
    pub point: Vector,
    /// Unit length; the representative of a point under a revolution keeps only the part of its normal
    /// that lies in the plane of the axis.
    pub normal: Vector,
}

impl SurfacePoint {
    /// A point with its outward normal.
    pub fn new(point: &Point, normal: &Direction) -> Self {
        Self { point: point.coords, normal: normal.into_inner() }
    }
}
