//! The simulated robot on the command line: what `demo`, `explore` and `evaluate` share.

mod args;
mod driver;
mod local_server;

pub(super) use self::args::{
    MethodName, NoiseArgs, ObjectArgs, SessionArgs, StrategyName, SymmetryName, name_of, plan,
};
pub(super) use self::driver::{drive, outcome_name, save_ply};
pub(super) use self::local_server::LocalServer;
