//! The messages of ROS 2 that the bridge speaks, field by field as their definitions have them.
//!
//! CDR knows no field names: the order here is the wire format. Units and frames are those of the definitions, REP 103
//! and REP 118. [`RosMessage`] says what a message is called, for topics and for recordings.

#![expect(missing_docs, reason = "what a field means is said by the definition of the same name")]

mod display;
mod geometry;
mod palpate;
mod sensor;

use serde::Serialize;
use serde::de::DeserializeOwned;

pub use display::{
    ColorRgba, DiagnosticArray, DiagnosticStatus, Duration, KeyValue, Marker, MarkerTexture, Mesh, MeshFile,
    MeshTriangle, UvCoordinate,
};
pub use geometry::{
    Header, Point, Pose, PoseArray, PoseStamped, Quaternion, TfMessage, Time, Transform, TransformStamped,
    Vector3, Wrench, WrenchStamped,
};
pub use palpate::{
    Candidate, Candidates, Contact, CreateSessionRequest, CreateSessionResponse, FinishRequest,
    FinishResponse, ProposeRequest, ProposeResponse, RejectRequest, RejectResponse, TriggerRequest,
    TriggerResponse, kind, no_candidate,
};
pub use sensor::{CameraInfo, Image, PointCloud2, PointField, RegionOfInterest, datatype};

/// A message that travels on a topic.
pub trait RosMessage: Serialize + DeserializeOwned + Send + Sync + 'static {
    /// The package that defines it.
    const PACKAGE: &'static str;
    /// Its name in that package.
    const NAME: &'static str;

    /// The whole name as recordings have it: `package/msg/Name`.
    fn full_name() -> String {
        format!("{}/msg/{}", Self::PACKAGE, Self::NAME)
    }
}

/// Names a message by its package and its own name.
macro_rules! named {
    ($($message:ty = $package:literal / $name:literal),+ $(,)?) => {$(
        impl RosMessage for $message {
            const PACKAGE: &'static str = $package;
            const NAME: &'static str = $name;
        }
    )+};
}

named! {
    CameraInfo = "sensor_msgs" / "CameraInfo",
    Candidates = "palpate_msgs" / "Candidates",
    Contact = "palpate_msgs" / "Contact",
    DiagnosticArray = "diagnostic_msgs" / "DiagnosticArray",
    Image = "sensor_msgs" / "Image",
    Marker = "visualization_msgs" / "Marker",
    Mesh = "shape_msgs" / "Mesh",
    PointCloud2 = "sensor_msgs" / "PointCloud2",
    PoseArray = "geometry_msgs" / "PoseArray",
    PoseStamped = "geometry_msgs" / "PoseStamped",
    TfMessage = "tf2_msgs" / "TFMessage",
    WrenchStamped = "geometry_msgs" / "WrenchStamped",
}

/// A frame's name without the leading slash that ROS 1 had and some drivers still send.
pub fn frame(name: &str) -> &str {
    name.strip_prefix('/').unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use cdr_encoding::{from_bytes, to_vec};

    use super::*;

    type LittleEndian = byteorder::LittleEndian;

    #[test]
    fn a_stamped_wrench_is_on_the_wire_as_its_definition_says() {
        let wrench = WrenchStamped {
            header: Header { stamp: Time { sec: 1, nanosec: 2 }, frame_id: "pad".to_owned() },
            wrench: Wrench {
                force: Vector3 { x: 0.0, y: 0.0, z: -2.0 },
                torque: Vector3 { x: 0.0, y: 0.0, z: 0.5 },
            },
        };
        let bytes = to_vec::<_, LittleEndian>(&wrench).unwrap();
        // Stamp, length with its zero, "pad\0", six doubles from a multiple of eight on.
        assert_eq!(bytes[..16], [1, 0, 0, 0, 2, 0, 0, 0, 4, 0, 0, 0, b'p', b'a', b'd', 0]);
        assert_eq!(bytes[32..40], (-2.0_f64).to_le_bytes());
        assert_eq!(bytes.len(), 16 + 48);
        let (read, _): (WrenchStamped, usize) = from_bytes::<_, LittleEndian>(&bytes).unwrap();
        assert_eq!(read, wrench);
    }

    #[test]
    fn bytes_of_a_cloud_are_a_sequence_of_octets() {
        let cloud = PointCloud2 { data: vec![7, 8, 9], ..PointCloud2::default() };
        let bytes = to_vec::<_, LittleEndian>(&cloud).unwrap();
        assert_eq!(bytes[bytes.len() - 8..], [3, 0, 0, 0, 7, 8, 9, 0]);
        let (read, _): (PointCloud2, usize) = from_bytes::<_, LittleEndian>(&bytes).unwrap();
        assert_eq!(read, cloud);
    }

    #[test]
    fn leading_slashes_of_frames_are_taken_off() {
        assert_eq!((frame("/base"), frame("base"), frame("")), ("base", "base", ""));
    }
}
