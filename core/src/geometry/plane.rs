//! A plane with a side.

use super::{Direction, Point, Vector};

/// All points with `normal · p = offset_m`; the normal points to one of its sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    normal: Direction,
    offset_m: f64,
}

impl Plane {
    /// The plane at a distance from the origin along its normal, in metres.
    pub fn new(normal: Direction, offset_m: f64) -> Self {
        Self { normal, offset_m }
    }

    /// The plane through three points, with its normal towards another; `None` where they are on a line.
    pub fn through([a, b, c]: &[Point; 3], towards: &Point) -> Option<Self> {
        let normal = Direction::try_new((b - a).cross(&(c - a)), 1e-9)?;
        let normal = if normal.dot(&(towards - a)) < 0.0 { -normal } else { normal };
        Some(Self { offset_m: normal.dot(&a.coords), normal })
    }

    /// Its normal.
    pub fn normal(&self) -> &Direction {
        &self.normal
    }

    /// Its distance from the origin along the normal, in metres.
    pub fn offset_m(&self) -> f64 {
        self.offset_m
    }

    /// The height of a point over it, in metres.
    pub fn height_m(&self, point: &Point) -> f64 {
        self.normal.dot(&point.coords) - self.offset_m
    }

    /// The nearest point on it.
    pub fn foot(&self, point: &Point) -> Point {
        point - self.normal.into_inner() * self.height_m(point)
    }

    /// Two directions along it, at right angles.
    pub fn axes(&self) -> (Vector, Vector) {
        let aside = if self.normal.x.abs() < 0.9 { Vector::x() } else { Vector::y() };
        let first = self.normal.cross(&aside).normalize();
        (first, self.normal.cross(&first))
    }
}
