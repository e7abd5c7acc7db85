//! One exploration, told as it happens: a line a touch, a bar, and what came of it.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use palpate_client::Client;
use palpate_client::proto::v1::StopReason;
use palpate_core::metrics::{Comparison, Reference, Sampling};
use palpate_simulator::body::Body;
use palpate_simulator::robot::{Attempt, Plan};

use super::measured::{MeasuredRobot, outcome_name};
use crate::failure::Failure;

/// What came of an exploration.
#[derive(Debug)]
pub(in crate::commands) struct Exploration {
    /// The session on the server.
    pub(in crate::commands) session_id: String,
    /// The final estimate as a PLY file.
    pub(in crate::commands) ply: Vec<u8>,
    attempts: u32,
    missed: u32,
    early: u32,
    touching: Duration,
    mean_uncertainty: f64,
    stopped: StopReason,
    comparison: Comparison,
}

/// Explores `body` and prints a line for every touch.
pub(in crate::commands) async fn drive(
    client: Client,
    body: &Body,
    plan: Plan,
) -> Result<Exploration, Failure> {
    let reference = Arc::new(Reference::new(body.mesh().clone(), Sampling::default())?);
    let bar = ProgressBar::new(plan.attempts.into());
    bar.set_style(ProgressStyle::with_template("{bar:40} {pos}/{len} touches, {eta} left")?);
    let mut robot =
        MeasuredRobot::begin(client, body, reference, plan, Reference::surface_distance_m).await?;
    bar.suspend(|| {
        println!("\nattempt  outcome  error mm  mean uncertainty");
        println!("   none  camera   {:8.2}  {:16.3}", 1e3 * robot.errors, robot.mean_uncertainty());
    });
    let mut attempts = 0;
    while let Some(attempt) = robot.step().await? {
        attempts = attempt.number;
        bar.inc(1);
        bar.suspend(|| println!("{}", line(&attempt, robot.errors)));
    }
    bar.finish_and_clear();
    Ok(Exploration {
        session_id: robot.session().session_id.clone(),
        ply: robot.ply().await?,
        attempts,
        missed: robot.missed,
        early: robot.early,
        touching: robot.touching,
        mean_uncertainty: robot.mean_uncertainty(),
        stopped: robot.session().should_stop(),
        comparison: robot.measure(Reference::compare).await?,
    })
}

fn line(attempt: &Attempt, error_m: f64) -> String {
    let outcome = outcome_name(&attempt.outcome);
    let (number, uncertainty) = (attempt.number, attempt.mean_uncertainty);
    let mut line = format!("{number:7}  {outcome:<7}  {:8.2}  {uncertainty:16.3}", 1e3 * error_m);
    for warning in &attempt.warnings {
        line.push_str("\n         ");
        line.push_str(warning);
    }
    line
}

impl std::fmt::Display for Exploration {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { attempts, missed, early, touching, mean_uncertainty, stopped, comparison, .. } = self;
        let each_ms = 1e3 * touching.as_secs_f64() / f64::from((*attempts).max(1));
        let seconds = touching.as_secs_f64();
        writeln!(
            f,
            "{attempts} touches in {seconds:.1} s, {each_ms:.0} ms each: report, estimate, next candidate"
        )?;
        writeln!(f, "{} failures: {missed} missed, {early} early", missed + early)?;
        let mm = |metres: f64| 1e3 * metres;
        writeln!(f, "error: {:.2} mm mean surface distance", mm(comparison.surface_distance_m))?;
        writeln!(f, "       {:.2} mm at worst (Hausdorff)", mm(comparison.hausdorff_m))?;
        writeln!(f, "       {:.0} % of the object within 2 mm of the estimate", 100.0 * comparison.coverage)?;
        writeln!(f, "mean uncertainty: {mean_uncertainty:.3} of 1")?;
        match stopped {
            StopReason::Unspecified | StopReason::Budget => Ok(()),
            reason => writeln!(f, "stopped early: {}", reason.as_str_name()),
        }
    }
}

/// Writes the estimate's PLY file and says where.
pub(in crate::commands) fn save_ply(exploration: &Exploration, path: &Path) -> Result<(), Failure> {
    std::fs::write(path, &exploration.ply).map_err(|error| format!("{}: {error}", path.display()))?;
    println!("mesh: {} (per-vertex uncertainty in the property \"uncertainty\")", path.display());
    Ok(())
}
