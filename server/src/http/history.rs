//! Changes of a session that bring no evidence, and its history again: rename, finish, fork, retract, replay.

use axum::body::Body;
use axum::extract::{Path, Request, State};
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use http::header::{CONTENT_TYPE, IF_MATCH, LOCATION};
use http::{HeaderMap, StatusCode};
use palpate_proto::{FieldMask, v1};
use serde::Deserialize;
use serde_json::Value;

use super::extract::{Params, fill_request_id, fill_session_id, if_match, json_body, require_json, text};
use super::problem::Problem;
use super::proto_json::{ProtoJson, from_json, to_json};
use super::tagged;
use crate::api::{Api, Call};
use crate::error::Error;

/// Rename a session, or change its labels
///
/// The body has what is to change, `display_name` or `labels` or both; labels are replaced as a whole.
/// `If-Match` is required, so that nobody undoes what another one changed without having read it.
#[utoipa::path(
    patch, path = "/v1/sessions/{session_id}", tag = "sessions", operation_id = "update_session",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ("If-Match" = String, Header, description = "The ETag of the session as it was read, or `*`"),
        ("Idempotency-Key" = Option<String>, Header, description = "Makes a repeated call safe"),
    ),
    request_body(
        content = ref("#/components/schemas/Session"), content_type = "application/json",
        description = "`display_name`, `labels` or both",
    ),
    responses((
        status = 200, description = "The session after the change",
        body = ref("#/components/schemas/Session"), content_type = "application/json",
        headers(("ETag", description = "Its new etag")),
    )),
)]
pub(super) async fn update(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, Problem> {
    require_json(&headers)?;
    let mut message = json_body(request, api.limits(), |body| update_of(&body)).await?;
    let session = message.session.get_or_insert_default();
    fill_session_id(&mut session.session_id, session_id.clone())?;
    if text(&headers, &IF_MATCH) == Some("*") {
        session.etag = api.get_session(v1::GetSessionRequest { session_id }, call.clone()).await?.etag;
    } else if headers.contains_key(IF_MATCH) {
        session.etag = if_match(&headers);
    }
    fill_request_id(&mut message.request_id, &headers)?;
    session_reply(StatusCode::OK, api.update_session(message, call).await?)
}

/// A body with the fields that change, or an `UpdateSessionRequest`.
fn update_of(body: &Value) -> Result<v1::UpdateSessionRequest, Error> {
    let Value::Object(fields) = body else {
        return Err(Error::field("body", "is no object: send display_name, labels or both"));
    };
    if fields.contains_key("session") || fields.contains_key("update_mask") {
        return from_json(body);
    }
    // An etag in the body says which session was read, and is nothing to change.
    let paths = fields.keys().filter(|&name| name != "session_id" && name != "etag").cloned().collect();
    let session: v1::Session = from_json(body)?;
    let update_mask = Some(FieldMask { paths });
    Ok(v1::UpdateSessionRequest { session: Some(session), update_mask, request_id: String::new() })
}

/// Finish a session
///
/// It stays readable, takes no further event, and can be forked.
#[utoipa::path(
    post, path = "/v1/sessions/{session_id}/finish", tag = "sessions", operation_id = "finish_session",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ("If-Match" = Option<String>, Header, description = "Finish it only if it still has this ETag"),
        ("Idempotency-Key" = Option<String>, Header, description = "The same as `request_id` in the body"),
    ),
    request_body(content = ref("#/components/schemas/FinishSessionRequest"), content_type = "application/json"),
    responses((
        status = 200, description = "The finished session",
        body = ref("#/components/schemas/Session"), content_type = "application/json",
        headers(("ETag", description = "Its new etag")),
    )),
)]
pub(super) async fn finish(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
    ProtoJson(mut message): ProtoJson<v1::FinishSessionRequest>,
) -> Result<Response, Problem> {
    fill_session_id(&mut message.session_id, session_id)?;
    fill_request_id(&mut message.request_id, &headers)?;
    if message.etag.is_empty() {
        message.etag = if_match(&headers);
    }
    session_reply(StatusCode::OK, api.finish_session(message, call).await?)
}

/// Fork a session
///
/// The same touches under another method, strategy or symmetry: `config` has the new values, `config_mask` their names.
/// The copy is computed anew, which takes as long as its touches take together; with an `Idempotency-Key` a call that
/// ran out of time can be repeated until it is done.
#[utoipa::path(
    post, path = "/v1/sessions/{session_id}/fork", tag = "sessions", operation_id = "fork_session",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ("Idempotency-Key" = Option<String>, Header, description = "The same as `request_id` in the body"),
    ),
    request_body(content = ref("#/components/schemas/ForkSessionRequest"), content_type = "application/json"),
    responses((
        status = 201, description = "The fork",
        body = ref("#/components/schemas/Session"), content_type = "application/json",
        headers(("Location", description = "Its path"), ("ETag", description = "Its etag")),
    )),
)]
pub(super) async fn fork(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
    ProtoJson(mut message): ProtoJson<v1::ForkSessionRequest>,
) -> Result<Response, Problem> {
    fill_session_id(&mut message.session_id, session_id)?;
    fill_request_id(&mut message.request_id, &headers)?;
    session_reply(StatusCode::CREATED, api.fork_session(message, call).await?)
}

/// Retract an event
///
/// A view or a result is taken out of the estimate, as if it had never been reported; the log keeps it, with the reason.
#[utoipa::path(
    post, path = "/v1/sessions/{session_id}/events/{seq}/retract", tag = "exploration", operation_id = "retract_event",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ("seq" = i64, Path, description = "Which event"),
        ("Idempotency-Key" = Option<String>, Header, description = "The same as `request_id` in the body"),
    ),
    request_body(content = ref("#/components/schemas/RetractEventRequest"), content_type = "application/json"),
    responses((
        status = 200, description = "The session without the event",
        body = ref("#/components/schemas/Session"), content_type = "application/json",
        headers(("ETag", description = "Its new etag")),
    )),
)]
pub(super) async fn retract(
    State(api): State<Api>,
    call: Call,
    Path((session_id, seq)): Path<(String, String)>,
    headers: HeaderMap,
    ProtoJson(mut message): ProtoJson<v1::RetractEventRequest>,
) -> Result<Response, Problem> {
    let seq: i64 = seq.parse().map_err(|_| Error::field("seq", format!("{seq:?} is no event's number")))?;
    if message.seq != 0 && message.seq != seq {
        let description = format!("{} is not {seq}, which the path says: give it once", message.seq);
        return Err(Error::field("seq", description).into());
    }
    message.seq = seq;
    fill_session_id(&mut message.session_id, session_id)?;
    fill_request_id(&mut message.request_id, &headers)?;
    session_reply(StatusCode::OK, api.retract_event(message, call).await?)
}

/// Which steps to show again, and how.
#[derive(Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ReplayParams {
    /// First revision to show; from the creation on if it is left out.
    from_revision: Option<i64>,
    /// Last revision to show; up to the newest if it is left out.
    to_revision: Option<i64>,
    /// Show the mesh, packed, after each event that changed it.
    include_mesh: Option<bool>,
    /// Compute each state again and compare its hash with the recorded one: see `hash_matches`.
    verify: Option<bool>,
}

/// Replay a session
///
/// Each line is a `WatchSessionResponse` as JSON: an event with the session after it, or the mesh.
/// A stream that breaks ends with a line that has a `problem`.
#[utoipa::path(
    get, path = "/v1/sessions/{session_id}/replay", tag = "reconstruction", operation_id = "replay_session",
    params(("session_id" = String, Path, description = "Which session"), ReplayParams),
    responses((
        status = 200, description = "One `WatchSessionResponse` a line",
        content((ref("#/components/schemas/WatchSessionResponse") = "application/x-ndjson")),
    )),
)]
pub(super) async fn replay(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    Params(params): Params<ReplayParams>,
) -> Result<Response, Problem> {
    let ReplayParams { from_revision, to_revision, include_mesh, verify } = params;
    let request = v1::ReplaySessionRequest {
        session_id,
        from_revision: from_revision.unwrap_or_default(),
        to_revision: to_revision.unwrap_or_default(),
        include_mesh: include_mesh.unwrap_or_default(),
        verify: verify.unwrap_or_default(),
    };
    let steps = api.replay_session(request, call).await?;
    let lines = steps.map(|step| {
        let line = step.and_then(|step| to_json(&step));
        let line = line.unwrap_or_else(|error| format!("{{\"problem\":{}}}", Problem::from(error).to_json()));
        Ok::<_, std::convert::Infallible>(line + "\n")
    });
    Ok(([(CONTENT_TYPE, "application/x-ndjson")], Body::from_stream(lines)).into_response())
}

/// A session after a change.
pub(super) fn session_reply(status: StatusCode, session: v1::Session) -> Result<Response, Problem> {
    let location = [(LOCATION, format!("/v1/sessions/{}", session.session_id))];
    let etag = session.etag.clone();
    let body = (status, ProtoJson(session));
    // A change is never "not modified", so the caller's If-None-Match is not looked at.
    Ok(match status {
        StatusCode::CREATED => tagged(&HeaderMap::new(), &etag, (location, body).into_response()),
        _ => tagged(&HeaderMap::new(), &etag, body),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fields_of_a_body_are_what_changes() {
        let body = serde_json::json!({"display_name": "A mug", "etag": "3-a"});
        let message = update_of(&body).unwrap();
        assert_eq!(message.update_mask.unwrap().paths, ["display_name"]);
        assert_eq!(message.session.unwrap().etag, "3-a");
        let body = serde_json::json!({"session": {"labels": {"a": "b"}}, "update_mask": "labels"});
        let message = update_of(&body).unwrap();
        assert_eq!(message.update_mask.unwrap().paths, ["labels"]);
        assert!(update_of(&serde_json::json!([])).is_err());
        assert!(update_of(&serde_json::json!({"name": "x"})).is_err());
    }
}
