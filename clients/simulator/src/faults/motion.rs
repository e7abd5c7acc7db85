//! An object that a touch has pushed aside, or somebody has.

use palpate_core::geometry::Vector;
use rand::RngExt;

use crate::random::{Stream, generator};

/// One motion of the object, across the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// It happens after this attempt and before the next; 0 is before the first.
    pub attempt: u32,
    /// How far, in metres.
    pub distance_m: f64,
}

impl Motion {
    /// By what the object moves, in metres: horizontally, in the direction that belongs to `seed`.
    pub fn displacement(&self, seed: u64) -> Vector {
        let azimuth = generator(seed, Stream::Motion).random_range(0.0..std::f64::consts::TAU);
        self.distance_m * Vector::new(azimuth.cos(), azimuth.sin(), 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_moves_across_the_table_as_far_as_was_asked_for_anywhere() {
        let motion = Motion { attempt: 15, distance_m: 0.02 };
        let moved: Vec<Vector> = (0..40).map(|seed| motion.displacement(seed)).collect();
        assert!(moved.iter().all(|by| (by.norm() - 0.02).abs() < 1e-15 && by.z == 0.0));
        for quarter in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)] {
            assert!(moved.iter().any(|by| by.x * quarter.0 > 0.0 && by.y * quarter.1 > 0.0));
        }
        assert_eq!(motion.displacement(3), motion.displacement(3));
    }
}
