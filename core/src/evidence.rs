//! Evidence: what the robot has seen and felt, the ground state from which all else is derived.
//!
//! Takes clouds of visual points and the outcome of each approach, every value finite and well
//! formed once it is constructed, so that no later stage checks again. The [`ledger`] sorts them
//! into what the stages read: attractors, failures, and space that is known to be free.

mod attempt;
pub mod attractor;
mod check;
pub mod clutter;
mod crowding;
mod fit_evidence;
pub mod free_space;
pub mod ledger;
mod pad;
mod reading;
mod rejection;
mod surroundings;
mod tangent;
mod thinning;
mod visual_prior;
mod work_frame;
mod wrench;
mod wrench_check;

pub use attempt::{Attempt, Contact, ContactDetail, Moved, Outcome, Sweep, Target};
pub use check::MAX_COORDINATE_M;
pub(crate) use check::{check_direction, check_point};
pub(crate) use fit_evidence::FitEvidence;
pub use pad::{Pad, Pressure, TouchedPoint};
pub(crate) use reading::{DOUBTED, Reading, RigidOffset};
pub use rejection::{RejectReason, Rejection};
pub(crate) use thinning::thin_visual;
pub use visual_prior::VisualPrior;
pub(crate) use work_frame::WorkFrame;
pub use wrench::Wrench;

/// One piece of evidence; a session is a sequence of them.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "most evidence is attempts, the largest of them")]
pub enum Evidence {
    /// Points of a depth camera.
    VisualPrior(VisualPrior),
    /// What became of one approach of the probe.
    Attempt(Attempt),
    /// The object was moved.
    Moved(Moved),
}
