//! Where to touch next, as the messages that planners and viewers know.

use palpate_client::proto::v1::{self, StopReason};

use crate::messages::{Candidate, Candidates, Header, Pose, PoseArray, PoseStamped, Vector3};

/// What the server proposed at one revision.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Proposal {
    /// The session that it is of.
    pub session_id: String,
    /// The revision that it rests on.
    pub revision: i64,
    /// Advice to stop; unspecified = go on.
    pub should_stop: StopReason,
    /// The candidates, best first.
    pub candidates: Vec<v1::Candidate>,
}

impl Proposal {
    /// All of it.
    pub fn details(&self, header: Header) -> Candidates {
        let should_stop = match self.should_stop {
            StopReason::Unspecified => String::new(),
            reason => reason.as_str_name().to_owned(),
        };
        Candidates {
            header,
            session_id: self.session_id.clone(),
            revision: self.revision,
            should_stop,
            candidates: self.candidates.iter().map(candidate).collect(),
        }
    }

    /// The tool at the beginning of each approach, best first.
    pub fn poses(&self, header: Header) -> PoseArray {
        PoseArray { header, poses: self.candidates.iter().map(tool_pose).collect() }
    }

    /// The same of the best one; `None` where nothing is proposed.
    pub fn best(&self, header: Header) -> Option<PoseStamped> {
        self.candidates.first().map(|best| PoseStamped { header, pose: tool_pose(best) })
    }
}

fn tool_pose(candidate: &v1::Candidate) -> Pose {
    candidate.tool_pose.as_ref().map(Pose::from_proto).unwrap_or_default()
}

fn candidate(candidate: &v1::Candidate) -> Candidate {
    let vector = |vector: Option<v1::Vector3>| {
        vector.map(|v1::Vector3 { x, y, z }| Vector3 { x, y, z }).unwrap_or_default()
    };
    Candidate {
        candidate_id: candidate.candidate_id.clone(),
        sensor_id: candidate.sensor_id.clone(),
        point: vector(candidate.point),
        normal: vector(candidate.normal),
        probe_start: vector(candidate.probe_start),
        probe_end: vector(candidate.probe_end),
        tool_pose: tool_pose(candidate),
        score: candidate.score,
        uncertainty: candidate.uncertainty,
        std_m: candidate.std_m,
        failure_risk: candidate.failure_risk,
        why: candidate.why.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_pose_is_that_of_the_first_candidate_and_none_of_nothing() {
        let at = |x| v1::Candidate {
            candidate_id: format!("c{x}"),
            tool_pose: Some(v1::Pose {
                position: Some(v1::Vector3 { x, y: 0.0, z: 0.0 }),
                orientation: Some(v1::Quaternion { x: 1.0, y: 0.0, z: 0.0, w: 0.0 }),
            }),
            ..Default::default()
        };
        let mut proposal = Proposal { candidates: vec![at(1.0), at(2.0)], ..Proposal::default() };
        let best = proposal.best(Header::default()).unwrap();
        assert_eq!((best.pose.position.x, best.pose.orientation.x), (1.0, 1.0));
        assert_eq!(proposal.poses(Header::default()).poses[1].position.x, 2.0);
        assert_eq!(proposal.details(Header::default()).candidates[1].candidate_id, "c2");
        assert_eq!(proposal.details(Header::default()).should_stop, "");

        proposal.candidates.clear();
        proposal.should_stop = StopReason::Coverage;
        assert_eq!(proposal.best(Header::default()), None);
        assert!(proposal.poses(Header::default()).poses.is_empty());
        assert_eq!(proposal.details(Header::default()).should_stop, "STOP_REASON_COVERAGE");
    }
}
