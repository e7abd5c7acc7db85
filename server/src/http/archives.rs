//! A session as a file, out and in.

use axum::body::Body;
use axum::extract::{Path, Request, State};
use axum::response::{IntoResponse, Response};
use futures_util::{Stream, StreamExt, stream};
use http::header::{CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_TYPE};
use http::{HeaderMap, StatusCode};
use palpate_proto::v1;
use palpate_proto::v1::import_session_request::Part;
use serde::Deserialize;

use super::extract::{Params, content_type, fill_request_id, parse_labels, require_decoded, unsupported};
use super::history::session_reply;
use super::problem::Problem;

use super::tagged;
use crate::api::{Api, Call};
use crate::error::Error;
use crate::text::quoted;

/// Where bundles are sent.
pub(super) const IMPORTS: &str = "/v1/imports";

/// Which file.
#[derive(Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ExportParams {
    /// `bundle` (without it), `mcap` or `csv`.
    format: Option<String>,
    /// The last revision that is in the file; without it the newest.
    revision: Option<i64>,
}

/// Download a session
///
/// A bundle has everything that another server needs to import the session; `mcap` is for robotics viewers, `csv` has
/// one row per attempt. A download that breaks off did not come whole: the connection ends in its middle.
#[utoipa::path(
    get, path = "/v1/sessions/{session_id}/export", tag = "sessions", operation_id = "export_session",
    params(
        ("session_id" = String, Path, description = "Which session"),
        ExportParams,
        ("If-None-Match" = Option<String>, Header, description = "The ETag that is known already"),
    ),
    responses(
        (
            status = 200, description = "The file",
            content(
                (ref("#/components/schemas/File") = "application/x-tar"),
                (ref("#/components/schemas/File") = "application/octet-stream"),
                (String = "text/csv"),
            ),
            headers(
                ("ETag", description = "Names this content"),
                ("Content-Disposition", description = "A name for the file"),
            ),
        ),
        (status = 304, description = "It is still what `If-None-Match` names"),
    ),
)]
pub(super) async fn export(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    Params(params): Params<ExportParams>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let ExportParams { format, revision } = params;
    let format = format.as_deref().map(parse_format).transpose()?.unwrap_or_default();
    let revision = revision.unwrap_or_default();
    let request = v1::ExportSessionRequest { session_id, revision, format: format.into() };
    let export = api.export_session(request, call).await?;
    let name = format!("attachment; filename=\"{}\"", export.file_name);
    let head = [(CONTENT_TYPE, export.content_type.to_owned()), (CONTENT_DISPOSITION, name)];
    // An error cuts the body, so that a part is not taken for the whole.
    let body = Body::from_stream(export.chunks.map(|chunk| chunk.map(|chunk| chunk.data)));
    let file = (head, body).into_response();
    Ok(([(CACHE_CONTROL, "no-cache")], tagged(&headers, &export.etag, file)).into_response())
}

fn parse_format(name: &str) -> Result<v1::ArchiveFormat, Error> {
    match name.to_ascii_lowercase().as_str() {
        "bundle" => Ok(v1::ArchiveFormat::Bundle),
        "mcap" => Ok(v1::ArchiveFormat::Mcap),
        "csv" => Ok(v1::ArchiveFormat::Csv),
        _ => Err(Error::field("format", format!("{} is none of bundle, mcap, csv", quoted(name)))),
    }
}

/// What the session is to be called; without any of it, it is the one in the bundle, byte for byte.
#[derive(Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ImportParams {
    /// Another identifier; the session is then a fork of the one in the bundle, as with any of these.
    session_id: Option<String>,
    /// Another name for people.
    display_name: Option<String>,
    /// Another experiment.
    experiment: Option<String>,
    /// Labels beside those that it has: `object:bottle,strategy:random`.
    labels: Option<String>,
}

/// Import a session
///
/// The body is a bundle as it was exported. All of it is taken over, or nothing.
/// With an `Idempotency-Key` a call that ran out of time can be repeated until it is done.
#[utoipa::path(
    post, path = "/v1/imports", tag = "sessions", operation_id = "import_session",
    params(
        ImportParams,
        ("Idempotency-Key" = Option<String>, Header, description = "Makes a repeated call safe"),
    ),
    request_body(content = ref("#/components/schemas/File"), content_type = "application/x-tar"),
    responses((
        status = 201, description = "The session",
        body = ref("#/components/schemas/Session"), content_type = "application/json",
        headers(("Location", description = "Its path"), ("ETag", description = "Its etag")),
    )),
)]
pub(super) async fn import(
    State(api): State<Api>,
    call: Call,
    Params(params): Params<ImportParams>,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, Problem> {
    require_decoded(&headers)?;
    match content_type(&headers).as_str() {
        "application/x-tar" | "application/octet-stream" => {}
        other => return Err(unsupported(other, "application/x-tar (a bundle as it was exported)")),
    }
    let ImportParams { session_id, display_name, experiment, labels } = params;
    let mut header = v1::CreateSessionRequest {
        session_id: session_id.unwrap_or_default(),
        display_name: display_name.unwrap_or_default(),
        experiment: experiment.unwrap_or_default(),
        labels: labels.as_deref().map(parse_labels).transpose()?.unwrap_or_default(),
        ..v1::CreateSessionRequest::default()
    };
    fill_request_id(&mut header.request_id, &headers)?;
    let session = api.import_session(parts(header, request), call).await?;
    session_reply(StatusCode::CREATED, session)
}

/// Header and body as gRPC has them.
fn parts(
    header: v1::CreateSessionRequest,
    request: Request,
) -> impl Stream<Item = Result<v1::ImportSessionRequest, Error>> {
    let header = v1::ImportSessionRequest { part: Some(Part::Header(header)) };
    let pieces = request.into_body().into_data_stream().map(|piece| {
        let data = piece.map_err(|error| Error::field("data", format!("could not be read: {error}")))?;
        Ok(v1::ImportSessionRequest { part: Some(Part::Data(data)) })
    });
    stream::iter([Ok(header)]).chain(pieces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_format_is_told_what_there_is() {
        assert_eq!(parse_format("MCAP").unwrap(), v1::ArchiveFormat::Mcap);
        let error = parse_format("zip").unwrap_err();
        assert!(error.to_string().contains("bundle, mcap, csv"), "{error}");
    }
}
