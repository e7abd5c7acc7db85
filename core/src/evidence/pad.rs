//! The pad, and which point of it touched.
//!
//! A flat pad touches with its rim or a corner as often as with its middle, so its centre lies up to its
//! half diagonal beside the surface. The wrench tells where the force acts: with the touched point at
//! `r` on the pad, `T = r × F`, so
//!
//! ```text
//! r = (-T.y, T.x) / F.z          in the sensor's frame, z out of the pad
//! ```
//!
//! whatever friction does within the pad's plane. Friction adds `T.z = r.x F.y - r.y F.x` beside what the
//! pad is twisted, so the three equations are solved together, each by its noise.

use nalgebra::{Matrix2, Vector2};

use super::wrench::Wrench;
use serde::{Deserialize, Serialize};

use crate::error::FieldError;
use crate::geometry::Vector;

/// Noise of a six-axis tactile chip: of each component of the force in newtons and of the torque in
/// newton metres.
const FORCE_NOISE_N: f64 = 0.05;
const TORQUE_NOISE_NM: f64 = 0.0005;
/// A pad can be twisted about its axis by this share of its force times its half side: a coefficient of
/// friction of a half, and a contact of a third of the pad's half side.
const TWIST: f64 = 0.15;
/// A load below this many deviations of the force says nothing.
const LOAD_DEVIATIONS: f64 = 4.0;
/// A force this far outside the pad, in half sides, acts on something else of the tool.
const BESIDE: f64 = 1.5;

/// Which point of a pad is taken as touched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum TouchedPoint {
    /// The method's own choice.
    #[default]
    Open,
    /// The centre of the pad's face.
    PadCentre,
    /// Where the force acts.
    CentreOfPressure,
}

/// A square pad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pad {
    half_side_m: f64,
    force_noise_n: f64,
    torque_noise_nm: f64,
    touched: TouchedPoint,
}

impl Default for Pad {
    /// The pad that is assumed where none is declared: 18 mm a side.
    fn default() -> Self {
        Self {
            half_side_m: 0.009,
            force_noise_n: FORCE_NOISE_N,
            torque_noise_nm: TORQUE_NOISE_NM,
            touched: TouchedPoint::Open,
        }
    }
}

/// Where on a pad a force acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pressure {
    /// In the sensor's frame, on the pad's face, in metres.
    pub offset: Vector,
    /// Standard deviation of the offset within the face, in metres.
    pub std_m: f64,
    /// How far beyond the pad's edge the wrench says that the force acts, in half sides; 0 on the pad.
    pub beside: f64,
    /// Whether there was load enough to tell.
    pub is_loaded: bool,
}

impl Pressure {
    /// Whether the wrench says that something beside the pad was touched.
    pub fn is_beside_pad(&self) -> bool {
        self.beside > BESIDE - 1.0
    }
}

impl Pad {
    /// A pad of half this side in metres, with the noise of a common sensor.
    ///
    /// # Errors
    /// A side that is not between 0.00001 m and 1 m.
    pub fn new(half_side_m: f64) -> Result<Self, FieldError> {
        if !(1e-5..=1.0).contains(&half_side_m) {
            let reason = format!("{half_side_m} m is not between 0.00001 m and 1 m");
            return Err(FieldError::invalid("pad_half_side_m", reason));
        }
        Ok(Self { half_side_m, ..Self::default() })
    }

    /// The same with the sensor's noise: standard deviations of each component of the force in newtons
    /// and of the torque in newton metres.
    ///
    /// # Errors
    /// A noise that is not positive, or beyond 1e4.
    pub fn with_noise(self, force_noise_n: f64, torque_noise_nm: f64) -> Result<Self, FieldError> {
        for (field, noise) in [("force_noise_n", force_noise_n), ("torque_noise_nm", torque_noise_nm)] {
            if !(f64::MIN_POSITIVE..=1e4).contains(&noise) {
                return Err(FieldError::invalid(field, format!("{noise} is not above 0 and at most 10000")));
            }
        }
        Ok(Self { force_noise_n, torque_noise_nm, ..self })
    }

    /// The same with the point that is taken as touched.
    pub fn touching_with(self, touched: TouchedPoint) -> Self {
        Self { touched, ..self }
    }

    /// Half the side of the face, in metres.
    pub fn half_side_m(&self) -> f64 {
        self.half_side_m
    }

    /// Noise of each component of the force, in newtons.
    pub fn force_noise_n(&self) -> f64 {
        self.force_noise_n
    }

    /// Noise of each component of the torque, in newton metres.
    pub fn torque_noise_nm(&self) -> f64 {
        self.torque_noise_nm
    }

    /// Which point is taken as touched.
    pub fn touched(&self) -> TouchedPoint {
        self.touched
    }

    /// Where the force of a wrench acts on the pad. Without load enough it is anywhere on the face.
    pub fn pressure(&self, wrench: &Wrench) -> Pressure {
        let (force, torque) = (&wrench.force, &wrench.torque);
        let load_n = -force.z;
        if load_n < LOAD_DEVIATIONS * self.force_noise_n {
            // The deviation of an even distribution over the side.
            let std_m = self.half_side_m / 3.0_f64.sqrt();
            return Pressure { offset: Vector::zeros(), std_m, beside: 0.0, is_loaded: false };
        }
        let twist_nm = TWIST * load_n * self.half_side_m;
        let variance = self.torque_noise_nm.powi(2);
        let rows = [
            (Vector2::new(0.0, force.z), torque.x, variance),
            (Vector2::new(-force.z, 0.0), torque.y, variance),
            (Vector2::new(force.y, -force.x), torque.z, variance + twist_nm.powi(2)),
        ];
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for (row, measured, variance) in rows {
            normal += row * row.transpose() / variance;
            right += row * (measured / variance);
        }
        // The load is not zero, so neither is the determinant.
        let lever = normal.cholesky().map_or_else(Vector2::zeros, |factor| factor.solve(&right));
        let on_pad = lever.map(|x| x.clamp(-self.half_side_m, self.half_side_m));
        let std_m = self.torque_noise_nm.hypot(lever.norm() * self.force_noise_n) / load_n;
        Pressure {
            offset: Vector::new(on_pad.x, on_pad.y, 0.0),
            std_m: std_m.min(self.half_side_m),
            beside: (lever.amax() / self.half_side_m - 1.0).max(0.0),
            is_loaded: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF_SIDE_M: f64 = 0.009;

    fn pad() -> Pad {
        Pad::new(HALF_SIDE_M).unwrap()
    }

    /// What a force at an offset on the pad shows.
    fn wrench_at(offset: Vector, force: Vector) -> Wrench {
        Wrench { force, torque: offset.cross(&force) }
    }

    #[test]
    fn a_force_is_found_where_it_acts_whatever_friction_does() {
        for (x, y) in [(0.0, 0.0), (0.008, -0.003), (-0.009, 0.009)] {
            for (across_x, across_y) in [(0.0, 0.0), (1.5, -0.5), (-2.0, 1.0)] {
                let (offset, force) = (Vector::new(x, y, 0.0), Vector::new(across_x, across_y, -5.0));
                let pressure = pad().pressure(&wrench_at(offset, force));
                assert!((pressure.offset - offset).norm() < 1e-12, "{pressure:?}");
                assert!(pressure.beside < 1e-9 && pressure.is_loaded);
                assert!((1e-4..2.5e-4).contains(&pressure.std_m), "{pressure:?}");
            }
        }
    }

    #[test]
    fn a_twist_about_the_axis_of_the_pad_hardly_moves_the_point() {
        let offset = Vector::new(0.004, 0.002, 0.0);
        let mut wrench = wrench_at(offset, Vector::new(1.0, 0.5, -5.0));
        wrench.torque.z += 0.005;
        assert!((pad().pressure(&wrench).offset - offset).norm() < 2e-4);
    }

    #[test]
    fn a_force_beside_the_pad_is_clamped_to_it_and_told() {
        let pressure = pad().pressure(&wrench_at(Vector::new(0.03, 0.0, 0.0), Vector::new(0.0, 0.0, -5.0)));
        assert!((pressure.offset - Vector::new(HALF_SIDE_M, 0.0, 0.0)).norm() < 1e-12);
        assert!(pressure.is_beside_pad() && (pressure.beside - 7.0 / 3.0).abs() < 1e-9);
    }

    #[test]
    fn without_load_the_point_is_anywhere_on_the_face() {
        for force_z in [-0.1, 0.0, 3.0] {
            let wrench = wrench_at(Vector::new(0.008, 0.0, 0.0), Vector::new(0.0, 0.0, force_z));
            let pressure = pad().pressure(&wrench);
            assert_eq!((pressure.offset, pressure.is_loaded), (Vector::zeros(), false));
            assert!((pressure.std_m - 0.0052).abs() < 1e-4);
        }
    }

    #[test]
    fn a_pad_without_size_or_a_sensor_without_noise_is_refused() {
        assert_eq!(Pad::new(0.0).unwrap_err().field, "pad_half_side_m");
        assert_eq!(pad().with_noise(0.0, 0.1).unwrap_err().field, "force_noise_n");
        assert_eq!(pad().with_noise(0.1, f64::NAN).unwrap_err().field, "torque_noise_nm");
    }
}
