//! A bridge between ROS 2 and a Palpate server: clouds, depth images, wrenches and TF in; candidates, meshes and markers
//! out.
//!
//! It is a process of its own that speaks DDS to the robot and gRPC to the server. Reading goes from the outside in:
//! [`node`] and [`play`] bring messages, [`bridge`] makes orders of them, [`outbox`] keeps them and [`driver`] carries
//! them to the server. Only [`node`] knows of DDS.

pub mod approach;
pub mod attractors;
pub mod bridge;
pub mod candidates;
pub mod cloud;
pub mod contact_detector;
pub mod crop;
pub mod depth;
pub mod diagnostics;
pub mod driver;
pub mod markers;
pub mod messages;
pub mod names;
pub mod node;
pub mod outbox;
pub mod parameters;
pub mod play;
pub mod ros_args;
pub mod transforms;
