//! The log of a session: a page of it as JSON, or all that comes as server-sent events.

use std::convert::Infallible;
use std::time::Duration;

use axum::extract::{Path, State};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use http::{HeaderMap, HeaderName};
use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use palpate_proto::v1::watch_session_response::Update;
use serde::Deserialize;

use super::extract::{Params, text};
use super::negotiation;
use super::problem::Problem;
use super::proto_json::{ProtoJson, to_json};
use crate::api::{Api, Call, WatchUpdate};
use crate::error::Error;

/// A comment is sent after this long without an event, so that a dead connection is noticed.
const HEARTBEAT: Duration = Duration::from_secs(15);

const LAST_EVENT_ID: HeaderName = HeaderName::from_static("last-event-id");

/// Which events, and how.
#[derive(Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct EventsParams {
    /// Page only: at most this many events; larger values are capped.
    #[param(minimum = 0)]
    page_size: Option<i32>,
    /// Page only: `next_page_token` of the page before.
    page_token: Option<String>,
    /// Page only: include the bytes of visual priors.
    include_points: Option<bool>,
    /// Stream only: events after this revision; a `Last-Event-ID` header takes its place.
    after_revision: Option<i64>,
    /// Stream only: send the mesh, packed, after each event that changed it.
    include_mesh: Option<bool>,
}

/// Read or follow the log of a session
///
/// With `Accept: text/event-stream` the answer is a stream: first the events after a known revision, then each new
/// one as it is accepted.
/// The id of an event is its revision, so a browser that reconnects goes on where it stopped.
/// Event names are `created`, `forked`, `visual_prior`, `contact_result`, `lease`, `retracted`, `updated`, `finished`,
/// `mesh` and `problem`.
#[utoipa::path(
    get, path = "/v1/sessions/{session_id}/events", tag = "reconstruction", operation_id = "list_or_watch_events",
    params(
        ("session_id" = String, Path, description = "Which session"),
        EventsParams,
        ("Last-Event-ID" = Option<i64>, Header, description = "Stream only: the last revision that is known already"),
    ),
    responses((
        status = 200, description = "A page, or a stream whose data are `WatchSessionResponse` objects",
        content(
            (ref("#/components/schemas/ListEventsResponse") = "application/json"),
            (ref("#/components/schemas/WatchSessionResponse") = "text/event-stream"),
        ),
    )),
)]
pub(super) async fn get(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    Params(params): Params<EventsParams>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    if negotiation::names(&headers, "text/event-stream") {
        stream(&api, session_id, params, &headers, call).await
    } else {
        page(&api, session_id, params, &headers, call).await
    }
}

async fn page(
    api: &Api,
    session_id: String,
    params: EventsParams,
    headers: &HeaderMap,
    call: Call,
) -> Result<Response, Problem> {
    let EventsParams { page_size, page_token, include_points, after_revision, include_mesh } = params;
    refuse_other_form(
        after_revision.is_some() || include_mesh.is_some(),
        "after_revision and include_mesh belong to the stream: add the header Accept: text/event-stream",
    )?;
    if headers.contains_key(LAST_EVENT_ID) {
        let reason = "belongs to the stream: add the header Accept: text/event-stream";
        return Err(Error::field("Last-Event-ID", reason).into());
    }
    let request = v1::ListEventsRequest {
        session_id,
        page_size: page_size.unwrap_or_default(),
        page_token: page_token.unwrap_or_default(),
        include_points: include_points.unwrap_or_default(),
    };
    Ok(ProtoJson(api.list_events(request, call).await?).into_response())
}

async fn stream(
    api: &Api,
    session_id: String,
    params: EventsParams,
    headers: &HeaderMap,
    call: Call,
) -> Result<Response, Problem> {
    let EventsParams { page_size, page_token, include_points, after_revision, include_mesh } = params;
    refuse_other_form(
        page_size.is_some() || page_token.is_some() || include_points.is_some(),
        "page_size, page_token and include_points belong to pages: leave out Accept: text/event-stream",
    )?;
    let request = v1::WatchSessionRequest {
        session_id,
        after_revision: last_event_id(headers)?.or(after_revision).unwrap_or_default(),
        include_mesh: include_mesh.unwrap_or_default(),
        heartbeat: None,
    };
    let updates = api.watch_session(request, call).await?;
    let events = updates.filter_map(async |update| {
        let event = update.and_then(|update| event(&update));
        event.unwrap_or_else(|error| Some(problem_event(error))).map(Ok::<Event, Infallible>)
    });
    Ok(Sse::new(events).keep_alive(KeepAlive::new().interval(HEARTBEAT).text("heartbeat")).into_response())
}

/// One update as an event; `None` for a sign of life, which here is a comment.
fn event(update: &WatchUpdate) -> Result<Option<Event>, Error> {
    let WatchUpdate { message, rendering } = update;
    let event = match &message.update {
        Some(Update::Event(event)) => Event::default().id(event.seq.to_string()).event(event_name(event)),
        Some(Update::Mesh(_)) => Event::default().event("mesh"),
        Some(Update::Heartbeat(_)) | None => return Ok(None),
    };
    let Some(rendering) = rendering else { return Ok(Some(event.data(to_json(message)?))) };
    if rendering.get().is_none() {
        // Whoever is first; two at once make the same text.
        let _ = rendering.set(to_json(message)?);
    }
    Ok(rendering.get().map(|text| event.data(text)))
}

fn event_name(event: &v1::Event) -> &'static str {
    match event.kind {
        Some(Kind::Created(_)) => "created",
        Some(Kind::VisualPrior(_)) => "visual_prior",
        Some(Kind::ContactResult(_)) => "contact_result",
        Some(Kind::RetractedSeq(_)) => "retracted",
        Some(Kind::Finished(_)) => "finished",
        Some(Kind::Lease(_)) => "lease",
        Some(Kind::Forked(_)) => "forked",
        Some(Kind::Updated(_)) => "updated",
        None => "unknown",
    }
}

/// A stream that began well has no status left to change, so what breaks it is an event of its own.
fn problem_event(error: Error) -> Event {
    Event::default().event("problem").data(Problem::from(error).to_json())
}

fn last_event_id(headers: &HeaderMap) -> Result<Option<i64>, Error> {
    let Some(id) = text(headers, &LAST_EVENT_ID) else { return Ok(None) };
    id.parse().map(Some).map_err(|_| Error::field("Last-Event-ID", format!("{id:?} is not a revision")))
}

fn refuse_other_form(is_present: bool, reason: &str) -> Result<(), Error> {
    if is_present { Err(Error::field("query", reason)) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use http::HeaderValue;

    use super::*;

    #[test]
    fn a_heartbeat_is_no_event() {
        let beat = v1::WatchSessionResponse {
            update: Some(Update::Heartbeat(v1::Ping::default())),
            ..v1::WatchSessionResponse::default()
        };
        assert!(event(&WatchUpdate { message: beat, rendering: None }).unwrap().is_none());
    }

    #[test]
    fn the_last_event_id_must_be_a_revision() {
        let mut headers = HeaderMap::new();
        assert_eq!(last_event_id(&headers).unwrap(), None);
        headers.insert("Last-Event-ID", HeaderValue::from_static("12"));
        assert_eq!(last_event_id(&headers).unwrap(), Some(12));
        headers.insert("Last-Event-ID", HeaderValue::from_static("twelve"));
        assert_eq!(last_event_id(&headers).unwrap_err().fields()[0].field, "Last-Event-ID");
    }
}
