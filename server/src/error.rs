//! Why a call was refused: one enum, which gRPC and HTTP each render in their own way.
//!
//! `Display` is what the client reads: what is wrong and what to do. What only an operator should
//! read is in [`Error::detail`] and goes to the log.

use std::time::Duration;

use http::StatusCode;
use tonic::Code;

use crate::limits::{ERROR_TEXT_BYTES, FIELD_PATH_BYTES};
use crate::text::cut;

/// A refused call; the state is then as it was before.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum Error {
    /// One or more fields cannot be used.
    #[error("{}", describe(.0))]
    Fields(Vec<FieldViolation>),
    /// There is no such session.
    #[error("there is no session {session_id:?}")]
    SessionNotFound {
        /// Its id in the request.
        session_id: String,
    },
    /// The request created a session that is gone.
    #[error(
        "request_id {request_id:?} created the session {session_id:?}, which was deleted since: a new session needs a new request_id"
    )]
    SessionDeleted {
        /// Which was created then.
        session_id: String,
        /// Under which request.
        request_id: String,
    },
    /// The id is taken.
    #[error("a session {session_id:?} exists already: give another session_id")]
    SessionExists {
        /// Its id in the request.
        session_id: String,
    },
    /// The same request id came before with another body.
    #[error(
        "request_id {request_id:?} was used before with another body: a new request needs a new request_id"
    )]
    RequestIdReused {
        /// The id that came twice.
        request_id: String,
    },
    /// The session moved on since the caller looked.
    #[error(
        "expected_revision is {expected}, but the session is at revision {actual}: read it again and decide anew"
    )]
    RevisionMismatch {
        /// What the caller expected.
        expected: i64,
        /// The session's revision.
        actual: i64,
    },
    /// The session changed since the caller read this etag.
    #[error("the etag {expected:?} is stale, the session's is {actual:?}: read it again and decide anew")]
    EtagMismatch {
        /// What the caller expected.
        expected: String,
        /// The session's etag.
        actual: String,
    },
    /// A change that must say which state it was decided on does not.
    #[error("the session's etag is missing: read the session, and send its etag along with the change")]
    EtagMissing,
    /// The session was closed.
    #[error("session {session_id:?} is finished and takes no changes: fork it to go on")]
    SessionFinished {
        /// Which one.
        session_id: String,
    },
    /// There is no estimate yet.
    #[error("the session has no visual prior yet: call AddVisualPrior first")]
    NoVisualPrior,
    /// There is nothing to compare the estimate with.
    #[error("the session keeps no reference mesh: send one along, or set it first with SetReference")]
    NoReference,
    /// The log cannot be folded to a sound state.
    #[error(
        "session {session_id:?} is quarantined: {reason}; it can be read up to revision {sound} and takes no changes: go on in a new session, or restore a copy of the database"
    )]
    SessionQuarantined {
        /// Which one.
        session_id: String,
        /// The last revision that is sound; 0 for none.
        sound: i64,
        /// What is wrong with its log.
        reason: String,
    },
    /// The server holds as many of something as it may.
    #[error("the limit of {limit} {what} is reached: {hint}")]
    Quota {
        /// What there are too many of, in the plural.
        what: &'static str,
        /// How many there may be.
        limit: u64,
        /// What the caller can do.
        hint: &'static str,
    },
    /// The session holds as many contact results as it may.
    #[error(
        "the session has {limit} contact results, and takes no more: go on in a new session, and heed should_stop"
    )]
    SessionFull {
        /// How many there may be.
        limit: u32,
    },
    /// Too much work is waiting.
    #[error("the {queue} queue is full: try again in {} ms", .retry_after.as_millis())]
    QueueFull {
        /// Which queue.
        queue: &'static str,
        /// When to try again.
        retry_after: Duration,
    },
    /// What waits already would take longer than the caller has time.
    #[error(
        "what waits in the {queue} queue takes longer than this call's deadline leaves: it would be answered in {} ms; try again in {} ms with the same request_id, or with a later deadline",
        .answered.as_millis(), .retry_after.as_millis()
    )]
    Busy {
        /// Which queue.
        queue: &'static str,
        /// When it would be answered.
        answered: Duration,
        /// When to try again.
        retry_after: Duration,
    },
    /// The request, or what it would add up to, is too large.
    #[error("{what} is over the limit of {limit}: {hint}")]
    TooLarge {
        /// What is too large, with its size.
        what: String,
        /// The limit, with its unit.
        limit: String,
        /// What the caller can do.
        hint: &'static str,
    },
    /// The headers of a request are too large.
    #[error(
        "the request's headers are {bytes} bytes, over the limit of {limit} bytes: send fewer or shorter ones"
    )]
    HeaderTooLarge {
        /// How large they are.
        bytes: usize,
        /// How large they may be.
        limit: usize,
    },
    /// The body did not arrive in time.
    #[error(
        "the body did not arrive within the limit of {} s: send it faster, or in several requests", .limit.as_secs_f64()
    )]
    BodyTooSlow {
        /// How long it may take.
        limit: Duration,
    },
    /// The requests of all callers together are too much at the moment.
    #[error(
        "the server holds bodies of {limit} bytes already, its limit: try again in a moment, with the same request_id"
    )]
    Overloaded {
        /// How many bytes it may hold.
        limit: usize,
    },
    /// The request does not say which server it is for, or says it twice.
    #[error(
        "the request needs one Host header (:authority over HTTP/2): send the name that the server is called by"
    )]
    HostMissing,
    /// The request is for a name that is not this server's; a page that rebinds its own name sends such ones.
    #[error(
        "{host:?} is no name of this server: call it as localhost or 127.0.0.1, or start it with --allow-host and this name"
    )]
    HostRefused {
        /// The name in the request.
        host: String,
    },
    /// A web page of a site that may not call.
    #[error(
        "a web page of {site} may not call this server: start it with --allow-origin and the page's origin, such as http://localhost:5173"
    )]
    OriginRefused {
        /// Whose page it is.
        site: String,
    },
    /// A call without any sign of who makes it.
    #[error(
        "this call needs a token: send the header `authorization: Bearer TOKEN` with one that `palpate token create` made"
    )]
    TokenMissing,
    /// A token that is none of this server's, or was revoked.
    #[error("the token is not known here: it is mistyped, of another server, or was revoked")]
    TokenInvalid,
    /// A token whose time is over.
    #[error("the token has expired: ask who runs the server for a new one")]
    TokenExpired,
    /// A ticket that was used, is over a minute old, or was never given out.
    #[error(
        "the ticket is not known here: it opens one request, within a minute; get a new one with POST /v1/tickets"
    )]
    TicketInvalid,
    /// A certificate that the server trusts, of a name that says nothing to it.
    #[error(
        "the name {name:?} in the client's certificate is not of the form SCOPE:NAME or SCOPE:NAME:EXPERIMENTS, such as robot:arm-1"
    )]
    CertificateName {
        /// The name.
        name: String,
    },
    /// The caller may do less than the call needs.
    #[error("this call needs the scope {needed}, and the caller has {has}: use a token that was made for it")]
    ScopeDenied {
        /// What the call needs.
        needed: &'static str,
        /// What the caller has.
        has: &'static str,
    },
    /// The caller is kept to other experiments.
    #[error(
        "the caller is kept to experiments whose names begin with {prefix:?}: name one of them, or use another token"
    )]
    ExperimentDenied {
        /// How their names begin.
        prefix: String,
    },
    /// The server is about to stop.
    #[error("the server is shutting down: try again in a moment, with the same request_id")]
    Draining,
    /// The disk has no room for another event.
    #[error(
        "the server's disk is full, nothing was recorded: make room on it, then try again with the same request_id"
    )]
    StoreFull,
    /// The database does not answer.
    #[error("the event log cannot be reached, nothing was recorded: try again with the same request_id")]
    StoreDown {
        /// For the log only.
        detail: String,
    },
    /// The caller's deadline passed.
    #[error("the deadline passed before the call was answered: try again with the same request_id")]
    DeadlineExceeded,
    /// A bug of the server.
    #[error("internal error: nothing was changed; the server's log says more")]
    Internal {
        /// For the log only.
        detail: String,
    },
}

/// What is wrong with one field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FieldViolation {
    /// Path in the request as the caller wrote it, such as `result.contact.sensor_pose.orientation`.
    pub(crate) field: String,
    /// What is wrong and what would be right.
    pub(crate) description: String,
    /// Whether a number is NaN, infinite or beyond any workspace.
    pub(crate) non_finite: bool,
}

impl Error {
    /// A single field that is out of its range or of the wrong form.
    pub(crate) fn field(field: impl Into<String>, description: impl Into<String>) -> Self {
        Self::Fields(vec![FieldViolation::new(field, description, false)])
    }

    /// The same about a field that the caller wrote under another name.
    pub(crate) fn of_field(self, field: &str) -> Self {
        match self {
            Self::Fields(fields) => {
                let renamed = fields.into_iter().map(|old| FieldViolation { field: field.to_owned(), ..old });
                Self::Fields(renamed.collect())
            }
            other => other,
        }
    }

    /// A bug, described for the log.
    pub(crate) fn internal(detail: impl Into<String>) -> Self {
        Self::Internal { detail: detail.into() }
    }

    /// The reason for programs, the same over gRPC and HTTP.
    pub(crate) fn reason(&self) -> &'static str {
        match self {
            Self::Fields(fields) if fields.iter().any(|field| field.non_finite) => "NON_FINITE",
            Self::Fields(_) => "FIELD_INVALID",
            Self::SessionNotFound { .. } | Self::SessionDeleted { .. } => "SESSION_NOT_FOUND",
            Self::SessionExists { .. } => "SESSION_EXISTS",
            Self::RequestIdReused { .. } => "REQUEST_ID_REUSED",
            Self::RevisionMismatch { .. } => "REVISION_MISMATCH",
            Self::EtagMismatch { .. } => "ETAG_MISMATCH",
            Self::EtagMissing => "ETAG_MISSING",
            Self::SessionFinished { .. } => "SESSION_FINISHED",
            Self::NoVisualPrior => "NO_VISUAL_PRIOR",
            Self::NoReference => "NO_REFERENCE",
            Self::SessionQuarantined { .. } => "SESSION_QUARANTINED",
            Self::Quota { .. } => "QUOTA",
            Self::SessionFull { .. } => "SESSION_FULL",
            Self::QueueFull { .. } | Self::Busy { .. } => "QUEUE_FULL",
            Self::TooLarge { .. } => "TOO_LARGE",
            Self::HeaderTooLarge { .. } => "HEADER_TOO_LARGE",
            Self::BodyTooSlow { .. } => "BODY_TIMEOUT",
            Self::Overloaded { .. } => "OVERLOADED",
            Self::HostMissing => "HOST_MISSING",
            Self::HostRefused { .. } => "HOST_REFUSED",
            Self::OriginRefused { .. } => "ORIGIN_REFUSED",
            Self::TokenMissing => "TOKEN_MISSING",
            Self::TokenInvalid | Self::TicketInvalid => "TOKEN_INVALID",
            Self::TokenExpired => "TOKEN_EXPIRED",
            Self::CertificateName { .. } => "CERTIFICATE_NAME",
            Self::ScopeDenied { .. } | Self::ExperimentDenied { .. } => "SCOPE_DENIED",
            Self::Draining => "DRAINING",
            Self::StoreFull => "STORE_FULL",
            Self::StoreDown { .. } => "STORE_DOWN",
            Self::DeadlineExceeded => "DEADLINE_EXCEEDED",
            Self::Internal { .. } => "INTERNAL",
        }
    }

    /// The gRPC status code.
    pub(crate) fn grpc_code(&self) -> Code {
        match self {
            Self::Fields(_) | Self::HostMissing => Code::InvalidArgument,
            Self::HostRefused { .. }
            | Self::OriginRefused { .. }
            | Self::ScopeDenied { .. }
            | Self::ExperimentDenied { .. } => Code::PermissionDenied,
            Self::TokenMissing
            | Self::TokenInvalid
            | Self::TicketInvalid
            | Self::TokenExpired
            | Self::CertificateName { .. } => Code::Unauthenticated,
            Self::SessionNotFound { .. } | Self::SessionDeleted { .. } => Code::NotFound,
            Self::SessionExists { .. } | Self::RequestIdReused { .. } => Code::AlreadyExists,
            Self::RevisionMismatch { .. } | Self::EtagMismatch { .. } => Code::Aborted,
            Self::NoVisualPrior
            | Self::NoReference
            | Self::EtagMissing
            | Self::SessionFinished { .. }
            | Self::SessionQuarantined { .. }
            | Self::SessionFull { .. } => Code::FailedPrecondition,
            Self::Quota { .. }
            | Self::QueueFull { .. }
            | Self::Busy { .. }
            | Self::TooLarge { .. }
            | Self::HeaderTooLarge { .. }
            | Self::Overloaded { .. }
            | Self::StoreFull => Code::ResourceExhausted,
            Self::Draining | Self::StoreDown { .. } => Code::Unavailable,
            Self::DeadlineExceeded | Self::BodyTooSlow { .. } => Code::DeadlineExceeded,
            Self::Internal { .. } => Code::Internal,
        }
    }

    /// The HTTP status.
    pub(crate) fn http_status(&self) -> StatusCode {
        match self {
            Self::Fields(_) => StatusCode::UNPROCESSABLE_ENTITY,
            Self::SessionNotFound { .. } | Self::SessionDeleted { .. } => StatusCode::NOT_FOUND,
            Self::SessionExists { .. }
            | Self::RequestIdReused { .. }
            | Self::RevisionMismatch { .. }
            | Self::NoVisualPrior
            | Self::NoReference
            | Self::SessionFinished { .. }
            | Self::SessionFull { .. }
            | Self::SessionQuarantined { .. } => StatusCode::CONFLICT,
            Self::EtagMismatch { .. } => StatusCode::PRECONDITION_FAILED,
            Self::EtagMissing => StatusCode::PRECONDITION_REQUIRED,
            Self::Quota { .. } | Self::QueueFull { .. } | Self::Busy { .. } => StatusCode::TOO_MANY_REQUESTS,
            Self::TooLarge { .. } => StatusCode::PAYLOAD_TOO_LARGE,
            Self::HeaderTooLarge { .. } => StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE,
            Self::BodyTooSlow { .. } => StatusCode::REQUEST_TIMEOUT,
            Self::HostMissing => StatusCode::BAD_REQUEST,
            Self::HostRefused { .. }
            | Self::OriginRefused { .. }
            | Self::ScopeDenied { .. }
            | Self::ExperimentDenied { .. } => StatusCode::FORBIDDEN,
            Self::TokenMissing
            | Self::TokenInvalid
            | Self::TicketInvalid
            | Self::TokenExpired
            | Self::CertificateName { .. } => StatusCode::UNAUTHORIZED,
            Self::Draining | Self::StoreDown { .. } | Self::Overloaded { .. } => {
                StatusCode::SERVICE_UNAVAILABLE
            }
            Self::StoreFull => StatusCode::INSUFFICIENT_STORAGE,
            Self::DeadlineExceeded => StatusCode::GATEWAY_TIMEOUT,
            Self::Internal { .. } => StatusCode::INTERNAL_SERVER_ERROR,
        }
    }

    /// The fields that are wrong; empty when it is not about a field.
    pub(crate) fn fields(&self) -> &[FieldViolation] {
        if let Self::Fields(fields) = self { fields } else { &[] }
    }

    /// When the same call may succeed.
    pub(crate) fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::QueueFull { retry_after, .. } | Self::Busy { retry_after, .. } => Some(*retry_after),
            Self::Quota { .. } | Self::Draining | Self::StoreDown { .. } | Self::Overloaded { .. } => {
                Some(Duration::from_secs(1))
            }
            _ => None,
        }
    }

    /// Whether the call was not carried out for want of time, and nothing else is known to be wrong with it.
    pub(crate) fn is_about_time(&self) -> bool {
        matches!(self, Self::QueueFull { .. } | Self::Busy { .. } | Self::DeadlineExceeded)
    }

    /// What an operator should read beside the client's text.
    pub(crate) fn detail(&self) -> Option<&str> {
        match self {
            Self::StoreDown { detail } | Self::Internal { detail } => Some(detail),
            _ => None,
        }
    }
}

impl FieldViolation {
    /// What is wrong with a field, cut to what an answer has room for.
    pub(crate) fn new(field: impl Into<String>, description: impl Into<String>, non_finite: bool) -> Self {
        let (field, description) = (field.into(), description.into());
        Self {
            field: cut(&field, FIELD_PATH_BYTES).into_owned(),
            description: cut(&description, ERROR_TEXT_BYTES).into_owned(),
            non_finite,
        }
    }
}

fn describe(fields: &[FieldViolation]) -> String {
    let texts: Vec<String> = fields
        .iter()
        .map(|FieldViolation { field, description, non_finite: _ }| format!("{field}: {description}"))
        .collect();
    texts.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_number_has_its_own_reason() {
        let mut error = Error::field("prior.uncertainty", "1.5 is not between 0 and 1");
        assert_eq!(error.reason(), "FIELD_INVALID");
        assert_eq!(error.to_string(), "prior.uncertainty: 1.5 is not between 0 and 1");
        if let Error::Fields(fields) = &mut error {
            fields[0].non_finite = true;
        }
        assert_eq!((error.reason(), error.grpc_code()), ("NON_FINITE", Code::InvalidArgument));
    }

    #[test]
    fn whatever_a_caller_sent_an_error_stays_short() {
        let error = Error::field("k".repeat(4 << 20), "d".repeat(4 << 20));
        let violation = &error.fields()[0];
        assert!(violation.field.len() < 300 && violation.field.ends_with('…'), "{}", violation.field.len());
        assert!(violation.description.len() < 1100, "{}", violation.description.len());
    }

    #[test]
    fn what_the_log_says_is_not_what_the_client_reads() {
        let error = Error::internal("index out of bounds in template.rs");
        assert!(!error.to_string().contains("template.rs"));
        assert_eq!(error.detail(), Some("index out of bounds in template.rs"));
    }
}
