//! `/v1/sessions`: create, list, read, remove.

use axum::extract::{Path, State};
use axum::response::Response;
use http::header::LOCATION;
use http::{HeaderMap, StatusCode};
use palpate_proto::v1;
use serde::Deserialize;

use super::extract::{Params, fill_request_id, if_match, parse_labels};
use super::problem::Problem;
use super::proto_json::ProtoJson;
use super::tagged;
use crate::api::{Api, Call};
use crate::error::Error;
use crate::text::quoted;

/// Create a session
///
/// The body may be `{}`: every field has a default.
/// With a `session_id` of your own, or an `Idempotency-Key`, a repeated call is safe.
#[utoipa::path(
    post, path = "/v1/sessions", tag = "sessions", operation_id = "create_session",
    params(("Idempotency-Key" = Option<String>, Header, description = "The same as `request_id` in the body")),
    request_body(content = ref("#/components/schemas/CreateSessionRequest"), content_type = "application/json"),
    responses((
        status = 201, description = "The session, which awaits its visual prior",
        body = ref("#/components/schemas/Session"), content_type = "application/json",
        headers(("Location", description = "Its path"), ("ETag", description = "Its etag")),
    )),
)]
pub(super) async fn create(
    State(api): State<Api>,
    call: Call,
    headers: HeaderMap,
    ProtoJson(mut request): ProtoJson<v1::CreateSessionRequest>,
) -> Result<Response, Problem> {
    fill_request_id(&mut request.request_id, &headers)?;
    let session = api.create_session(request, call).await?;
    let location = [(LOCATION, format!("/v1/sessions/{}", session.session_id))];
    let etag = session.etag.clone();
    // A creation is never "not modified", so the caller's If-None-Match is not looked at.
    Ok(tagged(&HeaderMap::new(), &etag, (StatusCode::CREATED, location, ProtoJson(session))))
}

/// Which sessions to list; all that are given must match.
#[derive(Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ListParams {
    /// Only sessions of this experiment.
    experiment: Option<String>,
    /// Only sessions in this state, for instance `SESSION_STATE_ACTIVE`, or `active`.
    state: Option<String>,
    /// Only sessions that carry all of these labels: `object:bottle,strategy:random`.
    labels: Option<String>,
    /// At most this many; larger values are capped.
    #[param(minimum = 0)]
    page_size: Option<i32>,
    /// `next_page_token` of the page before.
    page_token: Option<String>,
}

/// List sessions, newest first
#[utoipa::path(
    get, path = "/v1/sessions", tag = "sessions", operation_id = "list_sessions", params(ListParams),
    responses((
        status = 200, description = "A page of sessions",
        body = ref("#/components/schemas/ListSessionsResponse"), content_type = "application/json",
    )),
)]
pub(super) async fn list(
    State(api): State<Api>,
    call: Call,
    Params(params): Params<ListParams>,
) -> Result<ProtoJson<v1::ListSessionsResponse>, Problem> {
    let ListParams { experiment, state, labels, page_size, page_token } = params;
    let request = v1::ListSessionsRequest {
        page_size: page_size.unwrap_or_default(),
        page_token: page_token.unwrap_or_default(),
        experiment: experiment.unwrap_or_default(),
        labels: labels.as_deref().map(parse_labels).transpose()?.unwrap_or_default(),
        state: state.as_deref().map(parse_state).transpose()?.unwrap_or_default().into(),
    };
    Ok(ProtoJson(api.list_sessions(request, call).await?))
}

/// Read a session
#[utoipa::path(
    get, path = "/v1/sessions/{session_id}", tag = "sessions", operation_id = "get_session",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ("If-None-Match" = Option<String>, Header, description = "The ETag that is known already"),
    ),
    responses(
        (
            status = 200, description = "The session at its newest revision",
            body = ref("#/components/schemas/Session"), content_type = "application/json",
            headers(("ETag", description = "Its etag")),
        ),
        (status = 304, description = "It is still what `If-None-Match` names"),
    ),
)]
pub(super) async fn get(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let session = api.get_session(v1::GetSessionRequest { session_id }, call).await?;
    let etag = session.etag.clone();
    Ok(tagged(&headers, &etag, ProtoJson(session)))
}

/// Remove a session with all its events, for good
#[utoipa::path(
    delete, path = "/v1/sessions/{session_id}", tag = "sessions", operation_id = "delete_session",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ("If-Match" = Option<String>, Header, description = "Remove it only if it still has this ETag"),
        ("Idempotency-Key" = Option<String>, Header, description = "Makes a repeated call safe"),
    ),
    responses((status = 204, description = "It is gone")),
)]
pub(super) async fn delete(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
) -> Result<StatusCode, Problem> {
    let mut request =
        v1::DeleteSessionRequest { session_id, etag: if_match(&headers), request_id: String::new() };
    fill_request_id(&mut request.request_id, &headers)?;
    let v1::DeleteSessionResponse {} = api.delete_session(request, call).await?;
    Ok(StatusCode::NO_CONTENT)
}

fn parse_state(text: &str) -> Result<v1::SessionState, Error> {
    const PREFIX: &str = "SESSION_STATE_";
    let upper = text.to_ascii_uppercase();
    let name = format!("{PREFIX}{}", upper.strip_prefix(PREFIX).unwrap_or(&upper));
    v1::SessionState::from_str_name(&name).ok_or_else(|| {
        let known = "awaiting_prior, active, finished and quarantined";
        Error::field("state", format!("{} is no state: there are {known}", quoted(text)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_known_by_short_and_by_full_name() {
        assert_eq!(parse_state("active").unwrap(), v1::SessionState::Active);
        assert_eq!(parse_state("SESSION_STATE_AWAITING_PRIOR").unwrap(), v1::SessionState::AwaitingPrior);
        assert_eq!(parse_state("sleeping").unwrap_err().fields()[0].field, "state");
    }
}
