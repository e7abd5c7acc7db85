//! Parts of the workspace that the probe must not enter.

use crate::geometry::{Direction, Point};

/// A part of the workspace that the probe's way must not enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KeepOut {
    /// All points with `normal . p < offset_m`, such as below a table.
    HalfSpace {
        /// The direction out of the forbidden side.
        normal: Direction,
        /// Where the boundary lies along it, in metres.
        offset_m: f64,
    },
    /// A forbidden ball.
    Ball {
        /// Its centre, in metres.
        center: Point,
        /// Its radius, in metres.
        radius_m: f64,
    },
}

impl KeepOut {
    /// Whether the way from `start` to `end` enters.
    pub(super) fn blocks(&self, start: &Point, end: &Point) -> bool {
        match self {
            Self::HalfSpace { normal, offset_m } => {
                normal.dot(&start.coords).min(normal.dot(&end.coords)) < *offset_m
            }
            Self::Ball { center, radius_m } => {
                let way = end - start;
                let along = ((center - start).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
                (start + way * along - center).norm() < *radius_m
            }
        }
    }
}
