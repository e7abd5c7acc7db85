//! An error as a gRPC status with the standard details, so that programs need not read the text.

use http::{HeaderMap, HeaderValue, Response};
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};

use crate::error::Error;
use crate::limits::{ERROR_TEXT_BYTES, FIELD_PATH_BYTES};
use crate::text::cut;

const DOMAIN: &str = "palpate.v1";

/// How the transport's words begin for bytes that are no message, or not a whole one.
const UNDECODABLE: [&str; 3] =
    ["failed to decode Protobuf message", "Unexpected EOF decoding stream", "Missing request message"];

/// The status of an error, with its reason, fields and advice on retries.
pub(super) fn status(error: &Error) -> Status {
    let mut details = ErrorDetails::new();
    details.set_error_info(error.reason(), DOMAIN, std::collections::HashMap::<String, String>::new());
    for field in error.fields() {
        details.add_bad_request_violation(&field.field, &field.description);
    }
    if let Some(after) = error.retry_after() {
        details.set_retry_info(Some(after));
    }
    add_subject(&mut details, error);
    Status::with_error_details(error.grpc_code(), text(error), details)
}

/// The error in words, with what has room in a header.
fn text(error: &Error) -> String {
    cut(&error.to_string(), FIELD_PATH_BYTES + ERROR_TEXT_BYTES).into_owned()
}

/// What the error is about, for the kinds that have a standard message for it.
fn add_subject(details: &mut ErrorDetails, error: &Error) {
    let text = text(error);
    match error {
        Error::SessionNotFound { session_id }
        | Error::SessionDeleted { session_id, request_id: _ }
        | Error::SessionExists { session_id } => {
            details.set_resource_info("session", session_id, "", text);
        }
        Error::SessionQuarantined { session_id, sound: _, reason: _ }
        | Error::SessionFinished { session_id } => {
            details.add_precondition_failure_violation(error.reason(), session_id, text);
        }
        Error::NoVisualPrior | Error::NoReference | Error::EtagMissing | Error::SessionFull { .. } => {
            details.add_precondition_failure_violation(error.reason(), "session", text);
        }
        Error::RevisionMismatch { expected, actual } => {
            set_info(details, error, [("expected", expected.to_string()), ("actual", actual.to_string())]);
        }
        Error::EtagMismatch { expected, actual } => {
            set_info(details, error, [("expected", expected.clone()), ("actual", actual.clone())]);
        }
        Error::Quota { what, limit, hint: _ } => {
            set_info(details, error, [("what", (*what).to_owned()), ("limit", limit.to_string())]);
        }
        Error::TooLarge { what, limit, hint: _ } => {
            set_info(details, error, [("what", what.clone()), ("limit", limit.clone())]);
        }
        Error::QueueFull { queue, retry_after: _ } | Error::Busy { queue, answered: _, retry_after: _ } => {
            set_info(details, error, [("queue", (*queue).to_owned())]);
        }
        Error::RequestIdReused { request_id } => {
            set_info(details, error, [("request_id", request_id.clone())]);
        }
        Error::HeaderTooLarge { bytes, limit } => {
            set_info(details, error, [("bytes", bytes.to_string()), ("limit", limit.to_string())]);
        }
        Error::Overloaded { limit } => set_info(details, error, [("limit", limit.to_string())]),
        Error::ScopeDenied { needed, has } => {
            set_info(details, error, [("needed", (*needed).to_owned()), ("has", (*has).to_owned())]);
        }
        Error::ExperimentDenied { prefix } => set_info(details, error, [("experiments", prefix.clone())]),
        Error::Fields(_)
        | Error::TokenMissing
        | Error::TokenInvalid
        | Error::TicketInvalid
        | Error::TokenExpired
        | Error::CertificateName { .. }
        | Error::BodyTooSlow { .. }
        | Error::HostMissing
        | Error::HostRefused { .. }
        | Error::OriginRefused { .. }
        | Error::Draining
        | Error::StoreFull
        | Error::StoreDown { .. }
        | Error::DeadlineExceeded
        | Error::Internal { .. } => {}
    }
}

fn set_info<const N: usize>(details: &mut ErrorDetails, error: &Error, metadata: [(&str, String); N]) {
    let metadata = metadata.map(|(key, value)| (key.to_owned(), cut(&value, FIELD_PATH_BYTES).into_owned()));
    details.set_error_info(error.reason(), DOMAIN, metadata);
}

/// A status that arose below the handlers, while a message was read.
pub(super) fn reading_error(failure: &Status, limit: usize) -> Error {
    // What was refused while the body came says so itself.
    let mut cause = std::error::Error::source(failure);
    while let Some(error) = cause {
        if let Some(refusal) = error.downcast_ref::<Error>() {
            return refusal.clone();
        }
        cause = error.source();
    }
    match failure.code() {
        Code::OutOfRange => too_large(limit),
        Code::Internal | Code::InvalidArgument => Error::field("message", failure.message()),
        _ => Error::internal(failure.to_string()),
    }
}

fn too_large(limit: usize) -> Error {
    Error::TooLarge {
        what: "the message".into(),
        limit: format!("{} MiB ({limit} bytes)", limit >> 20),
        hint: "thin the cloud before sending it, or send it in several views",
    }
}

/// What the transport refused while it read a message, in the words of this service: it calls an oversized message
/// OUT_OF_RANGE, which is RESOURCE_EXHAUSTED here, with the limit; and bytes that are no message INTERNAL, which is
/// INVALID_ARGUMENT here.
pub(super) async fn explain_reading(
    response: Response<axum::body::Body>,
    limit: usize,
) -> Response<axum::body::Body> {
    let Some(error) = refused_in_reading(response.headers(), limit) else { return response };
    let (mut parts, body) = response.into_parts();
    if status(&error).add_header(&mut parts.headers).is_err() {
        tracing::error!("a status does not fit into headers");
    }
    Response::from_parts(parts, body)
}

fn refused_in_reading(headers: &HeaderMap, limit: usize) -> Option<Error> {
    let code = headers.get("grpc-status")?;
    let is = |code_of: Code| *code == HeaderValue::from(i32::from(code_of));
    // Whatever this service refuses has details.
    if headers.contains_key("grpc-status-details-bin") || !(is(Code::OutOfRange) || is(Code::Internal)) {
        return None;
    }
    let failure = Status::from_header_map(headers)?;
    // A compressed message without its encoding has to be INTERNAL, as gRPC has it.
    let is_undecodable = UNDECODABLE.iter().any(|begin| failure.message().starts_with(begin));
    (failure.code() == Code::OutOfRange || is_undecodable).then(|| reading_error(&failure, limit))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn programs_can_read_the_reason_the_fields_and_when_to_retry() {
        let bad = status(&Error::field("result.contact.sensor_pose", "is missing")).get_error_details();
        assert_eq!(bad.error_info().map(|info| info.reason.as_str()), Some("FIELD_INVALID"));
        assert_eq!(bad.error_info().map(|info| info.domain.as_str()), Some(DOMAIN));
        let fields = &bad.bad_request().unwrap().field_violations;
        assert_eq!(fields[0].field, "result.contact.sensor_pose");

        let full = Error::QueueFull { queue: "compute", retry_after: Duration::from_millis(240) };
        let full = status(&full).get_error_details();
        assert_eq!(full.retry_info().unwrap().retry_delay, Some(Duration::from_millis(240)));

        let stale = status(&Error::RevisionMismatch { expected: 3, actual: 5 });
        assert_eq!(stale.code(), Code::Aborted);
        assert_eq!(stale.get_error_details().error_info().unwrap().metadata["actual"], "5");
    }

    #[tokio::test]
    async fn an_oversized_message_is_resource_exhausted_and_names_the_limit() {
        let refused: Response<axum::body::Body> =
            Status::out_of_range("decoded message too large").into_http();
        let explained = explain_reading(refused, 16 << 20).await;
        let status = Status::from_header_map(explained.headers()).unwrap();
        assert_eq!(status.code(), Code::ResourceExhausted);
        assert!(status.message().contains("16 MiB"));
        assert_eq!(status.get_error_details().error_info().unwrap().reason, "TOO_LARGE");
    }

    #[tokio::test]
    async fn bytes_that_are_no_message_are_the_callers_fault_and_a_bug_stays_one() {
        let explained = async |failure: Status| {
            let explained = explain_reading(failure.into_http(), 16 << 20).await;
            Status::from_header_map(explained.headers()).unwrap()
        };
        let text = "failed to decode Protobuf message: invalid wire type value: 7";
        let undecodable = explained(Status::internal(text)).await;
        assert_eq!(undecodable.code(), Code::InvalidArgument);
        assert_eq!(undecodable.message(), format!("message: {text}"));
        let details = undecodable.get_error_details();
        assert_eq!(details.bad_request().unwrap().field_violations[0].field, "message");
        assert_eq!(
            explained(Status::internal("Missing request message.")).await.code(),
            Code::InvalidArgument
        );
        let bug = explained(status(&Error::internal("failed to decode Protobuf message: in the log"))).await;
        assert_eq!(bug.code(), Code::Internal);
        assert_eq!(explained(Status::internal("something else")).await.code(), Code::Internal);
    }

    #[test]
    fn whatever_a_caller_sent_a_status_fits_into_the_headers_of_a_reply() {
        let long = || "ü\u{202e}".repeat(1 << 20);
        for error in [
            Error::field(long(), long()),
            Error::SessionNotFound { session_id: "x".repeat(64) },
            Error::EtagMismatch { expected: long(), actual: "\"5\"".into() },
            Error::TooLarge { what: long(), limit: "7".into(), hint: "send less" },
        ] {
            let headers = status(&error).into_http::<()>().into_parts().0.headers;
            let bytes: usize = headers.iter().map(|(name, value)| name.as_str().len() + value.len()).sum();
            assert!(bytes < 12 << 10, "{bytes} of {}", error.reason());
        }
    }
}
