//! What handlers take out of a request beside a message: bounded bodies, parameters, guarding headers.

use std::collections::BTreeMap;

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, FromRequest, FromRequestParts, Query, Request};
use http::header::{ACCEPT_ENCODING, CONTENT_ENCODING, CONTENT_TYPE, IF_MATCH};
use http::request::Parts;
use http::{HeaderMap, HeaderName, HeaderValue, StatusCode};
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::json;
use super::problem::Problem;
use crate::access::Caller;
use crate::api::{Call, min_revision};
use crate::error::Error;
use crate::limits::Limits;
use crate::peer;
use crate::text::quoted;

/// Query parameters; one that is unknown or cannot be read is refused.
pub(super) struct Params<T>(pub(super) T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Params<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let Query(params) =
            Query::try_from_uri(&parts.uri).map_err(|rejection| bad_parameter(&rejection.body_text()))?;
        Ok(Self(params))
    }
}

/// Over HTTP nobody names a deadline.
impl<S: Send + Sync> FromRequestParts<S> for Call {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let caller = Caller::of(&parts.extensions)?;
        let at_least = min_revision(&parts.headers)?;
        Ok(Self { deadline: None, caller, peer: peer::address(&parts.extensions), at_least })
    }
}

/// The rejection reads "Failed to deserialize query string: page_size: invalid digit found in string".
fn bad_parameter(rejection: &str) -> Error {
    let (_, text) = rejection.split_once(": ").unwrap_or(("", rejection));
    let (name, description) = text.split_once(": ").unwrap_or(("query", text));
    Error::field(name, description)
}

/// The media type of the body without its parameters, in lower case; empty where none is given.
pub(super) fn content_type(headers: &HeaderMap) -> String {
    let value = text(headers, &CONTENT_TYPE).unwrap_or_default();
    value.split(';').next().unwrap_or_default().trim().to_ascii_lowercase()
}

/// Refuses a body that does not call itself JSON.
///
/// A browser sends such a body to another site only if that site allows it, so no page can command a local server.
pub(super) fn require_json(headers: &HeaderMap) -> Result<(), Problem> {
    match content_type(headers).as_str() {
        "application/json" => Ok(()),
        other => Err(unsupported(other, "application/json (with curl: --json)")),
    }
}

/// A body of a media type that is not taken here.
pub(super) fn unsupported(found: &str, taken: &str) -> Problem {
    let found = if found.is_empty() { "none" } else { found };
    let detail = format!("the Content-Type of the body is {found}: send {taken}");
    Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "UNSUPPORTED_MEDIA_TYPE", detail)
}

/// What `read` makes of the whole body as JSON. Its bound is lower than that of other bodies: parsed, it takes many
/// times its size.
pub(super) async fn json_body<T: Send + 'static>(
    request: Request,
    limits: &Limits,
    read: impl FnOnce(Value) -> Result<T, Error> + Send + 'static,
) -> Result<T, Problem> {
    let hint = "send large clouds as PLY or as packed floats (application/octet-stream)";
    let bytes = body(request, limits.json_bytes, "the JSON body", hint).await?;
    json::parsed(bytes, limits, read).await
}

/// The whole body as a file with a mesh.
pub(super) async fn mesh_body(request: Request, limits: &Limits) -> Result<Bytes, Problem> {
    body(request, limits.message_bytes, "the body", "make the mesh coarser, or send it in binary").await
}

/// The whole body as a file with a cloud.
pub(super) async fn file_body(request: Request, limits: &Limits) -> Result<Bytes, Problem> {
    body(request, limits.message_bytes, "the body", "thin the cloud and send fewer points").await
}

async fn body(
    mut request: Request,
    limit: usize,
    what: &'static str,
    hint: &'static str,
) -> Result<Bytes, Problem> {
    require_decoded(request.headers())?;
    DefaultBodyLimit::max(limit).apply(&mut request);
    Bytes::from_request(request, &()).await.map_err(|rejection| {
        if rejection.status() == StatusCode::PAYLOAD_TOO_LARGE {
            Error::TooLarge { what: what.into(), limit: format!("{limit} bytes"), hint }.into()
        } else {
            Problem::unparsable(format!("the body could not be read: {}", rejection.body_text()))
        }
    })
}

/// Refuses a body that is still encoded: the layer around the routes has decoded what it knows, and said so by taking
/// the header away.
pub(super) fn require_decoded(headers: &HeaderMap) -> Result<(), Problem> {
    let identity = HeaderValue::from_static("identity");
    let Some(encoding) = headers.get_all(CONTENT_ENCODING).iter().find(|&encoding| encoding != identity)
    else {
        return Ok(());
    };
    let detail = format!("the Content-Encoding of the body is {encoding:?}: send gzip, or leave it out");
    let problem = Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "UNSUPPORTED_MEDIA_TYPE", detail);
    Err(problem.with_header(ACCEPT_ENCODING, HeaderValue::from_static("gzip")))
}

/// Puts the path's session id into the body's field, or checks that they agree.
pub(super) fn fill_session_id(field: &mut String, path: String) -> Result<(), Error> {
    fill("session_id", field, path, "the path")
}

/// Puts the `Idempotency-Key` header into the request's id, or checks that they agree.
pub(super) fn fill_request_id(field: &mut String, headers: &HeaderMap) -> Result<(), Error> {
    match text(headers, &HeaderName::from_static("idempotency-key")) {
        Some(key) => fill("request_id", field, key.to_owned(), "the Idempotency-Key header"),
        None => Ok(()),
    }
}

fn fill(name: &str, field: &mut String, value: String, source: &str) -> Result<(), Error> {
    if field.is_empty() {
        *field = value;
    } else if *field != value {
        return Err(Error::field(
            name,
            format!("{} is not {}, which {source} says: give it once", quoted(field), quoted(&value)),
        ));
    }
    Ok(())
}

/// The entity tag that a change depends on; empty where none is given.
pub(super) fn if_match(headers: &HeaderMap) -> String {
    match text(headers, &IF_MATCH) {
        None | Some("*") => String::new(),
        Some(tag) => tag.trim_matches('"').to_owned(),
    }
}

/// Labels as the query has them.
///
/// # Errors
/// One of them is no pair.
pub(super) fn parse_labels(text: &str) -> Result<BTreeMap<String, String>, Error> {
    let pair = |pair: &str| pair.split_once(':').map(|(key, value)| (key.to_owned(), value.to_owned()));
    text.split(',').map(pair).collect::<Option<_>>().ok_or_else(|| {
        Error::field("labels", format!("{} is not of the form key:value,key:value", quoted(text)))
    })
}

/// A header's value, where it is there and is text.
pub(super) fn text<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    headers.get(name)?.to_str().ok().map(str::trim)
}

#[cfg(test)]
mod tests {
    use http::HeaderValue;

    use super::*;

    #[test]
    fn an_id_may_be_given_twice_only_if_it_is_the_same() {
        let mut field = String::new();
        fill_session_id(&mut field, "cup".into()).unwrap();
        fill_session_id(&mut field, "cup".into()).unwrap();
        assert_eq!(field, "cup");
        let error = fill_session_id(&mut field, "mug".into()).unwrap_err();
        assert_eq!(error.fields()[0].field, "session_id");
    }

    #[test]
    fn the_idempotency_key_is_the_request_id() {
        let mut headers = HeaderMap::new();
        let mut field = "mine".to_owned();
        fill_request_id(&mut field, &headers).unwrap();
        headers.insert("Idempotency-Key", HeaderValue::from_static("other"));
        assert_eq!(fill_request_id(&mut field, &headers).unwrap_err().fields()[0].field, "request_id");
    }

    #[tokio::test]
    async fn a_bad_parameter_is_named() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Page {
            #[expect(dead_code, reason = "only its type matters here")]
            page_size: Option<u32>,
        }
        let field = async |uri: &str| {
            let (mut parts, ()) = http::Request::get(uri).body(()).unwrap().into_parts();
            let result = Params::<Page>::from_request_parts(&mut parts, &()).await;
            serde_json::from_str::<Value>(&result.err().unwrap().to_json()).unwrap()["fields"][0]["field"]
                .take()
        };
        assert_eq!(field("/?page_size=x").await, "page_size");
        assert_eq!(field("/?pagesize=1").await, "pagesize");
    }

    #[test]
    fn parameters_of_the_media_type_and_its_case_do_not_matter() {
        let mut headers = HeaderMap::new();
        assert!(require_json(&headers).is_err());
        headers.insert(CONTENT_TYPE, HeaderValue::from_static("Application/JSON; charset=utf-8"));
        assert!(require_json(&headers).is_ok());
    }

    #[test]
    fn labels_are_pairs_and_a_value_may_hold_a_colon() {
        let labels = parse_labels("object:bottle,time:12:30").unwrap();
        assert_eq!(labels["object"], "bottle");
        assert_eq!(labels["time"], "12:30");
        assert!(parse_labels("object").is_err());
    }

    #[test]
    fn quotes_around_a_tag_are_taken_off() {
        let mut headers = HeaderMap::new();
        assert_eq!(if_match(&headers), "");
        headers.insert(IF_MATCH, HeaderValue::from_static("\"abc\""));
        assert_eq!(if_match(&headers), "abc");
    }
}
