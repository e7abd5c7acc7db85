//! Triangle meshes and what is asked of them: the shapes that every stage of the method shares.
//!
//! Points and vectors are `f64`, in metres, in the session's frame unless a name says otherwise.

mod boxes;
mod cloud;
mod connectivity;
mod face_tree;
mod geodesic;
mod icosphere;
mod mesh;
mod plane;
mod ring;
mod sampling;
mod surface_index;
mod surface_point;

pub use cloud::Cloud;
pub use connectivity::Connectivity;
pub use face_tree::FaceTree;
pub use geodesic::Geodesics;
pub use icosphere::{Icosphere, MAX_SUBDIVISIONS};
pub use mesh::TriangleMesh;
pub use plane::Plane;
pub use ring::Ring;
pub(crate) use sampling::{around, farthest_point_sampling};
pub use surface_index::{ClosestPoint, RayHit, SurfaceIndex};
pub use surface_point::SurfacePoint;

/// A point, in metres.
pub type Point = nalgebra::Point3<f64>;
/// A free vector.
pub type Vector = nalgebra::Vector3<f64>;
/// A direction of length one.
pub type Direction = nalgebra::Unit<Vector>;
/// A rigid motion, `target_from_source`.
pub type Pose = nalgebra::Isometry3<f64>;
