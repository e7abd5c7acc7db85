//! Paths of the contract that this version does not serve yet: they say so instead of pretending not to exist.

use axum::Router;
use axum::routing::{MethodFilter, MethodRouter, on};

use super::problem::Problem;
use crate::api::Api;
use crate::error::Error;

/// The paths, answered with `UNIMPLEMENTED`.
pub(super) fn routes() -> Router<Api> {
    Router::new()
        .route("/v1/sessions/{session_id}", later(MethodFilter::PATCH, "UpdateSession"))
        .route("/v1/sessions/{session_id}/finish", later(MethodFilter::POST, "FinishSession"))
        .route("/v1/sessions/{session_id}/fork", later(MethodFilter::POST, "ForkSession"))
        .route("/v1/sessions/{session_id}/events/{seq}/retract", later(MethodFilter::POST, "RetractEvent"))
        .route("/v1/sessions/{session_id}/evaluate", later(MethodFilter::POST, "EvaluateSession"))
        .route("/v1/sessions/{session_id}/series", later(MethodFilter::GET, "the series of a session"))
        .route("/v1/sessions/{session_id}/export", later(MethodFilter::GET, "ExportSession"))
        .route("/v1/imports", later(MethodFilter::POST, "ImportSession"))
        .route("/v1/experiments", later(MethodFilter::GET, "the list of experiments"))
        .route(
            "/v1/experiments/{experiment}/summary",
            later(MethodFilter::GET, "the summary of an experiment"),
        )
}

fn later(method: MethodFilter, what: &'static str) -> MethodRouter<Api> {
    on(method, async move || Problem::from(Error::unimplemented(what)))
}
