//! The robot's loop: add what the camera saw, ask where to touch, report what came of it.

use axum::extract::{Path, Request, State};
use http::{HeaderMap, Uri};
use palpate_proto::v1;
use serde_json::Value;

use super::extract::{
    Params, content_type, file_body, fill_request_id, fill_session_id, json_body, unsupported,
};
use super::json_points;
use super::problem::Problem;
use super::proto_json::{ProtoJson, from_json};
use super::view_file::{self, ViewParams};
use crate::api::{Api, Call};
use crate::error::Error;

/// Add a camera's view of the object
///
/// The points come as JSON (base64 or number arrays), as a PLY or PCD file, as packed little-endian `f32` triples, as
/// the bytes of a `sensor_msgs/PointCloud2` (`point_step` and what goes with it), or as a depth image in a PNG file.
/// What JSON says in fields, a file says in query parameters. Bodies may come with `Content-Encoding: gzip`.
#[utoipa::path(
    post, path = "/v1/sessions/{session_id}/priors", tag = "exploration", operation_id = "add_visual_prior",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ("Idempotency-Key" = Option<String>, Header, description = "The same as `request_id`"),
        ViewParams,
    ),
    request_body(content(
        (ref("#/components/schemas/AddVisualPriorRequest") = "application/json"),
        (ref("#/components/schemas/File") = "application/ply"),
        (ref("#/components/schemas/File") = "application/pcd"),
        (ref("#/components/schemas/File") = "image/png"),
        (ref("#/components/schemas/File") = "application/octet-stream"),
    )),
    responses((
        status = 200, description = "The view is in the log and in the estimate",
        body = ref("#/components/schemas/AddVisualPriorResponse"), content_type = "application/json",
    )),
)]
pub(super) async fn add_prior(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
    uri: Uri,
    Params(params): Params<ViewParams>,
    request: Request,
) -> Result<ProtoJson<v1::AddVisualPriorResponse>, Problem> {
    let mut message = match content_type(&headers).as_str() {
        "application/json" => {
            if uri.query().is_some_and(|query| !query.is_empty()) {
                let reason = "a JSON body says everything itself: move the query parameters into it";
                return Err(Error::field("query", reason).into());
            }
            json_body(request, api.limits(), prior_from_json).await?
        }
        media_type => match view_file::encoding(media_type, &params) {
            Some(encoding) => view_file::request(encoding, file_body(request, api.limits()).await?, params)?,
            None => return Err(unsupported(media_type, view_file::TAKEN)),
        },
    };
    fill_session_id(&mut message.session_id, session_id)?;
    fill_request_id(&mut message.request_id, &headers)?;
    Ok(ProtoJson(api.add_visual_prior(message, call).await?))
}

/// A view as a script writes it, whose points may be arrays of numbers.
pub(super) fn prior_from_json(mut body: Value) -> Result<v1::AddVisualPriorRequest, Error> {
    json_points::pack(&mut body)?;
    from_json(&body)
}

/// Propose where to touch next
///
/// Changes nothing unless a lease is asked.
/// That no candidate is left is not an error: the list is then empty, and `should_stop` and `excluded` say why.
#[utoipa::path(
    post, path = "/v1/sessions/{session_id}/candidates", tag = "exploration", operation_id = "propose_contacts",
    params(("session_id" = String, Path, description = "Which session")),
    request_body(content = ref("#/components/schemas/ProposeContactsRequest"), content_type = "application/json"),
    responses((
        status = 200, description = "The candidates, best first",
        body = ref("#/components/schemas/ProposeContactsResponse"), content_type = "application/json",
    )),
)]
pub(super) async fn propose(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
    ProtoJson(mut message): ProtoJson<v1::ProposeContactsRequest>,
) -> Result<ProtoJson<v1::ProposeContactsResponse>, Problem> {
    fill_session_id(&mut message.session_id, session_id)?;
    fill_request_id(&mut message.request_id, &headers)?;
    Ok(ProtoJson(api.propose_contacts(message, call).await?))
}

/// Report what came of an approach
///
/// A failed contact is data, not an error.
/// With `propose`, the next candidates come in the same round trip.
#[utoipa::path(
    post, path = "/v1/sessions/{session_id}/contacts", tag = "exploration", operation_id = "report_contact",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ("Idempotency-Key" = Option<String>, Header, description = "The same as `request_id` in the body"),
    ),
    request_body(content = ref("#/components/schemas/ReportContactRequest"), content_type = "application/json"),
    responses((
        status = 200, description = "The result is in the log and in the estimate",
        body = ref("#/components/schemas/ReportContactResponse"), content_type = "application/json",
    )),
)]
pub(super) async fn report(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
    ProtoJson(mut message): ProtoJson<v1::ReportContactRequest>,
) -> Result<ProtoJson<v1::ReportContactResponse>, Problem> {
    fill_session_id(&mut message.session_id, session_id)?;
    fill_request_id(&mut message.request_id, &headers)?;
    Ok(ProtoJson(api.report_contact(message, call).await?))
}
