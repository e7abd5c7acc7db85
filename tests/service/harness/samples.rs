//! Something to say: a session about a ball of 50 mm radius, seen from one side, and what a robot may report of it.

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;

use super::Caller;

/// A session by this name, with the defaults; a request id makes one session, so each has its own.
pub(crate) fn creation(session_id: &str) -> v1::CreateSessionRequest {
    v1::CreateSessionRequest {
        session_id: session_id.into(),
        request_id: format!("create-{session_id}"),
        ..Default::default()
    }
}

/// Points in metres, packed.
pub(crate) fn cloud(points: &[[f32; 3]]) -> v1::VisualPrior {
    v1::VisualPrior {
        encoding: v1::PointEncoding::XyzF32Le.into(),
        points: points.iter().flatten().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>().into(),
        viewpoint: Some(v1::Vector3 { x: 1.0, y: 0.0, z: 0.3 }),
        ..Default::default()
    }
}

/// The cap of the ball about (0, 0, 0.3) that is seen from positive x: 120 points along a spiral.
pub(crate) fn cap() -> v1::VisualPrior {
    let spiral = (0..120).map(|i| {
        let (around, up) = (2.4 * f64::from(i), 1.0 - 0.35 * f64::from(i) / 120.0);
        let across = (1.0 - up * up).sqrt();
        [0.05 * up, 0.05 * across * around.cos(), 0.3 + 0.05 * across * around.sin()].map(|x| x as f32)
    });
    cloud(&spiral.collect::<Vec<_>>())
}

/// The view of the ball, with a wish for one candidate.
pub(crate) fn prior(session_id: &str) -> v1::AddVisualPriorRequest {
    v1::AddVisualPriorRequest {
        session_id: session_id.into(),
        prior: Some(cap()),
        request_id: "prior".into(),
        propose: 1,
        ..Default::default()
    }
}

/// A question for `top_k` candidates.
pub(crate) fn question(session_id: &str, top_k: u32) -> v1::ProposeContactsRequest {
    v1::ProposeContactsRequest { session_id: session_id.into(), top_k, ..Default::default() }
}

/// A touch `off_m` outside of where the candidate expects the surface, near the middle of the pad.
pub(crate) fn touch(candidate: &v1::Candidate, off_m: f64) -> v1::ContactResult {
    let (point, normal) = (candidate.point.unwrap(), candidate.normal.unwrap());
    let along = |point: f64, normal: f64| point + off_m * normal;
    let position =
        v1::Vector3 { x: along(point.x, normal.x), y: along(point.y, normal.y), z: along(point.z, normal.z) };
    let pose = v1::Pose { position: Some(position), orientation: candidate.tool_pose.unwrap().orientation };
    let wrench = v1::Wrench {
        force: Some(v1::Vector3 { x: 0.0, y: 0.0, z: -2.0 }),
        torque: Some(v1::Vector3 { x: 0.004, y: 0.0, z: 0.0 }),
    };
    let contact = v1::Contact {
        sensor_pose: Some(pose),
        wrench: Some(wrench),
        swept_from: candidate.probe_start,
        ..Default::default()
    };
    result(candidate, ContactOutcome::Contact(contact))
}

/// The whole approach without a touch.
pub(crate) fn miss(candidate: &v1::Candidate) -> v1::ContactResult {
    let free = v1::NoContact {
        swept_from: candidate.probe_start,
        swept_to: candidate.probe_end,
        sweep_radius_m: 0.004,
    };
    result(candidate, ContactOutcome::NoContact(free))
}

/// Anything that became of a candidate.
pub(crate) fn result(candidate: &v1::Candidate, said: ContactOutcome) -> v1::ContactResult {
    v1::ContactResult {
        candidate_id: candidate.candidate_id.clone(),
        robot_id: "arm-1".into(),
        outcome: Some(said),
        ..Default::default()
    }
}

/// A report with a wish for one candidate.
pub(crate) fn report(
    session_id: &str,
    result: v1::ContactResult,
    request_id: &str,
) -> v1::ReportContactRequest {
    v1::ReportContactRequest {
        session_id: session_id.into(),
        result: Some(result),
        request_id: request_id.into(),
        propose: 1,
        ..Default::default()
    }
}

impl Caller {
    /// Creates a session and shows it the ball: revision 2, and the first candidate.
    pub(crate) async fn begin(&self, session_id: &str) -> v1::Candidate {
        self.create(creation(session_id)).await.unwrap();
        self.add_prior(prior(session_id)).await.unwrap().candidates.remove(0)
    }

    /// Makes `touches` touches after [`Caller::begin`] and gives the next candidate.
    pub(crate) async fn go_on(
        &self,
        session_id: &str,
        mut next: v1::Candidate,
        touches: usize,
    ) -> v1::Candidate {
        for _ in 0..touches {
            // A candidate is proposed once, so its id makes a request id.
            let request = report(session_id, touch(&next, 0.001), &format!("touch-{}", next.candidate_id));
            next = self.report(request).await.unwrap().candidates.remove(0);
        }
        next
    }
}

/// A session but for what the clock says of it, which a restart may change.
pub(crate) fn without_timing(mut session: v1::Session) -> v1::Session {
    if let Some(stats) = &mut session.stats {
        stats.last_update = None;
    }
    session
}
