//! What a viewer draws of a revision: the surface in the paper's colours, and all that was seen and touched.

use std::collections::BTreeMap;

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{
    Color, PackedElementField, Point3, PointCloud, Pose, PoseInFrame, Quaternion, SceneEntity, SceneUpdate,
    Timestamp, TriangleListPrimitive, Vector3,
};
use palpate_core::evidence::Evidence;
use palpate_core::geometry::Point;
use palpate_core::reconstruction::Surface;
use palpate_proto::v1;

use crate::mesh_format::Colormap;
use crate::session::{Definition, Snapshot};

/// Bytes from one point of a cloud to the next: x, y, z, uncertainty, seq, touch.
const POINT_STRIDE: u32 = 21;

/// A time in microseconds since 1970, as far as viewers know times.
pub(super) fn timestamp(us: i64) -> Timestamp {
    let seconds = u32::try_from(us.div_euclid(1_000_000)).unwrap_or(0);
    let nanos = u32::try_from(us.rem_euclid(1_000_000) * 1000).unwrap_or(0);
    Timestamp::new_checked(seconds, nanos).unwrap_or(Timestamp::MAX)
}

/// The surface as triangles with a colour for each vertex.
pub(super) fn scene(surface: &Surface, frame_id: &str, at_us: i64) -> SceneUpdate {
    let Surface { mesh, uncertainty, std_m: _ } = surface;
    let point = |vertex: &Point| Point3 { x: vertex.x, y: vertex.y, z: vertex.z };
    let triangles = TriangleListPrimitive {
        pose: Some(pose(&v1::Pose::default())),
        points: mesh.vertices.iter().map(point).collect(),
        color: None,
        colors: uncertainty.iter().map(|&uncertainty| colour(uncertainty)).collect(),
        indices: mesh.faces.as_flattened().to_vec(),
    };
    let surface = SceneEntity {
        timestamp: Some(timestamp(at_us)),
        frame_id: frame_id.to_owned(),
        id: "surface".to_owned(),
        triangles: vec![triangles],
        ..SceneEntity::default()
    };
    SceneUpdate { deletions: Vec::new(), entities: vec![surface] }
}

fn colour(uncertainty: f64) -> Color {
    let [r, g, b] = Colormap::Paper.srgb(uncertainty);
    Color { r, g, b, a: 1.0 }
}

/// Where an attempt touched, as its caller was told: in metres, in the session's frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Touched {
    pub(super) points: Vec<v1::Vector3>,
    pub(super) uncertainty: f64,
}

/// The points of the views as they are in the estimate, and where the attempts that count touched, by their events.
pub(super) fn cloud(state: &Snapshot, touched: &BTreeMap<i64, Touched>) -> PointCloud {
    let Definition { frame_id, config, .. } = &*state.definition;
    let mut data = Vec::new();
    let mut add = |point: &Point, uncertainty: f64, seq: i64, is_touch: bool| {
        for value in [point.x, point.y, point.z, uncertainty] {
            data.extend((value as f32).to_le_bytes());
        }
        data.extend(u32::try_from(seq).unwrap_or(u32::MAX).to_le_bytes());
        data.push(u8::from(is_touch));
    };
    for (seq, evidence) in &state.evidence {
        match &**evidence {
            Evidence::VisualPrior(view) => {
                let uncertainty = view.uncertainty().unwrap_or(config.visual_uncertainty);
                view.points().iter().for_each(|point| add(point, uncertainty, *seq, false));
            }
            Evidence::Attempt(_) => {
                let Touched { points, uncertainty } = touched.get(seq).cloned().unwrap_or_default();
                let point = |place: v1::Vector3| Point::new(place.x, place.y, place.z);
                points.into_iter().for_each(|place| add(&point(place), uncertainty, *seq, true));
            }
            Evidence::Moved(_) => {}
        }
    }
    let field = |name: &str, offset: u32, kind: NumericType| PackedElementField {
        name: name.to_owned(),
        offset,
        r#type: kind.into(),
    };
    PointCloud {
        timestamp: Some(timestamp(state.updated_us)),
        frame_id: frame_id.clone(),
        pose: Some(pose(&v1::Pose::default())),
        point_stride: POINT_STRIDE,
        fields: vec![
            field("x", 0, NumericType::Float32),
            field("y", 4, NumericType::Float32),
            field("z", 8, NumericType::Float32),
            field("uncertainty", 12, NumericType::Float32),
            field("seq", 16, NumericType::Uint32),
            field("touch", 20, NumericType::Uint8),
        ],
        data: data.into(),
    }
}

/// Where the tool would be at the beginning of the next approach.
pub(super) fn next_pose(candidate: &v1::Candidate, frame_id: &str, at_us: i64) -> PoseInFrame {
    PoseInFrame {
        timestamp: Some(timestamp(at_us)),
        frame_id: frame_id.to_owned(),
        pose: candidate.tool_pose.as_ref().map(pose),
    }
}

/// The same pose; what is left out is the origin, and no rotation.
fn pose(pose: &v1::Pose) -> Pose {
    let v1::Vector3 { x, y, z } = pose.position.unwrap_or_default();
    let turn = pose.orientation.unwrap_or(v1::Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 });
    let v1::Quaternion { x: qx, y: qy, z: qz, w } = turn;
    Pose { position: Some(Vector3 { x, y, z }), orientation: Some(Quaternion { x: qx, y: qy, z: qz, w }) }
}
