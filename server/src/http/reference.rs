//! The reference mesh that a session keeps, as the file that it is.

use axum::extract::{Path, Request, State};
use axum::response::{IntoResponse, Response};
use http::header::{CONTENT_DISPOSITION, CONTENT_TYPE, VARY};
use http::{HeaderMap, StatusCode};
use palpate_proto::v1;
use serde::Deserialize;

use super::extract::{Params, content_type, mesh_body, unsupported};
use super::problem::Problem;
use super::proto_json::ProtoJson;
use super::{negotiation, tagged};
use crate::api::{Api, Call};

/// The media types of files that are taken, for refusals.
pub(super) const TAKEN: &str = "application/ply, model/stl, model/obj, or application/octet-stream (told apart by the \
                                first bytes)";

/// How a file of this media type is to be read, unspecified meaning by its first bytes; `None` where it is no mesh.
pub(super) fn mesh_format(media_type: &str) -> Option<v1::MeshFormat> {
    match media_type {
        "model/ply" | "application/ply" | "application/x-ply" => Some(v1::MeshFormat::Ply),
        "model/stl"
        | "model/x.stl-binary"
        | "model/x.stl-ascii"
        | "application/sla"
        | "application/vnd.ms-pki.stl" => Some(v1::MeshFormat::Stl),
        "model/obj" => Some(v1::MeshFormat::Obj),
        "application/octet-stream" | "text/plain" => Some(v1::MeshFormat::Unspecified),
        _ => None,
    }
}

/// What goes with a reference mesh that is sent as a file.
#[derive(Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct SetParams {
    /// Metres in one unit of the file: 0.001 for millimetres; 1 without it.
    metres_per_unit: Option<f64>,
}

/// Keep a reference mesh with a session
///
/// The true surface, in the session's frame, as a PLY, STL or OBJ file, in place of an earlier one.
/// The series of the session and the summary of its experiment then show the true error. The estimate does not know of
/// it, and the session's revision stays as it is.
#[utoipa::path(
    put, path = "/v1/sessions/{session_id}/reference", tag = "evaluation", operation_id = "set_reference",
    params(("session_id" = String, Path, description = "Which session"), SetParams),
    request_body(content(
        (ref("#/components/schemas/File") = "application/ply"),
        (ref("#/components/schemas/File") = "model/stl"),
        (ref("#/components/schemas/File") = "model/obj"),
        (ref("#/components/schemas/File") = "application/octet-stream"),
    )),
    responses((
        status = 200, description = "It is kept; `mesh` is empty here",
        body = ref("#/components/schemas/Reference"), content_type = "application/json",
        headers(("ETag", description = "The SHA-256 of the file")),
    )),
)]
pub(super) async fn set(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
    Params(params): Params<SetParams>,
    request: Request,
) -> Result<Response, Problem> {
    let media_type = content_type(&headers);
    let Some(format) = mesh_format(&media_type) else { return Err(unsupported(&media_type, TAKEN)) };
    let mesh = mesh_body(request, api.limits()).await?;
    let metres_per_unit = params.metres_per_unit.unwrap_or_default();
    let request = v1::SetReferenceRequest { session_id, mesh, format: format.into(), metres_per_unit };
    let reference = api.set_reference(request, call).await?;
    let etag = reference.sha256.clone();
    // A change is never "not modified", so the caller's If-None-Match is not looked at.
    Ok(tagged(&HeaderMap::new(), &etag, ProtoJson(reference)))
}

/// Download the reference mesh of a session
///
/// The file as it was sent; with `Accept: application/json` what is known of it, without the file.
#[utoipa::path(
    get, path = "/v1/sessions/{session_id}/reference", tag = "evaluation", operation_id = "get_reference",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ("If-None-Match" = Option<String>, Header, description = "The ETag that is known already"),
    ),
    responses(
        (
            status = 200, description = "The file, in the unit that it was sent in",
            content(
                (ref("#/components/schemas/File") = "model/ply"),
                (ref("#/components/schemas/File") = "model/stl"),
                (ref("#/components/schemas/File") = "model/obj"),
                (ref("#/components/schemas/Reference") = "application/json"),
            ),
            headers(("ETag", description = "The SHA-256 of the file")),
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
    let without_mesh = negotiation::names(&headers, "application/json");
    let request = v1::GetReferenceRequest { session_id: session_id.clone(), without_mesh };
    let reference = api.get_reference(request, call).await?;
    let etag = reference.sha256.clone();
    let body = if without_mesh { ProtoJson(reference).into_response() } else { file(reference, &session_id) };
    Ok(([(VARY, "accept")], tagged(&headers, &etag, body)).into_response())
}

fn file(reference: v1::Reference, session_id: &str) -> Response {
    let (media_type, extension) = match reference.format() {
        v1::MeshFormat::Stl => ("model/stl", "stl"),
        v1::MeshFormat::Obj => ("model/obj", "obj"),
        // No other format is ever kept.
        _ => ("model/ply", "ply"),
    };
    let name = format!("inline; filename=\"{session_id}-reference.{extension}\"");
    ([(CONTENT_TYPE, media_type.to_owned()), (CONTENT_DISPOSITION, name)], reference.mesh).into_response()
}

/// Forget the reference mesh of a session
///
/// That it keeps none is no error.
#[utoipa::path(
    delete, path = "/v1/sessions/{session_id}/reference", tag = "evaluation", operation_id = "delete_reference",
    params(("session_id" = String, Path, description = "Which session")),
    responses((status = 204, description = "The session keeps none")),
)]
pub(super) async fn delete(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
) -> Result<StatusCode, Problem> {
    let request = v1::DeleteReferenceRequest { session_id };
    let v1::DeleteReferenceResponse {} = api.delete_reference(request, call).await?;
    Ok(StatusCode::NO_CONTENT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn media_types_of_meshes_say_the_format_or_leave_it_to_the_bytes() {
        assert_eq!(mesh_format("application/sla"), Some(v1::MeshFormat::Stl));
        assert_eq!(mesh_format("text/plain"), Some(v1::MeshFormat::Unspecified));
        assert_eq!(mesh_format("application/x-www-form-urlencoded"), None);
    }
}
