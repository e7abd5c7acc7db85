//! The OpenAPI document: its examples work as they are, and what it says of replies is true.

use serde_json::Value;

use crate::harness::{Server, accepted, send};

async fn document(server: &Server) -> Value {
    accepted(server.http().get("/openapi.json")).await.unwrap().json().await.unwrap()
}

/// Fails where `value` lacks what `schema` requires, or has what it does not know.
fn check(document: &Value, schema: &Value, value: &Value, path: &str) {
    if let Some(reference) = schema["$ref"].as_str() {
        return check(document, document.pointer(&reference[1..]).unwrap(), value, path);
    }
    if let Some(variants) = schema["oneOf"].as_array() {
        let has = |variant: &&Value| {
            let required = variant["required"].as_array().unwrap();
            required.iter().all(|name| !value[name.as_str().unwrap()].is_null())
        };
        let fitting: Vec<&Value> = variants.iter().filter(has).collect();
        assert_eq!(fitting.len(), 1, "{path}: one of the choices");
        return check(document, fitting[0], value, path);
    }
    for name in schema["required"].as_array().into_iter().flatten() {
        assert!(!value[name.as_str().unwrap()].is_null(), "{path}.{name} is required and not there");
    }
    if let (Some(properties), Some(fields)) = (schema["properties"].as_object(), value.as_object()) {
        for (name, field) in fields {
            let known = properties.get(name).unwrap_or_else(|| panic!("{path}.{name} is not documented"));
            check(document, known, field, &format!("{path}.{name}"));
        }
    }
    for (index, item) in value.as_array().into_iter().flatten().enumerate() {
        check(document, &schema["items"], item, &format!("{path}[{index}]"));
    }
}

#[tokio::test]
async fn every_example_works_as_it_is_and_its_reply_is_as_documented() {
    let server = Server::start().await;
    let document = document(&server).await;
    for path in [
        "",
        "/{session_id}/priors",
        "/{session_id}/candidates",
        "/{session_id}/contacts",
        "/{session_id}/evaluate",
    ] {
        let path = format!("/v1/sessions{path}");
        let operation = &document["paths"][&path]["post"];
        assert_eq!(operation["requestBody"]["required"], true, "{path}");
        let content = &operation["requestBody"]["content"]["application/json"];
        check(&document, &content["schema"], &content["example"], &path);
        let session = operation["parameters"].as_array().into_iter().flatten();
        let session = session.filter(|parameter| parameter["name"] == "session_id");
        let session = session.map(|parameter| parameter["example"].as_str().unwrap()).next();
        let url = path.replace("{session_id}", session.unwrap_or_default());
        // "Execute" may be pressed twice.
        for _ in 0..2 {
            let answer = accepted(server.http().post(&url, &content["example"])).await.unwrap();
            let status = answer.status().as_str().to_owned();
            let schema = &operation["responses"][&status]["content"]["application/json"]["schema"];
            assert!(!schema.is_null(), "{path}: {status} is documented");
            let reply: Value = answer.json().await.unwrap();
            assert!(reply["warnings"].as_array().is_none_or(Vec::is_empty), "{path}: {reply}");
            check(&document, schema, &reply, &path);
        }
    }
    for (path, query) in [
        ("", ""),
        ("/{session_id}", ""),
        ("/{session_id}/events", "?include_points=true"),
        ("/{session_id}/series", ""),
    ] {
        let path = format!("/v1/sessions{path}");
        let content = &document["paths"][&path]["get"]["responses"]["200"]["content"];
        let url = path.replace("{session_id}", "first-ball") + query;
        let reply: Value = accepted(server.http().get(&url)).await.unwrap().json().await.unwrap();
        check(&document, &content["application/json"]["schema"], &reply, &path);
    }
}

#[tokio::test]
async fn the_document_says_where_the_server_is_and_people_can_read_it() {
    let server = Server::start().await;
    let document = document(&server).await;
    assert_eq!(document["servers"][0]["url"], "/");
    let page = send(server.http().get("/docs/")).await.text().await.unwrap();
    assert!(page.contains("<title>Palpate</title>"), "{page}");
    // All that the page asks for is there; what it never asks for takes no room in the program.
    let file =
        async |name: &str| send(server.http().get(&format!("/docs/{name}"))).await.bytes().await.unwrap();
    let asked = ["src=\"", "href=\""].into_iter().flat_map(|attribute| page.split(attribute).skip(1));
    let asked: Vec<&str> = asked.filter_map(|rest| rest.split('"').next()).collect();
    assert!(asked.len() >= 5, "{page}");
    for name in asked {
        assert!(!file(name.trim_start_matches("./")).await.is_empty(), "{name}");
    }
    assert!(file("swagger-ui-es-bundle.js").await.is_empty());
}

#[tokio::test]
async fn the_dashboard_is_built_for_the_document_that_is_served() {
    let server = Server::start().await;
    let served = send(server.http().get("/openapi.json")).await.text().await.unwrap();
    let served: Value = serde_json::from_str(&served).unwrap();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../clients/dashboard/openapi.json");
    let kept: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    assert!(
        served == kept,
        "clients/dashboard/openapi.json, from which the page's types are made, is behind: start a server and\n\
         curl -s http://127.0.0.1:7257/openapi.json | python3 -m json.tool > clients/dashboard/openapi.json"
    );
}
