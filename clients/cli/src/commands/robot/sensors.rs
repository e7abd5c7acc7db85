//! Arguments that say what the robot measures and what it touches with.

use clap::ValueEnum;
use palpate_simulator::camera::Camera;
use palpate_simulator::probe::{Pad, ProbeSettings};

use super::faults::FaultArgs;

/// What the robot touches with; the words of [`Pad`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PadArg {
    /// A point that reports where it touched: the paper's protocol
    Point,
    /// A square of 18 mm that reports where its centre is, beside the touched point, and force and torque
    Flat,
}

/// What the robot measures, and how badly; exactly, unless told otherwise.
#[derive(Clone, Copy, Debug, clap::Args)]
#[command(next_help_heading = "Sensors")]
pub(in crate::commands) struct SensorArgs {
    /// What the robot touches with.
    #[arg(long, value_enum, default_value = "point")]
    pad: PadArg,

    /// How much the camera sees, as a share of the object's whole surface; it never sees the far side.
    #[arg(long, value_name = "SHARE", default_value_t = Camera::default().patch_share, value_parser = share)]
    patch: f64,

    /// Standard deviation of the depth camera along its rays.
    #[arg(long, value_name = "MM", default_value_t = 0.0, value_parser = not_negative)]
    depth_noise_mm: f64,

    /// Standard deviation of the touched position along each axis.
    #[arg(long, value_name = "MM", default_value_t = 0.0, value_parser = not_negative)]
    tactile_noise_mm: f64,

    /// Measure the normal of the touched surface too, and report it with every contact.
    #[arg(long)]
    measured_normals: bool,

    /// Standard deviation of a measured normal about each of its two tangents.
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = 5.0,
        value_parser = not_negative,
        requires = "measured_normals"
    )]
    normal_noise_deg: f64,

    #[command(flatten)]
    pub(in crate::commands) faults: FaultArgs,
}

impl SensorArgs {
    /// What is seen before the first touch.
    pub(super) fn camera(&self) -> Camera {
        Camera { patch_share: self.patch, depth_noise_m: self.depth_noise_mm * 1e-3 }
    }

    /// What is touched with.
    pub(super) fn probe(&self) -> ProbeSettings {
        ProbeSettings {
            pad: match self.pad {
                PadArg::Point => Pad::Point,
                PadArg::Flat => Pad::Flat,
            },
            tactile_noise_m: self.tactile_noise_mm * 1e-3,
            measures_normals: self.measured_normals,
            normal_noise_rad: self.normal_noise_deg.to_radians(),
        }
    }
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=1.0).contains(&value) => Ok(value),
        _ => Err("must be between 0.01 and 1".to_owned()),
    }
}

pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("must be a number, at least 0".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_or_a_patch_that_cannot_be_is_refused() {
        assert!(not_negative("-1").is_err() && not_negative("nan").is_err() && not_negative("x").is_err());
        assert_eq!(not_negative("1.5"), Ok(1.5));
        assert!(share("0").is_err() && share("12").is_err() && share("nan").is_err());
        assert_eq!(share("0.3"), Ok(0.3));
    }

    #[test]
    fn the_robot_touches_with_a_point_unless_told_otherwise() {
        #[derive(clap::Parser)]
        struct Program {
            #[command(flatten)]
            sensors: SensorArgs,
        }
        let pad = |args: &[&str]| {
            let program = <Program as clap::Parser>::try_parse_from([&["palpate"], args].concat());
            program.map(|program| program.sensors.probe().pad)
        };
        assert_eq!(pad(&[]).unwrap(), Pad::Point);
        assert_eq!(pad(&["--pad", "flat"]).unwrap(), Pad::Flat);
        assert!(pad(&["--pad", "round"]).unwrap_err().to_string().contains("point, flat"));
    }
}
