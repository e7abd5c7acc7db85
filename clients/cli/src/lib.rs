//! The `palpate` program: a server, a simulated robot in front of it, and what compares methods.
//!
//! All of it uses the public side of its neighbours only: the service is `palpate-server`, the robot
//! `palpate-simulator`, and between the two is the wire, as between any robot and any server.

mod cli;
mod commands;
mod config_file;
mod failure;
mod limits;
mod log;
mod near;
mod probe;
mod progress;
mod terminal;
#[cfg(feature = "otel")]
mod traces;
mod version;
mod writable;

pub use cli::run;
