//! What operators and probes ask: is it alive, is it ready, what is it.

use axum::extract::State;
use axum::response::IntoResponse;
use http::header::CONTENT_TYPE;
use palpate_proto::v1;

use super::problem::Problem;
use super::proto_json::ProtoJson;
use crate::access::Scope;
use crate::api::{Api, Call};
use crate::metrics;

/// Does the process answer?
#[utoipa::path(get, path = "/healthz", tag = "operations", responses((status = 200, description = "Yes", body = String)))]
pub(super) async fn healthz() -> &'static str {
    "ok\n"
}

/// Does the process answer?
#[utoipa::path(get, path = "/livez", tag = "operations", responses((status = 200, description = "Yes", body = String)))]
pub(super) async fn livez() -> &'static str {
    "ok\n"
}

/// May traffic be sent here?
///
/// Only when a row could be written to the database, the disk reads it, and the server is not about to stop. More
/// lines follow where sessions are quarantined, or acknowledged events were missing when the server started.
#[utoipa::path(get, path = "/readyz", tag = "operations", responses((status = 200, description = "Yes", body = String)))]
pub(super) async fn readyz(State(api): State<Api>) -> Result<String, Problem> {
    api.ready().await?;
    let (quarantined, missing) = api.losses().await?;
    let line = |name: &str, count: i64| if count > 0 { format!("{name}: {count}\n") } else { String::new() };
    Ok(["ready\n", &line("quarantined sessions", quarantined), &line("missing events", missing)].concat())
}

/// What Prometheus scrapes
///
/// Counts since the start, times as histograms, and how things are now; each series says what it is.
#[utoipa::path(get, path = "/metrics", tag = "operations", responses((status = 200, description = "The text format of Prometheus", body = String)))]
pub(super) async fn metrics(State(api): State<Api>, call: Call) -> Result<impl IntoResponse, Problem> {
    // They are about all experiments.
    call.caller.check_whole_server(Scope::Read)?;
    Ok(([(CONTENT_TYPE, metrics::CONTENT_TYPE)], api.scrape().await))
}

/// Versions, capabilities and limits
#[utoipa::path(
    get, path = "/version", tag = "operations",
    responses((
        status = 200, description = "What the server is and can do",
        body = ref("#/components/schemas/ServerInfo"), content_type = "application/json",
    )),
)]
pub(super) async fn version(
    State(api): State<Api>,
    call: Call,
) -> Result<ProtoJson<v1::ServerInfo>, Problem> {
    Ok(ProtoJson(api.get_server_info(call).await?))
}
