//! The robot's loop: add what the camera saw, ask where to touch, report what came of it.

use axum::extract::{Path, Request, State};
use http::{HeaderMap, Uri};
use palpate_proto::v1;
use serde::Deserialize;

use super::extract::{
    Params, content_type, file_body, fill_request_id, fill_session_id, json_body, unsupported,
};
use super::json_points;
use super::problem::Problem;
use super::proto_json::{ProtoJson, from_json};
use crate::api::{Api, Call};
use crate::error::Error;

/// What goes with a cloud that is sent as a file; a JSON body says these things itself.
#[derive(Default, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PriorParams {
    /// Uncertainty of these points, in [0, 1]; without it the session's.
    uncertainty: Option<f64>,
    /// The camera's position `x,y,z` in metres, in the session's frame.
    viewpoint: Option<String>,
    /// Edge of the voxels of which each gives the mean of its points, in metres; without it only exact duplicates are
    /// dropped. What is over the limit of a session is thinned to it in any case.
    voxel_m: Option<f64>,
    /// How many candidates to propose in the reply.
    propose: Option<u32>,
    /// The session must be at this revision.
    expected_revision: Option<i64>,
    /// Makes a repeated call safe; the `Idempotency-Key` header does the same.
    request_id: Option<String>,
}

/// Add a camera's view of the object
///
/// The points come as JSON (base64 or number arrays), as a PLY file, or as packed little-endian `f32` triples.
/// What JSON says in fields, a file says in query parameters.
#[utoipa::path(
    post, path = "/v1/sessions/{session_id}/priors", tag = "exploration", operation_id = "add_visual_prior",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ("Idempotency-Key" = Option<String>, Header, description = "The same as `request_id`"),
        PriorParams,
    ),
    request_body(content(
        (ref("#/components/schemas/AddVisualPriorRequest") = "application/json"),
        (ref("#/components/schemas/File") = "application/ply"),
        (ref("#/components/schemas/File") = "application/octet-stream"),
    )),
    responses((
        status = 200, description = "The view is in the log and in the estimate",
        body = ref("#/components/schemas/AddVisualPriorResponse"), content_type = "application/json",
    )),
)]
pub(super) async fn add_prior(
    State(api): State<Api>,
    Path(session_id): Path<String>,
    headers: HeaderMap,
    uri: Uri,
    Params(params): Params<PriorParams>,
    request: Request,
) -> Result<ProtoJson<v1::AddVisualPriorResponse>, Problem> {
    let mut message = match content_type(&headers).as_str() {
        "application/json" => {
            if uri.query().is_some_and(|query| !query.is_empty()) {
                let reason = "a JSON body says everything itself: move the query parameters into it";
                return Err(Error::field("query", reason).into());
            }
            let mut body = json_body(request, api.limits()).await?;
            json_points::pack(&mut body)?;
            from_json(&body)?
        }
        "application/ply" | "application/x-ply" | "model/ply" => {
            from_file(v1::PointEncoding::Ply, file_body(request, api.limits()).await?, params)?
        }
        "application/octet-stream" => {
            from_file(v1::PointEncoding::XyzF32Le, file_body(request, api.limits()).await?, params)?
        }
        other => {
            let taken = "application/json, application/ply (a PLY file) or \
                         application/octet-stream (packed little-endian f32 x, y, z)";
            return Err(unsupported(other, taken));
        }
    };
    fill_session_id(&mut message.session_id, session_id)?;
    fill_request_id(&mut message.request_id, &headers)?;
    Ok(ProtoJson(api.add_visual_prior(message, Call::default()).await?))
}

fn from_file(
    encoding: v1::PointEncoding,
    points: axum::body::Bytes,
    params: PriorParams,
) -> Result<v1::AddVisualPriorRequest, Error> {
    let PriorParams { uncertainty, viewpoint, voxel_m, propose, expected_revision, request_id } = params;
    let prior = v1::VisualPrior {
        encoding: encoding.into(),
        points,
        uncertainty,
        viewpoint: viewpoint.as_deref().map(parse_viewpoint).transpose()?,
        voxel_m,
        capture_time: None,
        depth: None,
    };
    Ok(v1::AddVisualPriorRequest {
        session_id: String::new(),
        prior: Some(prior),
        expected_revision,
        request_id: request_id.unwrap_or_default(),
        propose: propose.unwrap_or_default(),
    })
}

fn parse_viewpoint(text: &str) -> Result<v1::Vector3, Error> {
    let numbers: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match (numbers.as_slice(), text.split(',').count()) {
        (&[x, y, z], 3) => Ok(v1::Vector3 { x, y, z }),
        _ => Err(Error::field("viewpoint", format!("{text:?} is not x,y,z in metres"))),
    }
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
    Path(session_id): Path<String>,
    headers: HeaderMap,
    ProtoJson(mut message): ProtoJson<v1::ProposeContactsRequest>,
) -> Result<ProtoJson<v1::ProposeContactsResponse>, Problem> {
    fill_session_id(&mut message.session_id, session_id)?;
    fill_request_id(&mut message.request_id, &headers)?;
    Ok(ProtoJson(api.propose_contacts(message, Call::default()).await?))
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
    Path(session_id): Path<String>,
    headers: HeaderMap,
    ProtoJson(mut message): ProtoJson<v1::ReportContactRequest>,
) -> Result<ProtoJson<v1::ReportContactResponse>, Problem> {
    fill_session_id(&mut message.session_id, session_id)?;
    fill_request_id(&mut message.request_id, &headers)?;
    Ok(ProtoJson(api.report_contact(message, Call::default()).await?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_viewpoint_is_three_numbers() {
        assert_eq!(parse_viewpoint("0.5, -1,2e-1").unwrap(), v1::Vector3 { x: 0.5, y: -1.0, z: 0.2 });
        for bad in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,3,x"] {
            assert_eq!(parse_viewpoint(bad).unwrap_err().fields()[0].field, "viewpoint", "{bad}");
        }
    }
}
