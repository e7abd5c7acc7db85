//! Paths of the contract that this version does not serve yet: each says so.

use axum::Router;
use axum::routing::{MethodFilter, on};

use super::problem::Problem;
use crate::api::Api;
use crate::error::Error;

/// Method, path, and what it will be.
const PATHS: [(MethodFilter, &str, &str); 10] = [
    (MethodFilter::PATCH, "/v1/sessions/{session_id}", "UpdateSession"),
    (MethodFilter::POST, "/v1/sessions/{session_id}/finish", "FinishSession"),
    (MethodFilter::POST, "/v1/sessions/{session_id}/fork", "ForkSession"),
    (MethodFilter::POST, "/v1/sessions/{session_id}/events/{seq}/retract", "RetractEvent"),
    (MethodFilter::POST, "/v1/sessions/{session_id}/evaluate", "EvaluateSession"),
    (MethodFilter::GET, "/v1/sessions/{session_id}/series", "the series of a session"),
    (MethodFilter::GET, "/v1/sessions/{session_id}/export", "ExportSession"),
    (MethodFilter::POST, "/v1/imports", "ImportSession"),
    (MethodFilter::GET, "/v1/experiments", "the list of experiments"),
    (MethodFilter::GET, "/v1/experiments/{experiment}/summary", "the summary of an experiment"),
];

/// The paths, answered with `UNIMPLEMENTED`.
pub(super) fn routes() -> Router<Api> {
    PATHS.into_iter().fold(Router::new(), |router, (method, path, what)| {
        router.route(path, on(method, async move || Problem::from(Error::unimplemented(what))))
    })
}

/// The same for people who read the documentation.
pub(super) fn notice() -> String {
    let paths = PATHS.map(|(method, path, what)| format!("- `{} {path}`: {what}", name(method)));
    format!("These paths are answered with 501 in this version:\n\n{}", paths.join("\n"))
}

fn name(method: MethodFilter) -> &'static str {
    match method {
        MethodFilter::GET => "GET",
        MethodFilter::PATCH => "PATCH",
        _ => "POST",
    }
}
