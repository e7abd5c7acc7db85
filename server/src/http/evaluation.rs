//! Comparison of estimates with a true surface, which comes as JSON or as the file that it is.

use axum::body::Bytes;
use axum::extract::{Path, Request, State};
use http::{HeaderMap, Uri};
use palpate_proto::v1;
use serde::Deserialize;

use super::extract::{Params, content_type, fill_session_id, json_body, mesh_body, unsupported};
use super::problem::Problem;
use super::proto_json::{ProtoJson, from_json};
use super::reference::{self, mesh_format};
use crate::api::{Api, Call};
use crate::error::Error;
use crate::text::quoted;

/// What goes with a reference mesh that is sent as a file.
#[derive(Default, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct EvaluateParams {
    /// Which revisions: `2,10,20`; without it the newest.
    revisions: Option<String>,
    /// Samples per surface for the chamfer distances; 13,000 without it.
    samples: Option<u32>,
    /// Seed of the sampling.
    seed: Option<u64>,
    /// Metres in one unit of the file: 0.001 for millimetres; 1 without it.
    metres_per_unit: Option<f64>,
    /// Keep the file with the session, as `PUT .../reference` does.
    keep_reference: Option<bool>,
}

/// Compare estimates with a true surface
///
/// The body is the surface as a PLY, STL or OBJ file with what else is wanted in the query, or JSON, which says all
/// itself: `{}` compares the newest estimate with the reference mesh that the session keeps, and `NO_REFERENCE` says
/// that it keeps none.
#[utoipa::path(
    post, path = "/v1/sessions/{session_id}/evaluate", tag = "evaluation", operation_id = "evaluate_session",
    params(("session_id" = String, Path, description = "Which session"), EvaluateParams),
    request_body(content(
        (ref("#/components/schemas/EvaluateSessionRequest") = "application/json"),
        (ref("#/components/schemas/File") = "application/ply"),
        (ref("#/components/schemas/File") = "model/stl"),
        (ref("#/components/schemas/File") = "model/obj"),
        (ref("#/components/schemas/File") = "application/octet-stream"),
    )),
    responses((
        status = 200, description = "One comparison per revision, in the order of the request",
        body = ref("#/components/schemas/EvaluateSessionResponse"), content_type = "application/json",
    )),
)]
pub(super) async fn evaluate(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    headers: HeaderMap,
    uri: Uri,
    Params(params): Params<EvaluateParams>,
    request: Request,
) -> Result<ProtoJson<v1::EvaluateSessionResponse>, Problem> {
    let mut message: v1::EvaluateSessionRequest = match content_type(&headers).as_str() {
        "application/json" => {
            if uri.query().is_some_and(|query| !query.is_empty()) {
                let reason = "a JSON body says everything itself: move the query parameters into it";
                return Err(Error::field("query", reason).into());
            }
            json_body(request, api.limits(), |body| from_json(&body)).await?
        }
        media_type => match mesh_format(media_type) {
            Some(format) => of_file(mesh_body(request, api.limits()).await?, format, params)?,
            None => return Err(unsupported(media_type, &format!("application/json, {}", reference::TAKEN))),
        },
    };
    fill_session_id(&mut message.session_id, session_id)?;
    Ok(ProtoJson(api.evaluate_session(message, call).await?))
}

/// The request that such a file is, but for the session's id.
fn of_file(
    file: Bytes,
    format: v1::MeshFormat,
    params: EvaluateParams,
) -> Result<v1::EvaluateSessionRequest, Error> {
    if file.is_empty() {
        let reason = "is empty: send the file, or {} as JSON for the mesh that the session keeps";
        return Err(Error::field("reference_mesh", reason));
    }
    let EvaluateParams { revisions, samples, seed, metres_per_unit, keep_reference } = params;
    Ok(v1::EvaluateSessionRequest {
        session_id: String::new(),
        revisions: revisions.as_deref().map(parse_revisions).transpose()?.unwrap_or_default(),
        reference_mesh: file,
        reference_format: format.into(),
        samples: samples.unwrap_or_default(),
        seed: seed.unwrap_or_default(),
        metres_per_unit: metres_per_unit.unwrap_or_default(),
        keep_reference: keep_reference.unwrap_or_default(),
    })
}

fn parse_revisions(text: &str) -> Result<Vec<i64>, Error> {
    let revisions: Option<_> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    revisions.ok_or_else(|| Error::field("revisions", format!("{} is not of the form 2,10,20", quoted(text))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn revisions_are_numbers_between_commas() {
        assert_eq!(parse_revisions("2, 10").unwrap(), [2, 10]);
        for wrong in ["", "2,", "two"] {
            assert_eq!(parse_revisions(wrong).unwrap_err().fields()[0].field, "revisions");
        }
    }

    #[test]
    fn a_file_is_never_mistaken_for_the_mesh_that_the_session_keeps() {
        let empty = of_file(Bytes::new(), v1::MeshFormat::Ply, EvaluateParams::default()).unwrap_err();
        assert_eq!(empty.fields()[0].field, "reference_mesh");
    }
}
