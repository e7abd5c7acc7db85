//! `/openapi.json` and the page that shows it: paths from the handlers, schemas from the contract.

use axum::Router;
use serde_json::{Value, json};
use utoipa::OpenApi as _;
use utoipa::openapi::OpenApi;
use utoipa_swagger_ui::{Config, SwaggerUi};

use super::problem::{Document, Field};
use super::proto_json::CONTRACT;
use super::schema;

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
            (name = "operations", description = "Probes and versions"),
        ),
        components(schemas(Document, Field)),
    )]
    struct Introduction;
    Introduction::openapi()
}

/// Completes the document of the routes by the contract's schemas and by what every route may refuse.
pub(super) fn document(paths: OpenApi) -> String {
    let document = serde_json::to_value(paths).map_err(|error| error.to_string()).and_then(|mut document| {
        let contract = CONTRACT.as_ref().map_err(String::clone)?;
        for (name, schema) in schema::schemas(contract) {
            document["components"]["schemas"][name] = schema;
        }
        document["components"]["schemas"]["File"] =
            json!({ "type": "string", "format": "binary", "description": "The bytes of a file." });
        add_problems(&mut document);
        Ok(document)
    });
    // Neither can happen in a server whose tests passed; a reader is still better served by words than by nothing.
    let document = document.unwrap_or_else(|error| json!({ "error": error }));
    document.to_string()
}

fn add_problems(document: &mut Value) {
    document["components"]["responses"]["Problem"] = json!({
        "description": "Refused: nothing was changed",
        "content": { "application/problem+json": { "schema": { "$ref": "#/components/schemas/ProblemDocument" } } },
    });
    let paths = document["paths"].as_object_mut().into_iter().flat_map(|paths| paths.values_mut());
    for operation in paths.filter_map(Value::as_object_mut).flat_map(|path| path.values_mut()) {
        operation["responses"]["default"] = json!({ "$ref": "#/components/responses/Problem" });
    }
}

/// The page at `/docs`, embedded in the binary.
pub(super) fn documentation_page() -> Router {
    SwaggerUi::new("/docs").config(Config::from("/openapi.json")).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn served() -> Value {
        serde_json::from_str(&document(crate::http::documented().into_openapi())).unwrap()
    }

    fn references<'a>(value: &'a Value, found: &mut Vec<&'a str>) {
        match value {
            Value::Object(fields) => {
                found.extend(fields.get("$ref").and_then(Value::as_str));
                fields.values().for_each(|field| references(field, found));
            }
            Value::Array(items) => items.iter().for_each(|item| references(item, found)),
            _ => {}
        }
    }

    #[test]
    fn every_reference_leads_somewhere() {
        let document = served();
        let mut found = Vec::new();
        references(&document, &mut found);
        assert!(found.len() > 100);
        for reference in found {
            let pointer = reference.strip_prefix('#').unwrap();
            assert!(document.pointer(pointer).is_some(), "{reference}");
        }
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
            "get /",
            "get /healthz",
            "get /livez",
            "get /readyz",
            "get /v1/sessions",
            "get /v1/sessions/{session_id}",
            "get /v1/sessions/{session_id}/events",
            "get /v1/sessions/{session_id}/mesh",
            "get /version",
            "post /v1/sessions",
            "post /v1/sessions/{session_id}/candidates",
            "post /v1/sessions/{session_id}/contacts",
            "post /v1/sessions/{session_id}/priors",
        ];
        assert_eq!(operations, expected);
        let refusal = &document["paths"]["/v1/sessions"]["post"]["responses"]["default"]["$ref"];
        assert_eq!(refusal, "#/components/responses/Problem");
    }
}
