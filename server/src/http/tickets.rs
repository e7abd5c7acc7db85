//! Tickets for what cannot set headers: an `EventSource`, a link.

use axum::extract::State;
use axum::routing::post;
use axum::{Json, Router};
use http::StatusCode;
use serde::Serialize;

use super::problem::Problem;
use crate::access::TICKET_LASTS;
use crate::access::guard::Guard;
use crate::api::Call;

/// What opens one `GET`.
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Ticket {
    /// Goes into the query of the URL: `?ticket=...`.
    ticket: String,
    /// How long it is good for, in seconds.
    expires_in_s: u64,
}

/// Where tickets are given out.
pub(super) fn router(guard: Guard) -> Router {
    Router::new().route("/v1/tickets", post(issue)).with_state(guard)
}

/// Get a ticket in place of a token
///
/// A ticket opens one `GET`, with `?ticket=` in its URL, for what the caller may read: a page cannot give an
/// `EventSource` or a link the header that a token comes in, and a token does not belong into a URL, which is written
/// down in many places.
#[utoipa::path(
    post, path = "/v1/tickets", tag = "operations", operation_id = "issue_ticket",
    responses((status = 201, description = "Good for one request, within a minute", body = Ticket)),
)]
pub(super) async fn issue(
    State(guard): State<Guard>,
    call: Call,
) -> Result<(StatusCode, Json<Ticket>), Problem> {
    let ticket = guard.ticket(&call.caller).await?;
    Ok((StatusCode::CREATED, Json(Ticket { ticket, expires_in_s: TICKET_LASTS.as_secs() })))
}
