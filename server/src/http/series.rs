//! The series of a session as JSON or as a table.

use axum::extract::{Path, State};
use axum::response::{IntoResponse, Response};
use http::HeaderMap;
use http::header::VARY;
use palpate_proto::v1;
use serde::Deserialize;

use super::csv::{self, cell, short};
use super::extract::Params;
use super::problem::Problem;
use super::proto_json::ProtoJson;
use crate::api::{Api, Call};

/// Which rows, and how.
#[derive(Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct SeriesParams {
    /// `json` or `csv`; the `Accept` header works too.
    format: Option<String>,
    /// Only rows after this revision; all without it.
    after_revision: Option<i64>,
    /// Leave out what other strategies would have touched.
    without_shadow: Option<bool>,
}

/// Read one row per view and per attempt
///
/// For charts and tables: how each went, the uncertainty after it, and the error where the session keeps a reference
/// mesh. Errors are computed in the background: `errors_pending` says how many rows still lack theirs, so ask again.
/// As CSV the choices of strategies become columns, such as `random_hindsight`.
#[utoipa::path(
    get, path = "/v1/sessions/{session_id}/series", tag = "evaluation", operation_id = "get_series",
    params(("session_id" = String, Path, description = "Which session"), SeriesParams),
    responses((
        status = 200, description = "The rows, in the order of the log",
        content((ref("#/components/schemas/GetSeriesResponse") = "application/json"), (String = "text/csv")),
    )),
)]
pub(super) async fn get(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
    Params(params): Params<SeriesParams>,
) -> Result<Response, Problem> {
    let SeriesParams { format, after_revision, without_shadow } = params;
    let is_table = csv::is_wanted(format.as_deref(), &headers)?;
    let request = v1::GetSeriesRequest {
        session_id: session_id.clone(),
        after_revision: after_revision.unwrap_or_default(),
        without_shadow: without_shadow.unwrap_or_default(),
    };
    let series = api.get_series(request, call).await?;
    if is_table {
        return Ok(csv::table(&table(series), &format!("{session_id}-series"))?);
    }
    Ok(([(VARY, "accept")], ProtoJson(series)).into_response())
}

const COLUMNS: [&str; 15] = [
    "revision",
    "attempt",
    "append_time",
    "outcome",
    "candidate_id",
    "robot_id",
    "mean_uncertainty",
    "max_uncertainty",
    "mean_std_m",
    "failures",
    "surface_distance_m",
    "force_n",
    "duration_s",
    "doubted",
    "retracted_by_seq",
];

/// What there is of each strategy's choice, after the strategy's name.
const OF_CHOICES: [&str; 7] = ["candidate_id", "x_m", "y_m", "z_m", "score", "failure_risk", "hindsight"];

fn table(series: v1::GetSeriesResponse) -> Vec<Vec<String>> {
    // Every row of a session asks the same strategies.
    let mut strategies: Vec<v1::Strategy> = Vec::new();
    for choice in series.rows.iter().flat_map(|row| &row.shadow_choices) {
        if !strategies.contains(&choice.strategy()) {
            strategies.push(choice.strategy());
        }
    }
    let of_choices = strategies.iter().flat_map(|strategy| {
        let name = short(strategy.as_str_name(), "STRATEGY_");
        OF_CHOICES.map(|column| format!("{name}_{column}"))
    });
    let header = COLUMNS.map(str::to_owned).into_iter().chain(of_choices).collect();
    std::iter::once(header).chain(series.rows.into_iter().map(|row| cells(row, &strategies))).collect()
}

fn cells(row: v1::SeriesRow, strategies: &[v1::Strategy]) -> Vec<String> {
    let v1::SeriesRow {
        revision,
        attempt,
        append_time,
        outcome,
        candidate_id,
        robot_id,
        mean_uncertainty,
        max_uncertainty,
        mean_std_m,
        failures,
        surface_distance_m,
        force_n,
        duration,
        doubted,
        retracted_by_seq,
        shadow_choices,
    } = row;
    let seconds = duration.map(|duration| duration.seconds as f64 + 1e-9 * f64::from(duration.nanos));
    let mut cells = vec![
        revision.to_string(),
        attempt.to_string(),
        cell(append_time),
        outcome,
        candidate_id,
        robot_id,
        mean_uncertainty.to_string(),
        max_uncertainty.to_string(),
        cell(mean_std_m),
        failures.to_string(),
        cell(surface_distance_m),
        cell(force_n),
        cell(seconds),
        doubted.to_string(),
        retracted_by_seq.to_string(),
    ];
    for strategy in strategies {
        let choice = shadow_choices.iter().find(|choice| choice.strategy() == *strategy);
        cells.extend(choice.map_or_else(Default::default, choice_cells));
    }
    cells
}

fn choice_cells(choice: &v1::ShadowChoice) -> [String; OF_CHOICES.len()] {
    let Some(candidate) = &choice.candidate else { return Default::default() };
    let hindsight = match choice.hindsight() {
        v1::Hindsight::Unspecified => String::new(),
        seen => short(seen.as_str_name(), "HINDSIGHT_"),
    };
    [
        candidate.candidate_id.clone(),
        cell(candidate.point.map(|point| point.x)),
        cell(candidate.point.map(|point| point.y)),
        cell(candidate.point.map(|point| point.z)),
        candidate.score.to_string(),
        candidate.failure_risk.to_string(),
        hindsight,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_has_a_cell_for_each_column_and_what_is_unset_is_empty() {
        let candidate =
            v1::Candidate { point: Some(v1::Vector3 { x: 1.0, y: 2.0, z: 3.0 }), ..Default::default() };
        let choice = v1::ShadowChoice {
            strategy: v1::Strategy::MinUncertainty.into(),
            candidate: Some(candidate),
            hindsight: v1::Hindsight::Miss.into(),
        };
        let row = v1::SeriesRow { revision: 3, shadow_choices: vec![choice], ..Default::default() };
        let rows = vec![v1::SeriesRow { revision: 2, ..Default::default() }, row];
        let table = table(v1::GetSeriesResponse { rows, ..Default::default() });
        assert!(table.iter().all(|row| row.len() == COLUMNS.len() + OF_CHOICES.len()));
        let column = |name: &str| table[0].iter().position(|column| column == name).unwrap();
        assert_eq!(table[2][column("min_uncertainty_hindsight")], "miss");
        assert_eq!(table[2][column("min_uncertainty_z_m")], "3");
        assert_eq!(table[1][column("min_uncertainty_z_m")], "");
        assert_eq!(table[1][column("surface_distance_m")], "");
    }
}
