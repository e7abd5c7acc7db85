//! The reconstructed surface as a file or as JSON, cacheable by revision.

use axum::extract::{Path, State};
use axum::response::{IntoResponse, Response};
use http::header::{CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_TYPE, IF_NONE_MATCH, VARY};
use http::{HeaderMap, StatusCode};
use palpate_proto::v1;
use serde::{Deserialize, Serialize};

use super::extract::{Params, text};
use super::problem::Problem;
use super::{negotiation, tagged};
use crate::api::{Api, Call, file_name};
use crate::error::Error;
use crate::text::quoted;

/// What `Accept` may ask for, the first being the default; `application/json` means arrays.
const OFFERS: [(&str, v1::MeshFormat); 5] = [
    ("model/ply", v1::MeshFormat::Ply),
    ("model/obj", v1::MeshFormat::Obj),
    ("model/stl", v1::MeshFormat::Stl),
    ("model/gltf-binary", v1::MeshFormat::Glb),
    ("application/json", v1::MeshFormat::Raw),
];

/// Which mesh, and how.
#[derive(Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct MeshParams {
    /// `ply` and `glb` (with the uncertainty of each vertex), `obj`, `stl` or `json`; the `Accept` header works too.
    format: Option<String>,
    /// Which revision; without it the newest. What a fixed revision answers never changes.
    revision: Option<i64>,
    /// For `glb`: `paper` (green, yellow, red; without it) or `cividis`.
    colormap: Option<String>,
}

/// The surface as arrays of numbers.
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct MeshArrays {
    /// Revision of the session whose estimate this is.
    revision: i64,
    /// Positions in metres, in the session's frame.
    vertices: Vec<[f32; 3]>,
    /// Three vertex indices a triangle, counter-clockwise seen from outside.
    faces: Vec<[u32; 3]>,
    /// Uncertainty of each vertex, in [0, 1].
    uncertainty: Vec<f32>,
    /// Standard deviation along the normal of each vertex, in metres; left out when the method does not estimate it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    std_m: Vec<f32>,
}

/// Download the reconstructed surface
#[utoipa::path(
    get, path = "/v1/sessions/{session_id}/mesh", tag = "reconstruction", operation_id = "get_mesh",
    params(
        ("session_id" = String, Path, description = "Which session"),
        MeshParams,
        ("If-None-Match" = Option<String>, Header, description = "The ETag that is known already"),
    ),
    responses(
        (
            status = 200, description = "The surface, in metres, in the session's frame",
            content(
                (MeshArrays = "application/json"),
                (ref("#/components/schemas/File") = "model/ply"),
                (ref("#/components/schemas/File") = "model/stl"),
                (ref("#/components/schemas/File") = "model/gltf-binary"),
                (String = "model/obj"),
            ),
            headers(
                ("ETag", description = "Names this content"),
                ("Cache-Control", description = "A year for a fixed revision"),
                ("Content-Disposition", description = "A name for the file"),
            ),
        ),
        (status = 304, description = "It is still what `If-None-Match` names"),
    ),
)]
pub(super) async fn get(
    State(api): State<Api>,
    call: Call,
    Path(session_id): Path<String>,
    Params(params): Params<MeshParams>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let MeshParams { format, revision, colormap } = params;
    let colormap = colormap.as_deref().map(parse_colormap).transpose()?.unwrap_or_default();
    let format = match format {
        Some(name) => parse_format(&name)?,
        None => negotiation::choose(&headers, &OFFERS).ok_or_else(not_acceptable)?,
    };
    let revision = revision.unwrap_or_default();
    let request = v1::GetMeshRequest {
        session_id: session_id.clone(),
        revision,
        format: format.into(),
        if_none_match: text(&headers, &IF_NONE_MATCH).unwrap_or_default().to_owned(),
        have_topology: String::new(),
        colormap: colormap.into(),
    };
    let mesh = api.get_mesh(request, call).await?;
    let cache = if revision == 0 { "no-cache" } else { "max-age=31536000, immutable" };
    let common = [(CACHE_CONTROL, cache), (VARY, "accept")];
    let etag = mesh.etag.clone();
    Ok((common, tagged(&headers, &etag, body(mesh, &session_id)?)).into_response())
}

fn body(mesh: v1::Mesh, session_id: &str) -> Result<Response, Error> {
    let v1::Mesh { revision, etag: _, content_type, not_modified, body, doubted: _ } = mesh;
    match body {
        Some(v1::mesh::Body::File(file)) => {
            let extension = match content_type.strip_prefix("model/") {
                Some("gltf-binary") => "glb",
                other => other.unwrap_or_default(),
            };
            let name = format!("inline; filename=\"{}\"", file_name(session_id, revision, extension));
            Ok(([(CONTENT_TYPE, content_type), (CONTENT_DISPOSITION, name)], file).into_response())
        }
        Some(v1::mesh::Body::Raw(raw)) => Ok(axum::Json(arrays(revision, &raw)).into_response()),
        None if not_modified => Ok(().into_response()),
        None => Err(Error::internal("a mesh without a body")),
    }
}

fn arrays(revision: i64, raw: &v1::RawMesh) -> MeshArrays {
    let floats = |bytes: &[u8]| -> Vec<f32> {
        bytes.as_chunks::<4>().0.iter().map(|four| f32::from_le_bytes(*four)).collect()
    };
    let indices: Vec<u32> =
        raw.faces_u32_le.as_chunks::<4>().0.iter().map(|four| u32::from_le_bytes(*four)).collect();
    MeshArrays {
        revision,
        vertices: floats(&raw.positions_f32_le).as_chunks::<3>().0.to_vec(),
        faces: indices.as_chunks::<3>().0.to_vec(),
        uncertainty: floats(&raw.uncertainty_f32_le),
        std_m: floats(&raw.std_m_f32_le),
    }
}

fn parse_colormap(name: &str) -> Result<v1::Colormap, Error> {
    match name.to_ascii_lowercase().as_str() {
        "paper" => Ok(v1::Colormap::Paper),
        "cividis" => Ok(v1::Colormap::Cividis),
        _ => Err(Error::field("colormap", format!("{} is none of paper, cividis", quoted(name)))),
    }
}

/// The format of a name in the query.
fn parse_format(name: &str) -> Result<v1::MeshFormat, Error> {
    match name.to_ascii_lowercase().as_str() {
        "ply" => Ok(v1::MeshFormat::Ply),
        "obj" => Ok(v1::MeshFormat::Obj),
        "stl" => Ok(v1::MeshFormat::Stl),
        "glb" => Ok(v1::MeshFormat::Glb),
        "json" => Ok(v1::MeshFormat::Raw),
        _ => Err(Error::field("format", format!("{} is none of ply, obj, stl, glb, json", quoted(name)))),
    }
}

fn not_acceptable() -> Problem {
    let offers: Vec<&str> = OFFERS.iter().map(|(media_type, _)| *media_type).collect();
    let detail = format!("the Accept header takes none of what there is: {}", offers.join(", "));
    Problem::new(StatusCode::NOT_ACCEPTABLE, "NOT_ACCEPTABLE", detail)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_format::tests::tetrahedron;
    use crate::mesh_format::{Colormap, FileFormat, raw};

    #[test]
    fn json_arrays_are_the_packed_ones_unpacked() {
        let packed = raw(&tetrahedron());
        let message = v1::RawMesh {
            positions_f32_le: packed.positions_f32_le.into(),
            faces_u32_le: packed.faces_u32_le.into(),
            uncertainty_f32_le: packed.uncertainty_f32_le.into(),
            ..v1::RawMesh::default()
        };
        let expected = serde_json::json!({
            "revision": 3,
            "vertices": [[0.0, 0.0, 0.0], [0.1_f32, 0.0, 0.0], [0.0, 0.1_f32, 0.0], [0.0, 0.0, 0.1_f32]],
            "faces": [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            "uncertainty": [0.0, 0.25, 0.5, 1.0],
        });
        assert_eq!(serde_json::to_value(arrays(3, &message)).unwrap(), expected);
    }

    #[test]
    fn the_media_types_on_offer_are_those_of_the_files() {
        let files = [FileFormat::Ply, FileFormat::Obj, FileFormat::Stl, FileFormat::Glb(Colormap::Paper)];
        for (file, (media_type, _)) in files.into_iter().zip(OFFERS) {
            assert_eq!(file.content_type(), media_type);
        }
    }

    #[test]
    fn an_unknown_format_is_told_what_there_is() {
        let error = parse_format("step").unwrap_err();
        assert!(error.to_string().contains("ply, obj, stl, glb, json"));
    }
}
