//! Shape reconstruction from touch: the method, as pure functions of its evidence.
//!
//! A robot sees a small patch of an unknown object and touches the rest. [`reconstruction`] is the
//! whole method on one page; every idea that it calls is a module of that idea's name. The method
//! is that of Oikonomou, Retsinas, Maragos and Tzafestas, "Proactive tactile exploration for
//! object-agnostic shape reconstruction from minimal visual priors"; sections and equations cited
//! here are the paper's.
//!
//! Nothing here does IO, reads a clock, logs, waits or draws randomness that is not in the
//! configuration. Lengths are in metres, numbers are `f64` (covariances within the process `f32`), and
//! points are in the session's frame where they come in
//! and go out, and in between in the frame that the method works in.

mod arithmetic;
pub mod config;
pub mod error;
pub mod evidence;
pub mod exploration;
mod fingerprint;
pub mod geometry;
mod implicit;
pub mod local;
pub mod mesh_file;
pub mod method;
pub mod metrics;
pub mod reconstruction;
pub mod schedule;
pub mod symmetry;
pub mod template;
pub mod uncertainty;
mod vectorised;
pub mod warning;
