//! The fingerprint of a state: equal states have equal fingerprints, whatever is compared bit by bit.

use nalgebra::Rotation3;
use sha2::{Digest, Sha256};

use crate::geometry::{Point, Pose, Vector};

/// A fingerprint in the making. A type that is part of the state adds itself by a method
/// `fingerprint` that names all of its fields, so that a new one is not forgotten.
#[derive(Default)]
pub(crate) struct Fingerprint(Sha256);

impl Fingerprint {
    /// Adds a number, by its bits.
    pub(crate) fn number(&mut self, x: f64) {
        self.0.update(x.to_bits().to_le_bytes());
    }

    /// Adds a count, or what kind something is.
    pub(crate) fn count(&mut self, x: usize) {
        self.0.update((x as u64).to_le_bytes());
    }

    /// Adds several numbers and how many they are.
    pub(crate) fn numbers(&mut self, numbers: &[f64]) {
        self.count(numbers.len());
        numbers.iter().for_each(|x| self.number(*x));
    }

    /// Adds a vector.
    pub(crate) fn vector(&mut self, vector: &Vector) {
        vector.iter().for_each(|x| self.number(*x));
    }

    /// Adds points and how many they are.
    pub(crate) fn points(&mut self, points: &[Point]) {
        self.count(points.len());
        points.iter().for_each(|point| self.vector(&point.coords));
    }

    /// Adds a pose.
    pub(crate) fn pose(&mut self, pose: &Pose) {
        self.vector(&pose.translation.vector);
        pose.rotation.coords.iter().for_each(|x| self.number(*x));
    }

    /// Adds a rotation.
    pub(crate) fn rotation(&mut self, rotation: &Rotation3<f64>) {
        rotation.matrix().iter().for_each(|x| self.number(*x));
    }

    /// What came of it.
    pub(crate) fn finish(self) -> [u8; 32] {
        self.0.finalize().into()
    }
}
