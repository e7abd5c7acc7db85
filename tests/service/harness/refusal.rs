//! A refused call, whichever way it travelled. Each one that a test sees is held against the table of reasons.

use std::time::Duration;

use serde_json::Value;
use tonic::{Code, Status};
use tonic_types::StatusExt;

pub(crate) type Outcome<T> = Result<T, Refused>;

/// What a refusal says to programs and to people.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Refused {
    pub(crate) reason: String,
    pub(crate) message: String,
    /// Paths of the fields that are wrong.
    pub(crate) fields: Vec<String>,
    pub(crate) retry_after: Option<Duration>,
}

impl Refused {
    /// Reads a status and insists that it has the standard details.
    #[track_caller]
    pub(crate) fn from_status(status: &Status) -> Self {
        let details = status.get_error_details();
        let info = details.error_info().unwrap_or_else(|| panic!("a status without a reason: {status:?}"));
        assert_eq!(info.domain, "palpate.v1");
        let (code, _) = statuses(&info.reason);
        assert_eq!(status.code(), code, "{}", info.reason);
        let fields = details.bad_request().map(|bad| bad.field_violations.clone()).unwrap_or_default();
        Self {
            reason: info.reason.clone(),
            message: status.message().to_owned(),
            fields: fields.into_iter().map(|violation| violation.field).collect(),
            retry_after: details.retry_info().and_then(|info| info.retry_delay),
        }
        .checked()
    }

    /// Reads a problem document and insists that it is a whole one.
    #[track_caller]
    pub(crate) fn from_problem(status: u16, content_type: &str, body: &str) -> Self {
        assert_eq!(content_type, "application/problem+json", "{body}");
        let problem: Value = serde_json::from_str(body).unwrap();
        let reason = problem["reason"].as_str().unwrap().to_owned();
        assert_eq!(status, statuses(&reason).1, "{body}");
        assert_eq!(problem["status"], status);
        assert!(problem["type"].is_string() && problem["title"].is_string(), "{body}");
        let fields = problem["fields"].as_array().unwrap().iter();
        Self {
            reason,
            message: problem["detail"].as_str().unwrap().to_owned(),
            fields: fields.map(|field| field["field"].as_str().unwrap().to_owned()).collect(),
            retry_after: problem["retry_after_ms"].as_u64().map(Duration::from_millis),
        }
        .checked()
    }

    #[track_caller]
    fn checked(self) -> Self {
        assert!(!self.message.is_empty(), "people read the message: {self:?}");
        let is_about_fields = matches!(self.reason.as_str(), "FIELD_INVALID" | "NON_FINITE");
        assert_eq!(is_about_fields, !self.fields.is_empty(), "{self:?}");
        self
    }
}

/// The gRPC code and the HTTP status of each reason.
#[track_caller]
fn statuses(reason: &str) -> (Code, u16) {
    match reason {
        "FIELD_INVALID" | "NON_FINITE" => (Code::InvalidArgument, 422),
        "SESSION_NOT_FOUND" => (Code::NotFound, 404),
        "SESSION_EXISTS" | "REQUEST_ID_REUSED" => (Code::AlreadyExists, 409),
        "REVISION_MISMATCH" => (Code::Aborted, 409),
        "ETAG_MISMATCH" => (Code::Aborted, 412),
        "NO_VISUAL_PRIOR" | "NO_REFERENCE" | "SESSION_FINISHED" | "SESSION_FULL" | "SESSION_QUARANTINED" => {
            (Code::FailedPrecondition, 409)
        }
        "ETAG_MISSING" => (Code::FailedPrecondition, 428),
        "QUOTA" | "QUEUE_FULL" => (Code::ResourceExhausted, 429),
        "TOO_LARGE" => (Code::ResourceExhausted, 413),
        "OVERLOADED" => (Code::ResourceExhausted, 503),
        "HEADER_TOO_LARGE" => (Code::ResourceExhausted, 431),
        "BODY_TIMEOUT" => (Code::DeadlineExceeded, 408),
        "HOST_MISSING" => (Code::InvalidArgument, 400),
        "HOST_REFUSED" | "ORIGIN_REFUSED" => (Code::PermissionDenied, 403),
        "STORE_FULL" => (Code::ResourceExhausted, 507),
        "DRAINING" => (Code::Unavailable, 503),
        "STORE_DOWN" => (Code::Unavailable, 503),
        // These can happen over HTTP only.
        "UNPARSABLE" => (Code::Unknown, 400),
        "NO_SUCH_PATH" => (Code::Unknown, 404),
        "METHOD_NOT_ALLOWED" => (Code::Unknown, 405),
        "NOT_ACCEPTABLE" => (Code::Unknown, 406),
        "UNSUPPORTED_MEDIA_TYPE" => (Code::Unknown, 415),
        other => panic!("{other} is in no table"),
    }
}
