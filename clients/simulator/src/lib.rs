//! A simulated robot: an object made of triangles, a depth camera and a probe that touches.
//!
//! It stands in for the real thing in the demo, the evaluation and the tests. The server knows
//! nothing of it: everything travels over gRPC, as it would from a robot. For studies of the method
//! it also explores [in process](in_process).

pub mod body;
pub mod camera;
pub mod faults;
pub mod in_process;
pub mod mesh_file;
pub mod objects;
pub mod parallel;
pub mod probe;
mod random;
pub mod robot;
pub mod scene;
pub mod shapes;
