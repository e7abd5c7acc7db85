//! One run: an object, a method, a strategy and a seed, measured after every attempt.

use std::sync::Arc;

use palpate_client::Client;
use palpate_client::proto::v1::StopReason;
use palpate_core::geometry::TriangleMesh;
use palpate_core::metrics::Reference;
use palpate_simulator::probe::Outcome;
use palpate_simulator::robot::{Plan, Robot};

use super::super::robot::outcome_name;
use super::objects::EvaluatedObject;
use super::record::{AttemptRow, Case, Run};
use crate::cli::Failure;

/// Explores once, from the view to the last attempt.
pub(super) async fn run(
    client: Client,
    object: EvaluatedObject,
    case: Case,
    plan: Plan,
) -> Result<Run, Failure> {
    let mut robot = Robot::begin(client, &object.body, plan).await?;
    let mut estimate = robot.estimate().await?;
    let mut errors = errors_mm(&object.reference, &estimate.mesh).await?;
    let mut attempts = vec![AttemptRow {
        attempt: 0,
        outcome: "view",
        surface_distance_mm: errors.surface_distance,
        chamfer_sum_mm: errors.chamfer_sum,
        mean_uncertainty: robot.session().stats.as_ref().map_or(1.0, |stats| stats.mean_uncertainty),
        missed_so_far: 0,
        early_so_far: 0,
    }];
    let (mut missed_so_far, mut early_so_far) = (0, 0);
    while let Some(attempt) = robot.step().await? {
        missed_so_far += u32::from(attempt.outcome == Outcome::Miss);
        early_so_far += u32::from(matches!(attempt.outcome, Outcome::Early(_)));
        let before = std::mem::replace(&mut estimate, robot.estimate().await?);
        // A failure may leave the estimate as it was, and then its errors too.
        if estimate.mesh != before.mesh {
            errors = errors_mm(&object.reference, &estimate.mesh).await?;
        }
        attempts.push(AttemptRow {
            attempt: attempt.number,
            outcome: outcome_name(&attempt.outcome),
            surface_distance_mm: errors.surface_distance,
            chamfer_sum_mm: errors.chamfer_sum,
            mean_uncertainty: attempt.mean_uncertainty,
            missed_so_far,
            early_so_far,
        });
    }
    let session = robot.session();
    let stopped_early = match session.should_stop() {
        StopReason::Unspecified | StopReason::Budget => String::new(),
        reason => reason.as_str_name().to_owned(),
    };
    let session_id = session.session_id.clone();
    let reference = Arc::clone(&object.reference);
    let (last, calibration_2sigma) = tokio::task::spawn_blocking(move || {
        let calibration = (!estimate.std_m.is_empty())
            .then(|| reference.calibration_2sigma(&estimate.mesh, &estimate.std_m));
        Ok::<_, Failure>((reference.compare(&estimate.mesh)?, calibration.transpose()?))
    })
    .await??;
    Ok(Run { case, session_id, attempts, last, calibration_2sigma, stopped_early })
}

struct ErrorsMm {
    surface_distance: f64,
    chamfer_sum: f64,
}

/// Compares off the async executor, which has a server to run.
async fn errors_mm(reference: &Arc<Reference>, mesh: &TriangleMesh) -> Result<ErrorsMm, Failure> {
    let (reference, mesh) = (Arc::clone(reference), mesh.clone());
    tokio::task::spawn_blocking(move || {
        Ok(ErrorsMm {
            surface_distance: 1e3 * reference.surface_distance_m(&mesh)?,
            chamfer_sum: 1e3 * reference.chamfer(&mesh)?.sum_m,
        })
    })
    .await?
}
