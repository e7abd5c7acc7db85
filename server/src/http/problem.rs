//! Refusals as problem documents (RFC 9457), with the same reasons and field paths as over gRPC.

use std::any::Any;

use axum::response::{IntoResponse, Response};
use http::header::{CONTENT_TYPE, RETRY_AFTER};
use http::{HeaderName, HeaderValue, StatusCode};
use serde::Serialize;

use crate::error::{Error, FieldViolation};
use crate::limits::{ERROR_TEXT_BYTES, FIELD_PATH_BYTES};
use crate::text::cut;

/// An answer that is not a success.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    status: StatusCode,
    // Boxed, so that the results of handlers stay small.
    body: Box<Document>,
    header: Option<Box<(HeaderName, HeaderValue)>>,
}

/// What went wrong, for people (`detail`) and for programs (`reason`, `fields`).
#[derive(Clone, Debug, Serialize, utoipa::ToSchema)]
#[schema(as = ProblemDocument)]
pub(super) struct Document {
    /// Always `about:blank`: the status and `reason` say all.
    #[schema(value_type = String)]
    r#type: &'static str,
    /// The status in words.
    #[schema(value_type = String)]
    title: &'static str,
    /// The HTTP status.
    status: u16,
    /// What is wrong and what to do, for people.
    detail: String,
    /// Why, for programs: for instance `NO_VISUAL_PRIOR`.
    #[schema(value_type = String)]
    reason: &'static str,
    /// Which fields are wrong; empty when it is not about a field.
    fields: Vec<Field>,
    /// When the same request may succeed, in milliseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    retry_after_ms: Option<u64>,
}

/// What is wrong with one field.
#[derive(Clone, Debug, Serialize, utoipa::ToSchema)]
#[schema(as = ProblemField)]
pub(super) struct Field {
    /// Its path in the request, for instance `result.contact.sensor_pose.orientation`.
    field: String,
    /// What is wrong with it and what would be right.
    description: String,
}

impl Problem {
    /// A refusal that only HTTP knows.
    pub(super) fn new(status: StatusCode, reason: &'static str, detail: impl Into<String>) -> Self {
        let body = Document {
            r#type: "about:blank",
            title: status.canonical_reason().unwrap_or("Error"),
            status: status.as_u16(),
            detail: cut(&detail.into(), FIELD_PATH_BYTES + ERROR_TEXT_BYTES).into_owned(),
            reason,
            fields: Vec::new(),
            retry_after_ms: None,
        };
        Self { status, body: Box::new(body), header: None }
    }

    /// The same with a header that says more to programs.
    pub(super) fn with_header(self, name: HeaderName, value: HeaderValue) -> Self {
        Self { header: Some(Box::new((name, value))), ..self }
    }

    /// A body that is not JSON at all.
    pub(super) fn unparsable(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "UNPARSABLE", detail)
    }

    /// A handler that panicked, with its message.
    pub(super) fn panicked(panic: &(dyn Any + Send)) -> Self {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a text");
        tracing::error!(panic = text, "a handler panicked");
        Error::internal(text).into()
    }

    /// The document as text, for places that are no response of their own.
    pub(super) fn to_json(&self) -> String {
        // Strings and numbers always serialise, so the fallback is never seen.
        serde_json::to_string(&self.body).unwrap_or_default()
    }
}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        let mut problem = Self::new(error.http_status(), error.reason(), error.to_string());
        problem.body.fields = error.fields().iter().map(field).collect();
        problem.body.retry_after_ms =
            error.retry_after().map(|wait| wait.as_millis().try_into().unwrap_or(u64::MAX));
        problem
    }
}

fn field(FieldViolation { field, description, non_finite: _ }: &FieldViolation) -> Field {
    Field { field: field.clone(), description: description.clone() }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let mut response = (self.status, self.to_json() + "\n").into_response();
        let headers = response.headers_mut();
        headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        if let Some(header) = self.header {
            let (name, value) = *header;
            headers.insert(name, value);
        }
        if let Some(milliseconds) = self.body.retry_after_ms {
            // The header counts whole seconds; the document is exact.
            headers.insert(RETRY_AFTER, HeaderValue::from(milliseconds.div_ceil(1000)));
        }
        response
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn json(problem: &Problem) -> serde_json::Value {
        serde_json::from_str(&problem.to_json()).unwrap()
    }

    #[test]
    fn a_bad_field_is_named_with_what_is_wrong() {
        let problem = Problem::from(Error::field("prior.uncertainty", "2 is not between 0 and 1"));
        let expected = serde_json::json!({
            "type": "about:blank",
            "title": "Unprocessable Entity",
            "status": 422,
            "detail": "prior.uncertainty: 2 is not between 0 and 1",
            "reason": "FIELD_INVALID",
            "fields": [{ "field": "prior.uncertainty", "description": "2 is not between 0 and 1" }],
        });
        assert_eq!(json(&problem), expected);
    }

    #[test]
    fn a_full_queue_says_when_to_come_back() {
        let error = Error::QueueFull { queue: "session", retry_after: Duration::from_millis(1200) };
        let problem = Problem::from(error);
        assert_eq!(json(&problem)["retry_after_ms"], 1200);
        let response = problem.into_response();
        assert_eq!(response.status(), StatusCode::TOO_MANY_REQUESTS);
        assert_eq!(response.headers()[RETRY_AFTER], "2");
        assert_eq!(response.headers()[CONTENT_TYPE], "application/problem+json");
    }

    #[test]
    fn what_only_the_log_should_say_is_not_in_the_document() {
        let text = Problem::from(Error::internal("secret detail")).to_json();
        assert!(text.contains("INTERNAL") && !text.contains("secret"));
    }
}
