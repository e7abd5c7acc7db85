//! What a measured normal says: around its touch the surface goes on in the plane across it.

use super::attractor::{Attractor, Sense};
use crate::geometry::{self, Direction};

/// How far from the touch the plane is believed, in metres.
const RADIUS_M: f64 = 0.004;

/// Three points around a touch, on the plane across its normal.
pub(crate) fn around(touch: &Attractor, normal: &Direction) -> impl Iterator<Item = Attractor> {
    geometry::around(normal, 3).map(|across| Attractor {
        point: touch.point + across * RADIUS_M,
        sense: Sense::Tangent,
        ..*touch
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Point, Vector};

    #[test]
    fn the_points_lie_around_the_touch_and_across_the_normal() {
        for normal in [Vector::x(), Vector::new(0.3, -0.5, 0.8), -Vector::z()] {
            let normal = Direction::new_normalize(normal);
            let touch = Point::new(0.1, 0.2, 0.3);
            let points: Vec<_> =
                around(&Attractor::new(touch, 0.1, Sense::Touch), &normal).map(|a| a.point - touch).collect();
            assert!(
                points.iter().all(|p| (p.norm() - RADIUS_M).abs() < 1e-12 && p.dot(&normal).abs() < 1e-12)
            );
            assert!((points[0] + points[1] + points[2]).norm() < 1e-12);
        }
    }
}
