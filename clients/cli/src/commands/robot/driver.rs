//! One exploration, told as it happens: a line a touch, a bar, and what came of it.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use palpate_client::Client;
use palpate_client::proto::v1::StopReason;
use palpate_core::metrics::{Comparison, Reference, Sampling};
use palpate_simulator::body::Body;
use palpate_simulator::probe::Outcome;
use palpate_simulator::robot::{Attempt, Plan};

use super::measured::{MeasuredRobot, outcome_name};
use crate::failure::Failure;
use crate::terminal::{BOLD, ODD, counted, say, styled, wrapped};

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
    false_contacts: u32,
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
    url: &str,
) -> Result<Exploration, Failure> {
    let reference = Arc::new(Reference::new(body.mesh().clone(), Sampling::default())?);
    let bar = ProgressBar::new(plan.attempts.into());
    bar.set_style(ProgressStyle::with_template("{bar:15} {pos}/{len} touches, {eta} left")?);
    let mut robot =
        MeasuredRobot::begin(client, body, reference, plan, Reference::surface_distance_m).await?;
    // The address works from here on, while the robot goes on touching.
    let page = format!("Watch it: {url}/#/{}", robot.session().session_id);
    bar.suspend(|| say(page))?;
    let head = styled(BOLD, "attempt  outcome  error mm  uncertainty");
    let seen = format!("   none  camera   {:8.2}  {:11.3}", 1e3 * robot.errors, robot.mean_uncertainty());
    let seen = with_warnings(seen, robot.view_warnings());
    bar.suspend(|| say(format_args!("\n{head}\n{seen}")))?;
    let mut attempts = 0;
    while let Some(attempt) = robot.step().await? {
        attempts = attempt.number;
        bar.inc(1);
        bar.suspend(|| say(line(&attempt, robot.errors)))?;
    }
    bar.finish_and_clear();
    Ok(Exploration {
        session_id: robot.session().session_id.clone(),
        ply: robot.ply().await?,
        attempts,
        missed: robot.missed,
        early: robot.early,
        false_contacts: robot.false_contacts,
        touching: robot.touching,
        mean_uncertainty: robot.mean_uncertainty(),
        stopped: robot.session().should_stop(),
        comparison: robot.measure(Reference::compare).await?,
    })
}

/// At most 42 columns, so that no number is broken in two.
fn line(attempt: &Attempt, error_m: f64) -> String {
    let outcome = format!("{:<7}", outcome_name(&attempt.outcome));
    let outcome = match attempt.outcome {
        Outcome::Hit(_) => outcome,
        Outcome::Early(_) | Outcome::Miss | Outcome::False(_) => styled(ODD, outcome),
    };
    let (number, uncertainty) = (attempt.number, attempt.mean_uncertainty);
    let line = format!("{number:7}  {outcome}  {:8.2}  {uncertainty:11.3}", 1e3 * error_m);
    with_warnings(line, &attempt.warnings)
}

/// A line of the table with what the server found odd below it.
fn with_warnings(mut line: String, warnings: &[String]) -> String {
    for warning in warnings {
        line.push('\n');
        line.push_str(&wrapped(&format!("         {warning}"), 9));
    }
    line
}

impl std::fmt::Display for Exploration {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { attempts, missed, early, false_contacts, touching, .. } = self;
        let Self { mean_uncertainty, stopped, comparison, .. } = self;
        let each_ms = 1e3 * touching.as_secs_f64() / f64::from((*attempts).max(1));
        let seconds = touching.as_secs_f64();
        let attempted = counted(*attempts as usize, "touch", "touches");
        writeln!(
            f,
            "{attempted} in {seconds:.1} s, {each_ms:.0} ms each:\n  report, estimate, next candidate"
        )?;
        let failures = counted((missed + early) as usize, "failure", "failures");
        writeln!(f, "{failures}: {missed} missed, {early} early")?;
        if *false_contacts > 0 {
            let touches = counted(*false_contacts as usize, "contact", "contacts");
            writeln!(f, "{touches} reported in the air")?;
        }
        let mm = |metres: f64| 1e3 * metres;
        writeln!(f, "error: {:.2} mm mean surface distance", mm(comparison.surface_distance_m))?;
        writeln!(f, "       {:.2} mm at worst (Hausdorff)", mm(comparison.hausdorff_m))?;
        writeln!(f, "       {:.0} % of the object within 2 mm", 100.0 * comparison.coverage)?;
        write!(f, "mean uncertainty: {mean_uncertainty:.3} (1: a guess)")?;
        match stopped {
            StopReason::Unspecified | StopReason::Budget => Ok(()),
            reason => write!(f, "\nstopped early: {}", reason.as_str_name()),
        }
    }
}

/// Writes the estimate's PLY file and says where.
pub(in crate::commands) fn save_ply(exploration: &Exploration, path: &Path) -> Result<(), Failure> {
    std::fs::write(path, &exploration.ply).map_err(|error| format!("{}: {error}", path.display()))?;
    say(wrapped(&format!("mesh: {}, with the uncertainty of each vertex", path.display()), 2))
}

#[cfg(test)]
mod tests {
    use palpate_client::proto::v1::Candidate;
    use palpate_core::geometry::{Point, Pose, Vector};
    use palpate_core::metrics::Chamfer;
    use palpate_simulator::probe::Touch;

    use super::*;

    #[test]
    fn a_line_of_the_table_fits_into_42_columns() {
        let attempt = Attempt {
            number: 1000,
            outcome: Outcome::Miss,
            candidate: Candidate::default(),
            mean_uncertainty: 0.123,
            revision: 7,
            warnings: Vec::new(),
            should_stop: StopReason::Unspecified,
        };
        let miss = styled(ODD, "miss   ");
        let line = line(&attempt, 0.123_456);
        assert_eq!(line, format!("   1000  {miss}    123.46        0.123"));
        assert!(line.replace(&miss, "miss   ").len() <= 42);
        let touch = Touch {
            base_from_sensor: Pose::identity(),
            force_n: Vector::zeros(),
            torque_nm: Vector::zeros(),
            swept_from: Point::origin(),
            normal: None,
        };
        for outcome in [Outcome::Hit(touch), Outcome::Early(touch), Outcome::False(touch)] {
            assert!(outcome_name(&outcome).len() <= 7);
        }
    }

    #[test]
    fn one_touch_and_one_failure_are_singular() {
        let exploration = Exploration {
            session_id: "s".to_owned(),
            ply: Vec::new(),
            attempts: 1,
            missed: 1,
            early: 0,
            false_contacts: 2,
            touching: Duration::from_millis(31),
            mean_uncertainty: 0.5,
            stopped: StopReason::Stalled,
            comparison: Comparison {
                surface_distance_m: 0.001,
                hausdorff_m: 0.002,
                f_score_1mm: 0.5,
                coverage: 0.5,
                volume_ratio: 1.0,
                chamfer: Chamfer { sum_m: 0.002, mean_m: 0.001 },
            },
        };
        let text = exploration.to_string();
        assert!(text.starts_with("1 touch in 0.0 s, 31 ms each:"), "{text}");
        assert!(text.contains("\n1 failure: 1 missed, 0 early\n2 contacts reported in the air\n"), "{text}");
        assert!(text.ends_with("\nstopped early: STOP_REASON_STALLED"), "{text}");
        assert!(text.lines().all(|line| line.len() <= 42), "{text}");
    }
}
