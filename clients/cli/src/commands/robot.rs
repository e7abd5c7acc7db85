//! The simulated robot on the command line: what `demo`, `explore` and `evaluate` share.

mod args;
mod driver;
mod faults;
mod local_server;
mod measured;
mod names;
mod sensors;
mod warnings;

pub(super) use self::args::{ObjectArgs, SessionArgs, attempts, plan};
pub(super) use self::driver::{Exploration, drive, save_ply};
pub(super) use self::local_server::LocalServer;
pub(super) use self::measured::{MeasuredRobot, outcome_name};
pub(super) use self::names::{name_of, parser};
pub(super) use self::sensors::SensorArgs;
