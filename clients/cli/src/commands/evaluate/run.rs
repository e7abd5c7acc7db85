//! One run: an object, a method, a strategy and a seed, measured after every attempt.

use std::sync::Arc;

use palpate_client::Client;
use palpate_client::proto::v1::{Candidate, StopReason};
use palpate_core::geometry::TriangleMesh;
use palpate_core::metrics::{MetricsError, Reference, StatedError, coverage};
use palpate_simulator::robot::Estimate;

use super::super::robot::{MeasuredRobot, outcome_name};
use super::cases::Task;
use super::record::{AttemptRow, Run};
use super::reliability::MEASURED_EVERY;
use crate::failure::Failure;

/// Explores once, from the view to the last attempt.
pub(super) async fn run(client: Client, task: Task) -> Result<Run, Failure> {
    let Task { case, object, plan } = task;
    let reference = Arc::clone(&object.reference);
    let mut robot = MeasuredRobot::begin(client, &object.body, reference, plan, errors_mm).await?;
    let mut attempts = vec![AttemptRow {
        attempt: 0,
        outcome: "view".to_owned(),
        surface_distance_mm: robot.errors.surface_distance,
        chamfer_sum_mm: robot.errors.chamfer_sum,
        mean_uncertainty: robot.mean_uncertainty(),
        missed_so_far: 0,
        early_so_far: 0,
        within_2sigma: None,
        failure_risk: None,
    }];
    let mut stated_errors = Vec::new();
    while let Some(attempt) = robot.step().await? {
        let mut within_2sigma = None;
        if attempt.number.is_multiple_of(MEASURED_EVERY) && !robot.estimate.std_m.is_empty() {
            let stated = errors_beside_std(&object.reference, &robot.estimate).await?;
            within_2sigma = Some(coverage(&stated, 2.0));
            stated_errors.extend(stated);
        }
        attempts.push(AttemptRow {
            attempt: attempt.number,
            outcome: outcome_name(&attempt.outcome).to_owned(),
            surface_distance_mm: robot.errors.surface_distance,
            chamfer_sum_mm: robot.errors.chamfer_sum,
            mean_uncertainty: attempt.mean_uncertainty,
            missed_so_far: robot.missed,
            early_so_far: robot.early,
            within_2sigma,
            failure_risk: stated_risk(&attempt.candidate),
        });
    }
    let session = robot.session();
    let stopped_early = match session.should_stop() {
        StopReason::Unspecified | StopReason::Budget => String::new(),
        reason => reason.as_str_name().to_owned(),
    };
    let (session_id, warnings) = (session.session_id.clone(), robot.warned);
    let last = robot.measure(Reference::compare).await?;
    let calibration_2sigma = calibration(&object.reference, robot.estimate).await?;
    Ok(Run { case, session_id, attempts, last, stated_errors, calibration_2sigma, stopped_early, warnings })
}

#[derive(Debug)]
struct ErrorsMm {
    surface_distance: f64,
    chamfer_sum: f64,
}

fn errors_mm(reference: &Reference, mesh: &TriangleMesh) -> Result<ErrorsMm, MetricsError> {
    Ok(ErrorsMm {
        surface_distance: 1e3 * reference.surface_distance_m(mesh)?,
        chamfer_sum: 1e3 * reference.chamfer(mesh)?.sum_m,
    })
}

/// The share of vertices within two stated deviations, off the async executor; `None` where none are stated.
async fn calibration(reference: &Arc<Reference>, estimate: Estimate) -> Result<Option<f64>, Failure> {
    if estimate.std_m.is_empty() {
        return Ok(None);
    }
    let reference = Arc::clone(reference);
    let measure = move || reference.calibration_2sigma(&estimate.mesh, &estimate.std_m);
    Ok(Some(tokio::task::spawn_blocking(measure).await??))
}

/// What the estimate says of each vertex beside the truth, off the async executor as well.
async fn errors_beside_std(
    reference: &Arc<Reference>,
    estimate: &Estimate,
) -> Result<Vec<StatedError>, Failure> {
    let (reference, estimate) = (Arc::clone(reference), estimate.clone());
    let measure = move || reference.stated_errors(&estimate.mesh, &estimate.std_m);
    Ok(tokio::task::spawn_blocking(measure).await??)
}

/// The risk comes from the standard deviation: a method that states none leaves both at zero.
fn stated_risk(candidate: &Candidate) -> Option<f64> {
    (candidate.std_m > 0.0).then_some(candidate.failure_risk)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_risk_of_zero_is_told_from_one_that_was_not_stated() {
        let candidate = |std_m, failure_risk| Candidate { std_m, failure_risk, ..Candidate::default() };
        assert_eq!(stated_risk(&candidate(0.0, 0.0)), None);
        assert_eq!(stated_risk(&candidate(0.000_1, 0.0)), Some(0.0));
        assert_eq!(stated_risk(&candidate(0.01, 0.2)), Some(0.2));
    }
}
