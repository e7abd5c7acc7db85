//! `builtin_interfaces`, `std_msgs`, `geometry_msgs` and `tf2_msgs`.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use palpate_client::proto::{Timestamp, v1};
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Time {
    pub sec: i32,
    pub nanosec: u32,
}

impl Time {
    /// Nanoseconds since the epoch of the clock that stamped it.
    pub fn as_ns(self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }

    /// The same time from nanoseconds; what does not fit into 32-bit seconds is cut.
    pub fn from_ns(ns: i64) -> Self {
        let sec = ns.div_euclid(1_000_000_000).clamp(i64::from(i32::MIN), i64::from(i32::MAX));
        Self { sec: sec as i32, nanosec: ns.rem_euclid(1_000_000_000) as u32 }
    }

    pub(crate) fn to_proto(self) -> Timestamp {
        Timestamp { seconds: self.sec.into(), nanos: self.nanosec.min(999_999_999) as i32 }
    }
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    pub stamp: Time,
    pub frame_id: String,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

impl Vector3 {
    pub(crate) fn to_array(self) -> [f64; 3] {
        [self.x, self.y, self.z]
    }

    pub(crate) fn from_array([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }

    pub(crate) fn to_proto(self) -> v1::Vector3 {
        v1::Vector3 { x: self.x, y: self.y, z: self.z }
    }
}

/// A point is a vector on the wire, and here.
pub type Point = Vector3;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    pub position: Point,
    pub orientation: Quaternion,
}

impl Pose {
    /// The rigid transform, or `None` where a number is none or the quaternion is no rotation.
    pub fn to_isometry(self) -> Option<Isometry3<f64>> {
        let Self { position: p, orientation: q } = self;
        let quaternion = nalgebra::Quaternion::new(q.w, q.x, q.y, q.z);
        let is_sound = p.to_array().iter().all(|part| part.is_finite())
            && (quaternion.norm() - 1.0).abs() < QUATERNION_TOLERANCE;
        is_sound.then(|| {
            Isometry3::from_parts(
                Translation3::new(p.x, p.y, p.z),
                UnitQuaternion::from_quaternion(quaternion),
            )
        })
    }

    pub fn from_isometry(isometry: &Isometry3<f64>) -> Self {
        let (p, q) = (isometry.translation.vector, isometry.rotation.quaternion());
        Self {
            position: Point { x: p.x, y: p.y, z: p.z },
            orientation: Quaternion { x: q.i, y: q.j, z: q.k, w: q.w },
        }
    }

    pub(crate) fn to_proto(self) -> v1::Pose {
        let Quaternion { x, y, z, w } = self.orientation;
        v1::Pose {
            position: Some(self.position.to_proto()),
            orientation: Some(v1::Quaternion { x, y, z, w }),
        }
    }

    pub(crate) fn from_proto(pose: &v1::Pose) -> Self {
        let p = pose.position.unwrap_or_default();
        let q = pose.orientation.unwrap_or(v1::Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 });
        Self {
            position: Point { x: p.x, y: p.y, z: p.z },
            orientation: Quaternion { x: q.x, y: q.y, z: q.z, w: q.w },
        }
    }
}

/// How far the norm of a quaternion may be from one; drivers round to single precision, and what is zero is none.
const QUATERNION_TOLERANCE: f64 = 1e-3;

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    pub header: Header,
    pub pose: Pose,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseArray {
    pub header: Header,
    pub poses: Vec<Pose>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    pub force: Vector3,
    pub torque: Vector3,
}

impl Wrench {
    pub(crate) fn to_array(self) -> [f64; 6] {
        let ([fx, fy, fz], [tx, ty, tz]) = (self.force.to_array(), self.torque.to_array());
        [fx, fy, fz, tx, ty, tz]
    }

    pub(crate) fn from_array([fx, fy, fz, tx, ty, tz]: [f64; 6]) -> Self {
        Self { force: Vector3::from_array([fx, fy, fz]), torque: Vector3::from_array([tx, ty, tz]) }
    }

    pub(crate) fn to_proto(self) -> v1::Wrench {
        v1::Wrench { force: Some(self.force.to_proto()), torque: Some(self.torque.to_proto()) }
    }
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct WrenchStamped {
    pub header: Header,
    pub wrench: Wrench,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    pub translation: Vector3,
    pub rotation: Quaternion,
}

/// The pose of `child_frame_id` in `header.frame_id`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Transform,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TfMessage {
    pub transforms: Vec<TransformStamped>,
}
