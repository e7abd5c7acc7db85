//! `GET` and `PUT /v1/log-level`: a route of the program around the server, since the log is the program's.

use std::time::Duration;

use axum::extract::rejection::JsonRejection;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use http::StatusCode;
use serde::Deserialize;
use serde_json::json;

use crate::commands::simulations::problem;
use crate::log::{self, Setting};

/// The longest while; whoever wants more sets it for good.
const LONGEST: Duration = Duration::from_secs(7 * 24 * 3600);

/// What is to be logged.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wanted {
    filter: String,
    /// For how many seconds; for good unless given.
    #[serde(default)]
    for_s: Option<f64>,
}

/// The route. It is for operators alone: a layer that lets nobody else in goes around it.
pub(in crate::commands) fn router() -> Router {
    Router::new().route("/v1/log-level", get(show).put(change))
}

async fn show() -> Response {
    match log::level() {
        Some(level) => answer(&level.now()),
        None => no_log(),
    }
}

async fn change(body: Result<Json<Wanted>, JsonRejection>) -> Response {
    let Json(Wanted { filter, for_s }) = match body {
        Ok(wanted) => wanted,
        Err(rejection) => return problem(rejection.status(), "BODY_INVALID", "", &rejection.body_text()),
    };
    let invalid = |field, text: &str| problem(StatusCode::UNPROCESSABLE_ENTITY, "FIELD_INVALID", field, text);
    let time = match for_s.map(Duration::try_from_secs_f64) {
        None => None,
        Some(Ok(time)) if !time.is_zero() && time <= LONGEST => Some(time),
        Some(_) => return invalid("for_s", "must be above 0 and at most 604800, which is a week"),
    };
    let Some(level) = log::level() else { return no_log() };
    match level.set(&filter, time) {
        Ok(setting) => {
            tracing::warn!(filter, for_s, "the log level was changed");
            answer(&setting)
        }
        Err(text) => invalid("filter", &text),
    }
}

fn answer(setting: &Setting) -> Response {
    let until = setting.until.as_ref().map(|(at, _)| humantime::format_rfc3339_seconds(*at).to_string());
    let then = setting.until.as_ref().map(|(_, filter)| filter);
    Json(json!({ "filter": setting.filter, "until": until, "then": then })).into_response()
}

fn no_log() -> Response {
    problem(StatusCode::NOT_FOUND, "NO_LOG", "", "the program around this server keeps no log")
}
