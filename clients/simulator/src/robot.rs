//! The robot's loop: look once, then touch where the server says, report, and again.
//!
//! ```text
//!   begin ── create session, add visual prior ──► first candidate
//!                                                     │
//!            ┌────────────────────────────────────────┘
//!            ▼
//!   step ── touch the candidate, report the outcome ──► next candidate ──► step ...
//!            │
//!            └── budget spent, should_stop, or no candidate left: finished
//! ```

use palpate_client::proto::v1::contact_result::Outcome as ReportedOutcome;
use palpate_client::proto::v1::{
    AddVisualPriorRequest, Candidate, Contact, ContactResult, CreateSessionRequest, GetMeshRequest,
    MeshFormat, NoContact, Pose as WirePose, Quaternion, ReportContactRequest, ReportContactResponse,
    RobotContext, Session, StopReason, Vector3, Wrench, mesh,
};
use palpate_client::{Client, Error as ClientError};
use palpate_core::geometry::{Point, Pose, TriangleMesh, Vector};

use crate::body::Body;
use crate::camera::Camera;
use crate::faults::Faults;
use crate::probe::{Approach, Outcome, ProbeSettings, Touch};
use crate::scene::Scene;

/// What a robot sets out to do.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// The session to create.
    pub session: CreateSessionRequest,
    /// Decides the view, the patch, the offsets on the pad and all noise.
    pub seed: u64,
    /// Attempts, failures included.
    pub attempts: u32,
    /// How much is seen before the first touch, and how well.
    pub camera: Camera,
    /// What is touched with, and what it measures.
    pub probe: ProbeSettings,
    /// What goes wrong.
    pub faults: Faults,
}

/// An approach that was made and is to be reported.
#[derive(Clone, Debug)]
pub struct Touched {
    outcome: Outcome,
    candidate: Candidate,
}

/// One attempt to touch and what the server made of it.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// Counts from 1, failures included.
    pub number: u32,
    /// How the approach ended.
    pub outcome: Outcome,
    /// Where the server wanted to be touched.
    pub candidate: Candidate,
    /// Mean uncertainty over the estimate's vertices after this attempt, in [0, 1].
    pub mean_uncertainty: f64,
    /// The session's revision after this attempt.
    pub revision: i64,
    /// What the server found odd about the report.
    pub warnings: Vec<String>,
    /// Why the server would stop now, if it would.
    pub should_stop: StopReason,
}

/// The estimated surface as the server sends it.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The surface, in metres.
    pub mesh: TriangleMesh,
    /// Standard deviation at each vertex, in metres; empty where the method states none.
    pub std_m: Vec<f64>,
}

/// Why an exploration ended before its time.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// The server refused a call or did not answer.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// A reply lacks a field that every server fills.
    #[error("the server's reply lacks {0}")]
    IncompleteReply(&'static str),
}

/// A robot in front of an object, connected to a server.
#[derive(Debug)]
pub struct Robot<'a> {
    client: Client,
    scene: Scene<'a>,
    sweep_radius_m: f64,
    attempts_left: u32,
    attempt: u32,
    session: Session,
    next: Option<Candidate>,
    view_warnings: Vec<String>,
    /// The faces of the last estimate and the tag under which the server knows them.
    topology: (String, Vec<[u32; 3]>),
}

impl<'a> Robot<'a> {
    /// Creates the session, looks at the object and gets the first candidate.
    ///
    /// # Errors
    /// [`RobotError`] if the server refuses or does not answer.
    pub async fn begin(client: Client, body: &'a Body, plan: Plan) -> Result<Self, RobotError> {
        let created = client.create_session(plan.session).await?;
        let scene = Scene::new(body, plan.probe, plan.faults, plan.seed);
        let view = scene.look(&plan.camera);
        let points: Vec<[f64; 3]> = view.points.iter().map(|&point| point.into()).collect();
        let prior = palpate_client::visual_prior(&points, Some(view.viewpoint.into()));
        let reply = client
            .add_visual_prior(AddVisualPriorRequest {
                session_id: created.session_id,
                prior: Some(prior),
                propose: 1,
                ..AddVisualPriorRequest::default()
            })
            .await?;
        Ok(Self {
            client,
            scene,
            sweep_radius_m: plan.probe.pad.sweep_radius_m(),
            attempts_left: plan.attempts,
            attempt: 0,
            session: reply.session.ok_or(RobotError::IncompleteReply("session"))?,
            next: reply.candidates.into_iter().next(),
            view_warnings: reply.warnings,
            topology: Default::default(),
        })
    }

    /// The session as of the last reply.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// What the server found odd about the view.
    pub fn view_warnings(&self) -> &[String] {
        &self.view_warnings
    }

    /// By what the object stands elsewhere than at the beginning, in metres, as of the last attempt.
    pub fn displacement(&self) -> Vector {
        self.scene.displacement()
    }

    /// Makes the next attempt; `None` when the exploration is finished.
    ///
    /// # Errors
    /// [`RobotError`] if the server refuses or does not answer.
    pub async fn step(&mut self) -> Result<Option<Attempt>, RobotError> {
        let Some((touched, report)) = self.touch()? else { return Ok(None) };
        let reply = self.client.report_contact(report).await?;
        self.accept(touched, reply).map(Some)
    }

    /// Makes the next approach, and says how it ended as it is to be reported; `None` when the exploration is finished.
    ///
    /// # Errors
    /// [`RobotError::IncompleteReply`] if the candidate does not say where to touch.
    pub fn touch(&mut self) -> Result<Option<(Touched, ReportContactRequest)>, RobotError> {
        if self.attempts_left == 0 || self.session.should_stop() != StopReason::Unspecified {
            return Ok(None);
        }
        let Some(candidate) = self.next.take() else {
            return Ok(None);
        };
        let approach = Approach {
            start: from_wire(candidate.probe_start).ok_or(RobotError::IncompleteReply("probe_start"))?,
            end: from_wire(candidate.probe_end).ok_or(RobotError::IncompleteReply("probe_end"))?,
        };
        let outcome = self.scene.touch(approach);
        let robot = RobotContext { tool_pose: ended_at(&outcome, &candidate), ..RobotContext::default() };
        let report = ReportContactRequest {
            session_id: self.session.session_id.clone(),
            result: Some(ContactResult {
                candidate_id: candidate.candidate_id.clone(),
                outcome: Some(reported(&outcome, approach, self.sweep_radius_m)),
                ..ContactResult::default()
            }),
            propose: 1,
            robot: Some(robot),
            ..ReportContactRequest::default()
        };
        Ok(Some((Touched { outcome, candidate }, report)))
    }

    /// Goes on with the reply to a report.
    ///
    /// # Errors
    /// [`RobotError::IncompleteReply`] if it lacks what every server fills.
    pub fn accept(&mut self, touched: Touched, reply: ReportContactResponse) -> Result<Attempt, RobotError> {
        let Touched { outcome, candidate } = touched;
        self.session = reply.session.ok_or(RobotError::IncompleteReply("session"))?;
        self.next = reply.candidates.into_iter().next();
        self.attempts_left -= 1;
        self.attempt += 1;
        let stats = self.session.stats.as_ref().ok_or(RobotError::IncompleteReply("session.stats"))?;
        Ok(Attempt {
            number: self.attempt,
            outcome,
            candidate,
            mean_uncertainty: stats.mean_uncertainty,
            revision: self.session.revision,
            warnings: reply.warnings,
            should_stop: self.session.should_stop(),
        })
    }

    /// The estimate at the session's revision.
    ///
    /// # Errors
    /// [`RobotError`] if the server refuses or does not answer.
    pub async fn estimate(&mut self) -> Result<Estimate, RobotError> {
        let reply = self
            .client
            .get_mesh(GetMeshRequest {
                session_id: self.session.session_id.clone(),
                revision: self.session.revision,
                format: MeshFormat::Raw.into(),
                have_topology: self.topology.0.clone(),
                ..GetMeshRequest::default()
            })
            .await?;
        let Some(mesh::Body::Raw(raw)) = reply.body else {
            return Err(RobotError::IncompleteReply("mesh.raw"));
        };
        let vertices = palpate_client::positions(&raw)?;
        let faces = palpate_client::faces(&raw)?;
        // Faces are left out when the topology has not changed.
        if !faces.is_empty() {
            self.topology = (raw.topology_etag.clone(), faces);
        }
        let std_m = palpate_client::std_m(&raw)?;
        Ok(Estimate {
            mesh: TriangleMesh {
                vertices: vertices.iter().map(|vertex| Point::from(vertex.map(f64::from))).collect(),
                faces: self.topology.1.clone(),
            },
            std_m: std_m.into_iter().map(f64::from).collect(),
        })
    }

    /// The estimate at the session's revision as a PLY file.
    ///
    /// # Errors
    /// [`RobotError`] if the server refuses or does not answer.
    pub async fn ply(&self) -> Result<Vec<u8>, RobotError> {
        let reply = self
            .client
            .get_mesh(GetMeshRequest {
                session_id: self.session.session_id.clone(),
                revision: self.session.revision,
                format: MeshFormat::Ply.into(),
                ..GetMeshRequest::default()
            })
            .await?;
        match reply.body {
            Some(mesh::Body::File(file)) => Ok(file.into()),
            _ => Err(RobotError::IncompleteReply("mesh.file")),
        }
    }
}

fn reported(outcome: &Outcome, approach: Approach, sweep_radius_m: f64) -> ReportedOutcome {
    match outcome.contact() {
        Some(touch) => ReportedOutcome::Contact(contact(touch)),
        None => ReportedOutcome::NoContact(NoContact {
            swept_from: Some(to_wire(&approach.start.coords)),
            swept_to: Some(to_wire(&approach.end.coords)),
            sweep_radius_m,
        }),
    }
}

/// Where the tool stands after an approach, its pad being its origin.
fn ended_at(outcome: &Outcome, candidate: &Candidate) -> Option<WirePose> {
    match outcome.contact() {
        Some(touch) => Some(pose(&touch.base_from_sensor)),
        None => candidate.tool_pose.map(|tool| WirePose { position: candidate.probe_end, ..tool }),
    }
}

fn contact(touch: &Touch) -> Contact {
    Contact {
        sensor_pose: Some(pose(&touch.base_from_sensor)),
        wrench: Some(Wrench {
            force: Some(to_wire(&touch.force_n)),
            torque: Some(to_wire(&touch.torque_nm)),
        }),
        swept_from: Some(to_wire(&touch.swept_from.coords)),
        normal: touch.normal.map(|normal| to_wire(&normal)),
        ..Contact::default()
    }
}

fn pose(pose: &Pose) -> WirePose {
    let rotation = pose.rotation.coords;
    WirePose {
        position: Some(to_wire(&pose.translation.vector)),
        orientation: Some(Quaternion { x: rotation.x, y: rotation.y, z: rotation.z, w: rotation.w }),
    }
}

fn to_wire(vector: &Vector) -> Vector3 {
    Vector3 { x: vector.x, y: vector.y, z: vector.z }
}

fn from_wire(vector: Option<Vector3>) -> Option<Point> {
    vector.map(|vector| Point::new(vector.x, vector.y, vector.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe::{PAD_HALF_SIDE_M, Probe};
    use crate::shapes;

    fn approach_to_ball(x: f64) -> Approach {
        Approach { start: Point::new(x + 0.015, 0.0, 0.0), end: Point::new(x - 0.015, 0.0, 0.0) }
    }

    #[test]
    fn a_hit_is_reported_where_it_happened_with_a_pressing_wrench() {
        let body = shapes::generate("ball").unwrap();
        let approach = approach_to_ball(0.06);
        let outcome = Probe::new(ProbeSettings::default(), 1).touch(&body, approach);
        let ReportedOutcome::Contact(contact) = reported(&outcome, approach, 0.0) else {
            panic!("a contact")
        };
        let position = from_wire(contact.sensor_pose.and_then(|pose| pose.position)).unwrap();
        assert!((position.x - 0.064).abs() < 2e-4);
        assert_eq!(contact.wrench.and_then(|wrench| wrench.force).unwrap().z, -5.0);
        assert_eq!(from_wire(contact.swept_from).unwrap(), approach.start);
        assert!(contact.normal.is_none());
    }

    #[test]
    fn an_early_contact_is_a_contact_too_and_a_miss_is_free_space() {
        let body = shapes::generate("ball").unwrap();
        let mut probe = Probe::new(ProbeSettings::default(), 1);
        let early = probe.touch(&body, approach_to_ball(0.03));
        assert!(matches!(reported(&early, approach_to_ball(0.03), 0.0), ReportedOutcome::Contact(_)));
        let approach = approach_to_ball(0.1);
        let miss = probe.touch(&body, approach);
        let ReportedOutcome::NoContact(free) = reported(&miss, approach, PAD_HALF_SIDE_M) else {
            panic!("free space")
        };
        assert_eq!(from_wire(free.swept_from).unwrap(), approach.start);
        assert_eq!(from_wire(free.swept_to).unwrap(), approach.end);
        assert_eq!(free.sweep_radius_m, PAD_HALF_SIDE_M);
    }
}
