//! `/openapi.json` and the page that shows it: paths from the handlers, schemas from the contract.

use std::collections::BTreeSet;

use axum::Router;
use axum::response::{IntoResponse, Response};
use http::HeaderValue;
use http::header::{CONTENT_LENGTH, CONTENT_SECURITY_POLICY, CONTENT_TYPE};
use prost_reflect::DescriptorPool;
use serde_json::{Value, json};
use utoipa::OpenApi as _;
use utoipa::openapi::OpenApi;
use utoipa_swagger_ui::{Config, SwaggerUi};

use super::problem::{Document, Field, Problem};
use super::{examples, schema};
use crate::error::Error;
use crate::wire::CONTRACT;

/// Much larger than the page of the documentation.
const PAGE_BYTES: usize = 1 << 20;

/// What a session that exists may be called.
const SESSION_ID: &str = "^[A-Za-z0-9._-]{1,63}$";

/// What the page of the documentation needs: its own scripts, and styles and pictures that these make.
const PAGE_POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
     connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);

/// Where the document starts: what the service is.
pub(super) fn introduction() -> OpenApi {
    #[derive(utoipa::OpenApi)]
    #[openapi(
        info(
            title = "Palpate",
            description = "Sessions that reconstruct an object's shape from a camera's view and a robot's touches.\n\n\
                           Lengths are metres, forces newtons, and every pose and point of a session is in its \
                           `frame_id`.\n\
                           Each answer that is not a success is a problem document (RFC 9457) with a `reason` for \
                           programs.\n\
                           Repeating a call with the same `request_id` and body is safe.",
        ),
        tags(
            (name = "sessions", description = "The life of sessions"),
            (name = "exploration", description = "The robot's loop: show a patch, ask where to touch, report"),
            (name = "reconstruction", description = "The surface and the log"),
            (name = "evaluation", description = "Against the truth: comparisons, series, experiments"),
            (name = "operations", description = "Probes and versions"),
        ),
        components(schemas(Document, Field)),
    )]
    struct Introduction;
    Introduction::openapi()
}

/// Completes the document of the routes by the contract's schemas, examples, and what every route may refuse.
pub(super) fn document(paths: OpenApi) -> String {
    let document = serde_json::to_value(paths).map_err(|error| error.to_string()).and_then(|mut document| {
        let contract = CONTRACT.as_ref().map_err(String::clone)?;
        for (name, schema) in schema::schemas(contract) {
            document["components"]["schemas"][name] = schema;
        }
        document["components"]["schemas"]["File"] =
            json!({ "type": "string", "format": "binary", "description": "The bytes of a file." });
        document["servers"] = json!([{ "url": "/", "description": "This server" }]);
        for operation in operations(&mut document) {
            complete(operation);
        }
        add_problems(&mut document);
        require_in_replies(&mut document, contract);
        drop_unused(&mut document);
        Ok(document)
    });
    // Neither can happen in a server whose tests passed; a reader is still better served by words than by nothing.
    let document = document.unwrap_or_else(|error| json!({ "error": error }));
    document.to_string()
}

fn operations(document: &mut Value) -> impl Iterator<Item = &mut Value> {
    let paths = document["paths"].as_object_mut().into_iter().flat_map(|paths| paths.values_mut());
    paths.filter_map(Value::as_object_mut).flat_map(|path| path.values_mut())
}

/// Gives an operation what can be tried out at once: a body, and the session that the bodies are about.
fn complete(operation: &mut Value) {
    let example = operation["operationId"].as_str().and_then(examples::body);
    if let Some(body) = operation.get_mut("requestBody") {
        body["required"] = true.into();
        if let Some(example) = example {
            body["content"]["application/json"]["example"] = example;
        }
    }
    let parameters = operation.get_mut("parameters").and_then(Value::as_array_mut);
    for parameter in parameters.into_iter().flatten().filter(|parameter| parameter["name"] == "session_id") {
        parameter["example"] = examples::SESSION_ID.into();
        parameter["schema"]["pattern"] = SESSION_ID.into();
    }
}

fn add_problems(document: &mut Value) {
    document["components"]["responses"]["Problem"] = json!({
        "description": "Refused: nothing was changed",
        "content": { "application/problem+json": { "schema": { "$ref": "#/components/schemas/ProblemDocument" } } },
    });
    for operation in operations(document) {
        operation["responses"]["default"] = json!({ "$ref": "#/components/responses/Problem" });
    }
}

/// In messages that only the server sends, what it always sends is required.
fn require_in_replies(document: &mut Value, contract: &DescriptorPool) {
    let mut in_requests = BTreeSet::new();
    for body in operations(document).filter_map(|operation| operation.get("requestBody")) {
        references(body, &mut in_requests);
    }
    let in_requests = closure(&document["components"], in_requests);
    let schemas = document["components"]["schemas"].as_object_mut().into_iter().flatten();
    for (name, schema) in schemas.filter(|(name, _)| !in_requests.contains(&reference_to(name))) {
        let message = contract.get_message_by_name(&format!("{}.{name}", schema::PACKAGE));
        if let Some(message) = message {
            schema::require_what_is_sent(schema, &message);
        }
    }
}

/// Removes the schemas that no path leads to.
fn drop_unused(document: &mut Value) {
    let mut used = BTreeSet::new();
    references(&document["paths"], &mut used);
    let used = closure(&document["components"], used);
    if let Some(schemas) = document["components"]["schemas"].as_object_mut() {
        schemas.retain(|name, _| used.contains(&reference_to(name)));
    }
}

fn reference_to(schema: &str) -> String {
    format!("#/components/schemas/{schema}")
}

/// `found` and all that is referred to from there.
fn closure(components: &Value, found: BTreeSet<String>) -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    let mut open: Vec<String> = found.into_iter().collect();
    while let Some(reference) = open.pop() {
        let pointer = reference.strip_prefix("#/components").unwrap_or_default();
        if let (true, Some(target)) = (all.insert(reference.clone()), components.pointer(pointer)) {
            let mut next = BTreeSet::new();
            references(target, &mut next);
            open.extend(next);
        }
    }
    all
}

fn references(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            found.extend(fields.get("$ref").and_then(Value::as_str).map(str::to_owned));
            fields.values().for_each(|field| references(field, found));
        }
        Value::Array(items) => items.iter().for_each(|item| references(item, found)),
        _ => {}
    }
}

/// The page at `/docs`, embedded in the binary.
pub(super) fn documentation_page() -> Router {
    let config = Config::from("/openapi.json").try_it_out_enabled(true);
    Router::from(SwaggerUi::new("/docs").config(config)).layer(axum::middleware::map_response(name_page))
}

/// Names the page after the service, as it comes as "Swagger UI", and says what it may load.
async fn name_page(mut response: Response) -> Response {
    response.headers_mut().insert(CONTENT_SECURITY_POLICY, PAGE_POLICY);
    let content_type = response.headers().get(CONTENT_TYPE).map(HeaderValue::as_bytes).unwrap_or_default();
    if !content_type.starts_with(b"text/html") {
        return response;
    }
    let (mut parts, body) = response.into_parts();
    let Ok(page) = axum::body::to_bytes(body, PAGE_BYTES).await else {
        return Problem::from(Error::internal("the page of the documentation is too large")).into_response();
    };
    let page = String::from_utf8_lossy(&page).replace("<title>Swagger UI</title>", "<title>Palpate</title>");
    parts.headers.remove(CONTENT_LENGTH);
    Response::from_parts(parts, page.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn served() -> Value {
        serde_json::from_str(&document(crate::http::described())).unwrap()
    }

    #[test]
    fn every_reference_leads_somewhere_and_every_schema_is_used() {
        let document = served();
        let mut found = BTreeSet::new();
        references(&document, &mut found);
        for reference in &found {
            assert!(document.pointer(reference.strip_prefix('#').unwrap()).is_some(), "{reference}");
        }
        let schemas = document["components"]["schemas"].as_object().unwrap();
        assert!(schemas.contains_key("Candidate") && !schemas.contains_key("ExploreRequest"));
        for name in schemas.keys() {
            assert!(found.contains(&reference_to(name)), "{name} belongs to no route");
        }
    }

    #[test]
    fn replies_say_what_is_always_there_and_requests_what_must_be() {
        let document = served();
        let required = |name: &str| document["components"]["schemas"][name]["required"].clone();
        let reply = required("ProposeContactsResponse");
        for field in ["revision", "candidates", "excluded", "should_stop"] {
            assert!(reply.as_array().unwrap().contains(&json!(field)), "{field}");
        }
        assert_eq!(required("ReportContactRequest"), json!(["result"]));
        assert_eq!(required("CreateSessionRequest"), Value::Null, "every field has a default");
        assert_eq!(required("SessionConfig"), Value::Null, "callers send it, too");
    }

    #[test]
    fn the_document_has_each_path_with_its_methods_and_its_refusals() {
        let document = served();
        assert!(document["openapi"].as_str().unwrap().starts_with("3.1"));
        let paths = document["paths"].as_object().unwrap();
        let mut operations: Vec<String> = paths
            .iter()
            .flat_map(|(path, item)| {
                item.as_object().unwrap().keys().map(move |method| format!("{method} {path}"))
            })
            .collect();
        operations.sort();
        let expected = [
            "delete /v1/sessions/{session_id}",
            "delete /v1/sessions/{session_id}/reference",
            "get /healthz",
            "get /livez",
            "get /metrics",
            "get /readyz",
            "get /v1/experiments",
            "get /v1/experiments/{experiment}/summary",
            "get /v1/sessions",
            "get /v1/sessions/{session_id}",
            "get /v1/sessions/{session_id}/events",
            "get /v1/sessions/{session_id}/export",
            "get /v1/sessions/{session_id}/mesh",
            "get /v1/sessions/{session_id}/reference",
            "get /v1/sessions/{session_id}/replay",
            "get /v1/sessions/{session_id}/series",
            "get /version",
            "patch /v1/sessions/{session_id}",
            "post /v1/imports",
            "post /v1/sessions",
            "post /v1/sessions/{session_id}/candidates",
            "post /v1/sessions/{session_id}/contacts",
            "post /v1/sessions/{session_id}/evaluate",
            "post /v1/sessions/{session_id}/events/{seq}/retract",
            "post /v1/sessions/{session_id}/finish",
            "post /v1/sessions/{session_id}/fork",
            "post /v1/sessions/{session_id}/priors",
            "post /v1/tickets",
            "put /v1/sessions/{session_id}/reference",
        ];
        assert_eq!(operations, expected);
        let body = &document["paths"]["/v1/sessions/{session_id}/priors"]["post"]["requestBody"]["content"];
        for media_type in [
            "application/json",
            "application/ply",
            "application/pcd",
            "application/octet-stream",
            "image/png",
        ] {
            assert!(body[media_type]["schema"].is_object(), "{media_type}");
        }
        let refusal = &document["paths"]["/v1/sessions"]["post"]["responses"]["default"]["$ref"];
        assert_eq!(refusal, "#/components/responses/Problem");
    }
}
