//! Paths of the contract that this version does not serve yet: each says so.

use axum::Router;
use axum::routing::{MethodFilter, MethodRouter, on};

use super::problem::Problem;
use crate::api::Api;
use crate::error::Error;

/// The paths, answered with `UNIMPLEMENTED`.
pub(super) fn routes() -> Router<Api> {
    Router::new()
        .route("/v1/sessions/{session_id}", unavailable(MethodFilter::PATCH, "UpdateSession"))
        .route("/v1/sessions/{session_id}/finish", unavailable(MethodFilter::POST, "FinishSession"))
        .route("/v1/sessions/{session_id}/fork", unavailable(MethodFilter::POST, "ForkSession"))
        .route(
            "/v1/sessions/{session_id}/events/{seq}/retract",
            unavailable(MethodFilter::POST, "RetractEvent"),
        )
        .route("/v1/sessions/{session_id}/evaluate", unavailable(MethodFilter::POST, "EvaluateSession"))
        .route("/v1/sessions/{session_id}/series", unavailable(MethodFilter::GET, "the series of a session"))
        .route("/v1/sessions/{session_id}/export", unavailable(MethodFilter::GET, "ExportSession"))
        .route("/v1/imports", unavailable(MethodFilter::POST, "ImportSession"))
        .route("/v1/experiments", unavailable(MethodFilter::GET, "the list of experiments"))
        .route(
            "/v1/experiments/{experiment}/summary",
            unavailable(MethodFilter::GET, "the summary of an experiment"),
        )
}

fn unavailable(method: MethodFilter, what: &'static str) -> MethodRouter<Api> {
    on(method, async move || Problem::from(Error::unimplemented(what)))
}
