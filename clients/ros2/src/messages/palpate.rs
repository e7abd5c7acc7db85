//! `palpate_msgs`, whose definitions are in this package's folder of the same name, and `std_srvs/Trigger`.

use ros2_client::Message;
use serde::{Deserialize, Serialize};

use super::{Header, Point, Pose, Vector3, Wrench};

/// Values of [`Contact::kind`].
pub mod kind {
    pub const CONTACT: u8 = 0;
    pub const NO_CONTACT: u8 = 1;
    pub const INVALID: u8 = 2;
}

/// The [`Contact::candidate_id`] of a contact that the robot chose itself.
pub mod no_candidate {
    pub const NAME: &str = "none";
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    pub header: Header,
    pub kind: u8,
    pub candidate_id: String,
    pub sensor_id: String,
    pub has_pose: bool,
    pub pose: Pose,
    pub has_wrench: bool,
    pub wrench: Wrench,
    pub rest_wrench: Wrench,
    pub has_sweep: bool,
    pub swept_from: Point,
    pub swept_to: Point,
    pub sweep_radius_m: f64,
    pub has_normal: bool,
    pub normal: Vector3,
    pub has_uncertainty: bool,
    pub uncertainty: f64,
    pub detail: String,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    pub candidate_id: String,
    pub sensor_id: String,
    pub point: Point,
    pub normal: Vector3,
    pub probe_start: Point,
    pub probe_end: Point,
    pub tool_pose: Pose,
    pub score: f64,
    pub uncertainty: f64,
    pub std_m: f64,
    pub failure_risk: f64,
    pub why: String,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Candidates {
    pub header: Header,
    pub session_id: String,
    pub revision: i64,
    pub should_stop: String,
    pub candidates: Vec<Candidate>,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CreateSessionRequest {
    pub session_id: String,
    pub display_name: String,
    pub experiment: String,
    pub config: String,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CreateSessionResponse {
    pub success: bool,
    pub message: String,
    pub session_id: String,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProposeRequest {
    pub top_k: u32,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProposeResponse {
    pub success: bool,
    pub message: String,
    pub revision: i64,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RejectRequest {
    pub candidate_id: String,
    pub reason: u8,
    pub detail: String,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RejectResponse {
    pub success: bool,
    pub message: String,
    pub revision: i64,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FinishRequest {
    pub note: String,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FinishResponse {
    pub success: bool,
    pub message: String,
}

/// `std_srvs/Trigger` asks nothing; ROS puts one octet into what would be empty.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriggerRequest {
    pub structure_needs_at_least_one_member: u8,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriggerResponse {
    pub success: bool,
    pub message: String,
}

impl Message for CreateSessionRequest {}
impl Message for CreateSessionResponse {}
impl Message for ProposeRequest {}
impl Message for ProposeResponse {}
impl Message for RejectRequest {}
impl Message for RejectResponse {}
impl Message for FinishRequest {}
impl Message for FinishResponse {}
impl Message for TriggerRequest {}
impl Message for TriggerResponse {}
