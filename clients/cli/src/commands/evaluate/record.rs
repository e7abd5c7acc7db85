//! What is written down: a line for every attempt and a line for every run.

use std::path::Path;

use palpate_client::proto::v1::{Method, Strategy};
use palpate_core::metrics::{Comparison, StatedError};
use serde::{Serialize, Serializer};

use super::super::robot::name_of;
use super::spread::Spread;
use crate::failure::Failure;

/// What is explored and how: one cell of the evaluation.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Case {
    pub(super) object: String,
    pub(super) method: String,
    pub(super) strategy: String,
    pub(super) seed: u64,
}

impl Case {
    pub(super) fn new(object: &str, method: Method, strategy: Strategy, seed: u64) -> Self {
        Self {
            object: object.to_owned(),
            method: name_of(method).to_owned(),
            strategy: name_of(strategy).to_owned(),
            seed,
        }
    }
}

/// The state after one attempt; attempt 0 is the camera's view alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct AttemptRow {
    pub(super) attempt: u32,
    /// `view`, `hit`, `early` or `miss`.
    pub(super) outcome: &'static str,
    #[serde(serialize_with = "rounded")]
    pub(super) surface_distance_mm: f64,
    #[serde(serialize_with = "rounded")]
    pub(super) chamfer_sum_mm: f64,
    #[serde(serialize_with = "rounded")]
    pub(super) mean_uncertainty: f64,
    pub(super) missed_so_far: u32,
    pub(super) early_so_far: u32,
    /// Share of vertices whose error is within the stated two sigma; empty where it was not measured.
    #[serde(serialize_with = "rounded_if_any")]
    pub(super) within_2sigma: Option<f64>,
    /// The risk of failure that was stated of the candidate that was tried; empty where none was.
    #[serde(serialize_with = "rounded_if_any")]
    pub(super) failure_risk: Option<f64>,
}

impl AttemptRow {
    /// Whether the attempt failed.
    pub(super) fn failed(&self) -> bool {
        matches!(self.outcome, "miss" | "early")
    }
}

/// One finished run.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Run {
    pub(super) case: Case,
    pub(super) session_id: String,
    /// Attempt 0 first.
    pub(super) attempts: Vec<AttemptRow>,
    pub(super) last: Comparison,
    /// Each vertex of each estimate whose calibration was measured; empty if the method states no sigma.
    pub(super) stated_errors: Vec<StatedError>,
    /// The share of vertices within the stated two sigma in the last estimate, where any are stated.
    pub(super) calibration_2sigma: Option<f64>,
    /// Why the server stopped before the budget was spent; empty if it did not.
    pub(super) stopped_early: String,
}

impl Run {
    /// The state after attempt `number`, or after the last if the run ended before it.
    pub(super) fn after(&self, number: usize) -> Option<&AttemptRow> {
        self.attempts.get(number).or(self.attempts.last())
    }

    pub(super) fn missed(&self) -> f64 {
        self.attempts.last().map_or(0.0, |row| f64::from(row.missed_so_far))
    }

    pub(super) fn early(&self) -> f64 {
        self.attempts.last().map_or(0.0, |row| f64::from(row.early_so_far))
    }

    /// The share of vertices within the stated two sigma, as a mean over the attempts at which it was measured.
    pub(super) fn within_2sigma(&self) -> Option<f64> {
        Spread::of(self.attempts.iter().filter_map(|row| row.within_2sigma)).map(|spread| spread.mean)
    }
}

/// Four digits after the point: a tenth of a micrometre, where the unit is a millimetre.
fn rounded<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64((value * 1e4).round() / 1e4)
}

/// Six digits after the point, as the small ones among the risks matter; empty for none.
fn rounded_if_any<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    value.map(|value| (value * 1e6).round() / 1e6).serialize(serializer)
}

/// Writes a line for every attempt of every run.
pub(super) fn write_attempts(runs: &[Run], path: &Path) -> Result<(), Failure> {
    let mut writer = csv::Writer::from_path(path)?;
    for run in runs {
        for row in &run.attempts {
            writer.serialize((&run.case, row))?;
        }
    }
    Ok(writer.flush()?)
}

#[derive(Serialize)]
struct RunRow<'a> {
    session_id: &'a str,
    attempts: usize,
    missed: f64,
    early: f64,
    #[serde(serialize_with = "rounded")]
    surface_distance_mm: f64,
    #[serde(serialize_with = "rounded")]
    chamfer_sum_mm: f64,
    #[serde(serialize_with = "rounded")]
    chamfer_mean_mm: f64,
    #[serde(serialize_with = "rounded")]
    hausdorff_mm: f64,
    #[serde(serialize_with = "rounded")]
    f_score_1mm: f64,
    #[serde(serialize_with = "rounded")]
    coverage_2mm: f64,
    #[serde(serialize_with = "rounded")]
    volume_ratio: f64,
    calibration_2sigma: Option<f64>,
    #[serde(serialize_with = "rounded")]
    mean_uncertainty: f64,
    stopped_early: &'a str,
}

/// Writes a line for every run, with all metrics of its last estimate.
pub(super) fn write_runs(runs: &[Run], path: &Path) -> Result<(), Failure> {
    let mut writer = csv::Writer::from_path(path)?;
    for run in runs {
        let row = RunRow {
            session_id: &run.session_id,
            attempts: run.attempts.len() - 1,
            missed: run.missed(),
            early: run.early(),
            surface_distance_mm: 1e3 * run.last.surface_distance_m,
            chamfer_sum_mm: 1e3 * run.last.chamfer.sum_m,
            chamfer_mean_mm: 1e3 * run.last.chamfer.mean_m,
            hausdorff_mm: 1e3 * run.last.hausdorff_m,
            f_score_1mm: run.last.f_score_1mm,
            coverage_2mm: run.last.coverage,
            volume_ratio: run.last.volume_ratio,
            calibration_2sigma: run.calibration_2sigma,
            mean_uncertainty: run.attempts.last().map_or(1.0, |row| row.mean_uncertainty),
            stopped_early: &run.stopped_early,
        };
        writer.serialize((&run.case, row))?;
    }
    Ok(writer.flush()?)
}

#[cfg(test)]
mod tests {
    use palpate_core::metrics::Chamfer;

    use super::*;

    impl Run {
        /// A run of one attempt, after which the error is `error_mm` everywhere.
        pub(in super::super) fn example(object: &str, strategy: Strategy, seed: u64, error_mm: f64) -> Self {
            let row = |attempt, outcome, share: f64| AttemptRow {
                attempt,
                outcome,
                surface_distance_mm: error_mm * share,
                chamfer_sum_mm: 2.0 * error_mm * share,
                mean_uncertainty: 0.5,
                missed_so_far: 2 * attempt,
                early_so_far: attempt * seed as u32,
                within_2sigma: None,
                failure_risk: None,
            };
            let sum_m = 2e-3 * error_mm;
            Self {
                case: Case::new(object, Method::Paper, strategy, seed),
                session_id: "run-0001".to_owned(),
                attempts: vec![row(0, "view", 3.0), row(1, "miss", 1.0)],
                last: Comparison {
                    surface_distance_m: 1e-3 * error_mm,
                    hausdorff_m: 0.01,
                    f_score_1mm: 0.5,
                    coverage: 0.75,
                    volume_ratio: 1.0,
                    chamfer: Chamfer { sum_m, mean_m: 0.5 * sum_m },
                },
                stated_errors: Vec::new(),
                calibration_2sigma: None,
                stopped_early: String::new(),
            }
        }
    }

    #[test]
    fn files_have_a_header_and_a_line_for_each() {
        let folder = tempfile::tempdir().unwrap();
        let mut runs = [1, 2].map(|seed| Run::example("lamp", Strategy::Proactive, seed, 4.0));
        runs[1].attempts[1].within_2sigma = Some(0.9375);
        runs[1].attempts[1].failure_risk = Some(0.000_123_4);
        let (attempts, all) = (folder.path().join("attempts.csv"), folder.path().join("runs.csv"));
        write_attempts(&runs, &attempts).unwrap();
        write_runs(&runs, &all).unwrap();
        let attempts = std::fs::read_to_string(attempts).unwrap();
        let lines: Vec<_> = attempts.lines().collect();
        assert_eq!(lines.len(), 1 + 2 * 2);
        assert_eq!(
            lines[0],
            "object,method,strategy,seed,attempt,outcome,surface_distance_mm,chamfer_sum_mm,\
             mean_uncertainty,missed_so_far,early_so_far,within_2sigma,failure_risk"
        );
        assert_eq!(lines[2], "lamp,paper,proactive,1,1,miss,4.0,8.0,0.5,2,1,,", "nothing was stated");
        assert_eq!(lines[4], "lamp,paper,proactive,2,1,miss,4.0,8.0,0.5,2,2,0.9375,0.000123");
        let all = std::fs::read_to_string(all).unwrap();
        let lines: Vec<_> = all.lines().collect();
        assert_eq!(lines.len(), 1 + 2);
        assert!(lines[0].starts_with("object,method,strategy,seed,session_id,attempts,missed,early,"));
        assert!(lines[1].starts_with("lamp,paper,proactive,1,run-0001,1,2.0,1.0,4.0,8.0,4.0,10.0,0.5,0.75,"));
    }
}
