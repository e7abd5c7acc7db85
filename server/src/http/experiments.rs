//! Experiments and their tables.

use std::collections::BTreeMap;

use axum::extract::{Path, State};
use axum::response::{IntoResponse, Response};
use http::HeaderMap;
use http::header::VARY;
use palpate_proto::v1;
use serde::Deserialize;

use super::csv;
use super::extract::{Params, parse_labels};
use super::problem::Problem;
use super::proto_json::ProtoJson;
use crate::api::{Api, Call};

/// Which page.
#[derive(Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ListParams {
    /// At most this many; larger values are capped.
    page_size: Option<i32>,
    /// `next_page_token` of the page before.
    page_token: Option<String>,
}

/// List experiments by name
///
/// Each with how many sessions it has, by their states. Sessions that name none are one without a name.
#[utoipa::path(
    get, path = "/v1/experiments", tag = "evaluation", operation_id = "list_experiments", params(ListParams),
    responses((
        status = 200, description = "A page of experiments",
        body = ref("#/components/schemas/ListExperimentsResponse"), content_type = "application/json",
    )),
)]
pub(super) async fn list(
    State(api): State<Api>,
    call: Call,
    Params(params): Params<ListParams>,
) -> Result<ProtoJson<v1::ListExperimentsResponse>, Problem> {
    let ListParams { page_size, page_token } = params;
    let request = v1::ListExperimentsRequest {
        page_size: page_size.unwrap_or_default(),
        page_token: page_token.unwrap_or_default(),
    };
    Ok(ProtoJson(api.list_experiments(request, call).await?))
}

/// Which sessions, in which groups, and how.
#[derive(Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct SummaryParams {
    /// What makes a group, `labels.strategy,method` for instance, of `labels.NAME`, `method`, `strategy`, `template` and
    /// `state`; without it all sessions are one group.
    by: Option<String>,
    /// Only sessions that carry all of these labels: `object:bottle,strategy:random`.
    labels: Option<String>,
    /// `json` or `csv`; the `Accept` header works too.
    format: Option<String>,
}

/// Summarize an experiment
///
/// Its sessions in groups, with mean, sample standard deviation and range of each figure. The error of a session with
/// a reference mesh is computed where nobody has asked for it yet; a call that ran out of time goes on at the next.
#[utoipa::path(
    get, path = "/v1/experiments/{experiment}/summary", tag = "evaluation", operation_id = "summarize_experiment",
    params(("experiment" = String, Path, description = "Name of the experiment, percent-encoded"), SummaryParams),
    responses((
        status = 200, description = "The groups, in the order of their keys",
        content((ref("#/components/schemas/ExperimentSummary") = "application/json"), (String = "text/csv")),
    )),
)]
pub(super) async fn summary(
    State(api): State<Api>,
    call: Call,
    Path(experiment): Path<String>,
    headers: HeaderMap,
    Params(params): Params<SummaryParams>,
) -> Result<Response, Problem> {
    let SummaryParams { by, labels, format } = params;
    let is_table = csv::is_wanted(format.as_deref(), &headers)?;
    let by = by.filter(|by| !by.is_empty());
    let request = v1::SummarizeExperimentRequest {
        experiment,
        by: by.iter().flat_map(|by| by.split(',')).map(str::to_owned).collect(),
        labels: labels.as_deref().map(parse_labels).transpose()?.unwrap_or_else(BTreeMap::new),
    };
    let summary = api.summarize_experiment(request, call).await?;
    if is_table {
        return Ok(csv::table(&table(summary), "summary")?);
    }
    Ok(([(VARY, "accept")], ProtoJson(summary)).into_response())
}

const FIGURES: [&str; 5] = ["attempts", "failures", "mean_uncertainty", "mean_std_m", "surface_distance_m"];

fn table(summary: v1::ExperimentSummary) -> Vec<Vec<String>> {
    let figures = FIGURES
        .iter()
        .flat_map(|figure| ["n", "mean", "sd", "min", "max"].map(|part| format!("{figure}_{part}")));
    let header = summary.by.into_iter().chain(["n".to_owned()]).chain(figures).collect();
    std::iter::once(header).chain(summary.groups.into_iter().map(cells)).collect()
}

fn cells(group: v1::SummaryGroup) -> Vec<String> {
    let v1::SummaryGroup {
        key,
        n,
        attempts,
        failures,
        mean_uncertainty,
        mean_std_m,
        surface_distance_m,
        session_ids: _,
    } = group;
    let spreads = [attempts, failures, mean_uncertainty, mean_std_m, surface_distance_m];
    key.into_iter().chain([n.to_string()]).chain(spreads.into_iter().flat_map(spread_cells)).collect()
}

/// A figure that no session has is empty, and not zero.
fn spread_cells(spread: Option<v1::Spread>) -> [String; 5] {
    let v1::Spread { n, mean, sd, min, max } = spread.unwrap_or_default();
    if n == 0 {
        return [n.to_string(), String::new(), String::new(), String::new(), String::new()];
    }
    [n.to_string(), mean.to_string(), sd.to_string(), min.to_string(), max.to_string()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_is_a_row_and_what_no_session_has_is_empty() {
        let spread = v1::Spread { n: 2, mean: 1.5, sd: 0.5, min: 1.0, max: 2.0 };
        let group =
            v1::SummaryGroup { key: vec!["mug".into()], n: 2, attempts: Some(spread), ..Default::default() };
        let summary = v1::ExperimentSummary {
            by: vec!["labels.object".into()],
            groups: vec![group],
            ..Default::default()
        };
        let table = table(summary);
        assert_eq!(table[0].len(), 2 + 5 * FIGURES.len());
        assert_eq!(table[0][..4], ["labels.object", "n", "attempts_n", "attempts_mean"]);
        assert_eq!(table[1][..7], ["mug", "2", "2", "1.5", "0.5", "1", "2"]);
        assert_eq!(table[1][table[0].len() - 5..], ["0", "", "", "", ""]);
    }
}
