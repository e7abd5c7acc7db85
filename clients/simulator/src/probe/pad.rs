//! What the probe touches with.

use super::PAD_HALF_SIDE_M;

/// The face that meets the object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pad {
    /// A point that reports where it touched, as the paper's protocol has it; a random offset on a pad
    /// shows in the torque only.
    #[default]
    Point,
    /// A rigid square face of half side [`PAD_HALF_SIDE_M`] that reports where its own centre is.
    Flat,
}

impl Pad {
    /// Radius of what an approach without contact has found free around its line, in metres: the disc
    /// within the face.
    pub fn sweep_radius_m(self) -> f64 {
        match self {
            Self::Point => 0.0,
            Self::Flat => PAD_HALF_SIDE_M,
        }
    }
}
