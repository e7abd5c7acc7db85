//! What is known of a run, and how its lines in the files are laid out.

use palpate_core::metrics::{Chamfer, Comparison, StatedError};
use serde::{Deserialize, Serialize, Serializer};

use super::cases::Case;
use super::spread::Spread;

/// The state after one attempt; attempt 0 is the camera's view alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct AttemptRow {
    pub(super) attempt: u32,
    /// `view`, `hit`, `early`, `miss`, or `false` for a contact that was reported of nothing.
    pub(super) outcome: String,
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
        matches!(self.outcome.as_str(), "miss" | "early")
    }

    /// Whether a contact was reported in the air, so that nothing is known of what would have been met.
    pub(super) fn is_false(&self) -> bool {
        self.outcome == "false"
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
    /// How many of the server's replies warned of something beyond an early contact or an undeclared table.
    pub(super) warnings: u32,
}

impl Run {
    /// The state after attempt `number`, or after the last if the run ended before it.
    pub(super) fn after(&self, number: usize) -> Option<&AttemptRow> {
        self.attempts.get(number).or(self.attempts.last())
    }

    pub(super) fn missed(&self) -> u32 {
        self.attempts.last().map_or(0, |row| row.missed_so_far)
    }

    pub(super) fn early(&self) -> u32 {
        self.attempts.last().map_or(0, |row| row.early_so_far)
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

/// A run's line, with all metrics of its last estimate.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct RunRow {
    pub(super) session_id: String,
    pub(super) attempts: usize,
    missed: u32,
    early: u32,
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
    stopped_early: String,
    warnings: u32,
}

impl RunRow {
    pub(super) fn of(run: &Run) -> Self {
        Self {
            session_id: run.session_id.clone(),
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
            stopped_early: run.stopped_early.clone(),
            warnings: run.warnings,
        }
    }

    /// The run that this line was written of.
    pub(super) fn into_run(
        self,
        case: Case,
        attempts: Vec<AttemptRow>,
        stated_errors: Vec<StatedError>,
    ) -> Run {
        Run {
            case,
            session_id: self.session_id,
            attempts,
            last: Comparison {
                surface_distance_m: 1e-3 * self.surface_distance_mm,
                hausdorff_m: 1e-3 * self.hausdorff_mm,
                f_score_1mm: self.f_score_1mm,
                coverage: self.coverage_2mm,
                volume_ratio: self.volume_ratio,
                chamfer: Chamfer { sum_m: 1e-3 * self.chamfer_sum_mm, mean_m: 1e-3 * self.chamfer_mean_mm },
            },
            stated_errors,
            calibration_2sigma: self.calibration_2sigma,
            stopped_early: self.stopped_early,
            warnings: self.warnings,
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_client::proto::v1::{Method, Strategy};

    use super::*;

    impl Run {
        /// A run of one attempt, after which the error is `error_mm` everywhere.
        pub(in super::super) fn example(object: &str, strategy: Strategy, seed: u64, error_mm: f64) -> Self {
            let row = |attempt, outcome: &str, share: f64| AttemptRow {
                attempt,
                outcome: outcome.to_owned(),
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
                warnings: 0,
            }
        }
    }
}
