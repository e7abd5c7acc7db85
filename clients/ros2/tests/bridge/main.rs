//! The bridge against a real server inside of the test: recordings, a server that goes away, services over DDS.
//!
//! `.ci/ros2` does the rest against an independent DDS, with a process that is killed.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed, and says where")]

mod harness;
mod recordings;
mod robot;
mod server_away;
mod services;
