//! What a robot sends: a camera above a ball, an arm whose pad looks down, and a sensor behind the pad.

use palpate_ros2::messages::{
    Header, PointCloud2, PointField, Quaternion, TfMessage, Time, Transform, TransformStamped, Vector3,
    Wrench, WrenchStamped, datatype,
};

/// The ball's centre and radius, in m, in the frame `base`.
pub(crate) const CENTER: [f64; 3] = [0.5, 0.0, 0.1];
pub(crate) const RADIUS: f64 = 0.04;

pub(crate) const MS: i64 = 1_000_000;

pub(crate) fn header(frame: &str, stamp_ns: i64) -> Header {
    Header { stamp: Time::from_ns(stamp_ns), frame_id: frame.to_owned() }
}

/// A frame that looks down: z is down, x stays.
fn looking_down(parent: &str, child: &str, stamp_ns: i64, [x, y, z]: [f64; 3]) -> TransformStamped {
    TransformStamped {
        header: header(parent, stamp_ns),
        child_frame_id: child.to_owned(),
        transform: Transform {
            translation: Vector3 { x, y, z },
            rotation: Quaternion { x: 1.0, y: 0.0, z: 0.0, w: 0.0 },
        },
    }
}

/// The camera half a metre above the ball.
pub(crate) fn camera() -> TfMessage {
    TfMessage { transforms: vec![looking_down("base", "camera", 0, [0.5, 0.0, 0.6])] }
}

/// The pad at a height above the ball's centre.
pub(crate) fn pad(stamp_ns: i64, above_m: f64) -> TfMessage {
    let at = [CENTER[0], CENTER[1], CENTER[2] + above_m];
    TfMessage { transforms: vec![looking_down("base", "pad", stamp_ns, at)] }
}

/// The upper side of the ball as the camera sees it, in the camera's frame.
pub(crate) fn cloud(stamp_ns: i64) -> PointCloud2 {
    let mut data = Vec::new();
    for row in -9..=9_i32 {
        for column in -9..=9_i32 {
            let (x, y) = (f64::from(column) * 0.004, f64::from(row) * 0.004);
            let inside = RADIUS * RADIUS - x * x - y * y;
            if inside > 1e-5 {
                let point = [x as f32, y as f32, (0.5 - inside.sqrt()) as f32];
                data.extend(point.into_iter().flat_map(f32::to_le_bytes));
            }
        }
    }
    let width = data.len() as u32 / 12;
    let field = |(at, name): (u32, &str)| PointField {
        name: name.to_owned(),
        offset: 4 * at,
        datatype: datatype::FLOAT32,
        count: 1,
    };
    PointCloud2 {
        header: header("camera", stamp_ns),
        height: 1,
        width,
        fields: (0..).zip(["x", "y", "z"]).map(field).collect(),
        point_step: 12,
        row_step: 12 * width,
        data,
        ..PointCloud2::default()
    }
}

/// What the sensor shows: its weight, and the pad's load.
pub(crate) fn wrench(stamp_ns: i64, load_n: f64) -> WrenchStamped {
    let force = Vector3 { x: 0.0, y: 0.2, z: 1.5 - load_n };
    WrenchStamped { header: header("pad", stamp_ns), wrench: Wrench { force, torque: Vector3::default() } }
}
