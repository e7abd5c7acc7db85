//! The ball of the samples as a robot meets it: contacts at its true surface, wherever they are aimed.

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;
use palpate_proto::v1::mesh::Body;

use super::{Caller, cloud, creation, prior, report, result};

/// Centre and radius of the ball, in metres.
pub(crate) const CENTRE: [f64; 3] = [0.0, 0.0, 0.3];
pub(crate) const RADIUS_M: f64 = 0.05;

pub(crate) fn xyz(v: v1::Vector3) -> [f64; 3] {
    [v.x, v.y, v.z]
}

pub(crate) fn vector([x, y, z]: [f64; 3]) -> v1::Vector3 {
    v1::Vector3 { x, y, z }
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    let off = [0, 1, 2].map(|k| a[k] - b[k]);
    dot(off, off).sqrt()
}

/// A vector turned by a unit quaternion: v + 2 w (q x v) + 2 q x (q x v).
pub(crate) fn rotated(q: &v1::Quaternion, v: [f64; 3]) -> [f64; 3] {
    let axis = [q.x, q.y, q.z];
    let once = cross(axis, v);
    let twice = cross(axis, once);
    [0, 1, 2].map(|k| v[k] + 2.0 * (q.w * once[k] + twice[k]))
}

/// The smallest turn that takes z against a direction.
fn facing(direction: [f64; 3]) -> v1::Quaternion {
    let into = direction.map(|x| -x);
    let axis = cross([0.0, 0.0, 1.0], into);
    let w = 1.0 + into[2];
    let norm = (dot(axis, axis) + w * w).sqrt();
    if norm < 1e-9 {
        return v1::Quaternion { x: 1.0, y: 0.0, z: 0.0, w: 0.0 };
    }
    let [x, y, z] = axis.map(|x| x / norm);
    v1::Quaternion { x, y, z, w: w / norm }
}

/// What a sensor shows that is pushed with `force` at `offset` on its pad.
pub(crate) fn pushed(force: [f64; 3], offset: [f64; 3]) -> v1::Wrench {
    v1::Wrench { force: Some(vector(force)), torque: Some(vector(cross(offset, force))) }
}

/// A push of 5 N with a little friction, near the middle of the pad, another each time.
pub(crate) fn plausible(number: usize) -> v1::Wrench {
    let turn = 2.4 * number as f64;
    let (x, y) = (turn.cos(), turn.sin());
    pushed([0.4 * y, -0.4 * x, -5.0], [0.0003 * x, 0.0003 * y, 0.0])
}

/// `count` unit vectors, spread evenly.
pub(crate) fn directions(count: usize) -> Vec<[f64; 3]> {
    let direction = |number: usize| {
        let (around, up) = (2.4 * number as f64, 1.0 - (2 * number + 1) as f64 / count as f64);
        let across = (1.0 - up * up).sqrt();
        [across * around.cos(), across * around.sin(), up]
    };
    (0..count).map(direction).collect()
}

/// Where the ball's surface is in a direction, or `off_m` outside of it.
pub(crate) fn place(direction: [f64; 3], off_m: f64) -> [f64; 3] {
    [0, 1, 2].map(|k| CENTRE[k] + direction[k] * (RADIUS_M + off_m))
}

/// A contact of the robot's own choice in a direction from the ball's centre, `off_m` outside of its surface.
pub(crate) fn contact_at(direction: [f64; 3], off_m: f64, wrench: v1::Wrench) -> v1::ContactResult {
    let pose =
        v1::Pose { position: Some(vector(place(direction, off_m))), orientation: Some(facing(direction)) };
    let contact = v1::Contact { sensor_pose: Some(pose), wrench: Some(wrench), ..Default::default() };
    v1::ContactResult { outcome: Some(ContactOutcome::Contact(contact)), ..Default::default() }
}

/// What becomes of a candidate at the ball about `centre`: a contact at its true surface, or a miss.
pub(crate) fn met(candidate: &v1::Candidate, centre: [f64; 3], wrench: v1::Wrench) -> v1::ContactResult {
    let (from, to) = (xyz(candidate.probe_start.unwrap()), xyz(candidate.probe_end.unwrap()));
    let (way, back) = ([0, 1, 2].map(|k| to[k] - from[k]), [0, 1, 2].map(|k| from[k] - centre[k]));
    let (a, b, c) = (dot(way, way), dot(back, way), dot(back, back) - RADIUS_M * RADIUS_M);
    let share = (-b - (b * b - a * c).max(0.0).sqrt()) / a;
    if b * b < a * c || share > 1.0 {
        return super::miss(candidate);
    }
    let pose = v1::Pose {
        position: Some(vector([0, 1, 2].map(|k| from[k] + share * way[k]))),
        orientation: candidate.tool_pose.unwrap().orientation,
    };
    let contact = v1::Contact {
        sensor_pose: Some(pose),
        wrench: Some(wrench),
        swept_from: candidate.probe_start,
        ..Default::default()
    };
    result(candidate, ContactOutcome::Contact(contact))
}

/// The same report with its contact changed.
pub(crate) fn with_contact(
    mut said: v1::ContactResult,
    change: impl FnOnce(&mut v1::Contact),
) -> v1::ContactResult {
    if let Some(ContactOutcome::Contact(contact)) = &mut said.outcome {
        change(contact);
    }
    said
}

/// The kinds of some warnings, which say the same as the sentences beside them.
pub(crate) fn kinds(sentences: &[String], details: &[v1::Warning]) -> Vec<v1::WarningCode> {
    let messages: Vec<&String> = details.iter().map(|warning| &warning.message).collect();
    assert_eq!(messages, sentences.iter().collect::<Vec<_>>());
    details.iter().map(v1::Warning::code).collect()
}

impl Caller {
    /// Creates a session with a coarse mesh and a configuration, and shows it the ball.
    pub(crate) async fn begin_coarse(&self, session_id: &str, config: v1::SessionConfig) -> v1::Candidate {
        let config = v1::SessionConfig { icosphere_subdivisions: Some(3), ..config };
        self.create(v1::CreateSessionRequest { config: Some(config), ..creation(session_id) }).await.unwrap();
        self.add_prior(prior(session_id)).await.unwrap().candidates.remove(0)
    }

    /// Reports, and asks for the next candidate.
    pub(crate) async fn tell(
        &self,
        session_id: &str,
        said: v1::ContactResult,
        request_id: &str,
    ) -> v1::ReportContactResponse {
        self.report(report(session_id, said, request_id)).await.unwrap()
    }

    /// The newest mesh, its vertices in metres.
    pub(crate) async fn vertices(&self, session_id: &str) -> (v1::Mesh, Vec<[f64; 3]>) {
        let request = v1::GetMeshRequest { session_id: session_id.into(), ..Default::default() };
        let mesh = self.mesh(request).await.unwrap();
        let Some(Body::Raw(raw)) = &mesh.body else { panic!("{mesh:?}") };
        let vertices = palpate_client::positions(raw).unwrap();
        let vertices = vertices.iter().map(|vertex| vertex.map(f64::from)).collect();
        (mesh, vertices)
    }
}

/// The cap of the ball with more points.
pub(crate) fn cap_with(more: &[[f32; 3]]) -> v1::VisualPrior {
    let seen = super::cap();
    let points = [seen.points.to_vec(), cloud(more).points.to_vec()].concat();
    v1::VisualPrior { points: points.into(), ..seen }
}
