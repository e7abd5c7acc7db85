//! What can go wrong with a call, in words that say what to do.
//!
//! Two cases matter to a caller: the server said no ([`Refusal`], with its reason and the fields at fault), or it
//! said nothing at all ([`Error::NoAnswer`]).

use std::error::Error as _;
use std::fmt;
use std::time::Duration;

use palpate_proto::v1::Problem;
use tonic::{Code, Status};
use tonic_types::StatusExt;

/// Why a call did not succeed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The text given as the server's address is none.
    #[error("{url:?} is not the address of a server; one looks like http://127.0.0.1:7257")]
    Url {
        /// The address as it was understood.
        url: String,
        /// What is wrong with it.
        source: tonic::transport::Error,
    },
    /// The certificates that were given cannot be used.
    #[error("{url} cannot be spoken to with these certificates: {detail}")]
    Tls {
        /// The address.
        url: String,
        /// What is the matter.
        detail: String,
    },
    /// What was given as a token is none.
    #[error("the token is none: it is one word, as `palpate token create` prints it")]
    Token,
    /// Nobody answers at the address, or not as the certificates want it.
    #[error(
        "no server answers at {url}: {}; is one running there? `palpate serve` starts one",
        causes(source)
    )]
    Connect {
        /// The address.
        url: String,
        /// What the connection failed with.
        source: tonic::transport::Error,
    },
    /// The server did not answer: the connection broke, or the deadline passed.
    /// Whether it acted on the call is not known; the same call with the same `request_id` is safe.
    #[error("the server did not answer in {attempts} attempt(s): {detail}")]
    NoAnswer {
        /// How often the call was tried.
        attempts: u32,
        /// What the last attempt failed with.
        detail: String,
    },
    /// The server refused the call; nothing was changed.
    #[error(transparent)]
    Refused(Box<Refusal>),
    /// The server's answer is not what the contract promises: client and server do not fit together.
    #[error("the server's answer cannot be understood: {what}: {detail}")]
    Malformed {
        /// Which part of the answer.
        what: &'static str,
        /// What is wrong with it.
        detail: String,
    },
}

/// The server's no: what is wrong, and what would be right.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub struct Refusal {
    /// The gRPC status code.
    pub code: Code,
    /// Why, for programs: for instance `SESSION_NOT_FOUND`; empty when the server gave no reason.
    pub reason: String,
    /// What is wrong, for people.
    pub message: String,
    /// Which fields of the request are wrong; empty when it is not about a field.
    pub fields: Vec<FieldProblem>,
    /// How long to wait before the next attempt, if the server said so.
    pub retry_after: Option<Duration>,
    /// How often the call was tried.
    pub attempts: u32,
}

/// What is wrong with one field of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldProblem {
    /// Path of the field, for instance `result.contact.sensor_pose`.
    pub field: String,
    /// What is wrong with it.
    pub description: String,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)?;
        for FieldProblem { field, description } in &self.fields {
            // A server may have said the same in its message.
            if !self.message.contains(description.as_str()) {
                write!(f, "; {field}: {description}")?;
            }
        }
        if self.reason.is_empty() {
            write!(f, " ({:?}", self.code)?;
        } else {
            write!(f, " ({}", self.reason)?;
        }
        if self.attempts > 1 {
            write!(f, ", after {} attempts", self.attempts)?;
        }
        f.write_str(")")
    }
}

impl Refusal {
    /// Whether the same call may succeed a little later without any change.
    fn is_transient(&self) -> bool {
        match self.code {
            // Nobody who cancels waits for the reply: one that arrives tells of a timeout on the way.
            Code::Unavailable | Code::DeadlineExceeded | Code::Cancelled => true,
            // Without a time to wait it is a limit that waiting does not lift, such as a size.
            Code::ResourceExhausted => self.retry_after.is_some(),
            // Somebody else changed the session: only the caller knows whether the call still makes sense.
            Code::Aborted => !matches!(self.reason.as_str(), "REVISION_MISMATCH" | "ETAG_MISMATCH"),
            _ => false,
        }
    }
}

impl Error {
    /// The gRPC status code of a refusal; `Unavailable` when the server did not answer.
    pub fn code(&self) -> Code {
        match self {
            Self::Url { .. } | Self::Tls { .. } | Self::Token => Code::InvalidArgument,
            Self::Connect { .. } | Self::NoAnswer { .. } => Code::Unavailable,
            Self::Refused(refusal) => refusal.code,
            Self::Malformed { .. } => Code::Internal,
        }
    }

    /// Why the server refused, for programs; empty when it gave no reason or did not refuse.
    pub fn reason(&self) -> &str {
        self.refusal().map_or("", |refusal| &refusal.reason)
    }

    /// The server's refusal, if it is one.
    pub fn refusal(&self) -> Option<&Refusal> {
        match self {
            Self::Refused(refusal) => Some(refusal),
            _ => None,
        }
    }

    /// Whether the same call, with the same `request_id`, may succeed a little later.
    pub fn is_transient(&self) -> bool {
        match self {
            Self::Connect { .. } | Self::NoAnswer { .. } => true,
            Self::Refused(refusal) => refusal.is_transient(),
            Self::Url { .. } | Self::Tls { .. } | Self::Token | Self::Malformed { .. } => false,
        }
    }

    pub(crate) fn from_status(status: &Status, attempts: u32) -> Self {
        // A status with a source was made on this side of the connection: the server said nothing.
        if status.source().is_some() {
            let detail = detail_of(status);
            return Self::NoAnswer { attempts, detail };
        }
        let details = status.get_error_details();
        let reason = details.error_info().map(|info| info.reason.clone());
        let violations = details.bad_request().map(|bad| bad.field_violations.as_slice());
        Self::Refused(Box::new(Refusal {
            code: status.code(),
            reason: reason.unwrap_or_default(),
            message: status.message().to_owned(),
            fields: violations
                .unwrap_or_default()
                .iter()
                .map(|violation| FieldProblem {
                    field: violation.field.clone(),
                    description: violation.description.clone(),
                })
                .collect(),
            retry_after: details.retry_info().and_then(|info| info.retry_delay),
            attempts,
        }))
    }

    pub(crate) fn from_problem(problem: Problem) -> Self {
        let Problem { code, message, fields, reason } = problem;
        let fields = fields
            .into_iter()
            .map(|violation| FieldProblem { field: violation.field, description: violation.description });
        Self::Refused(Box::new(Refusal {
            code: Code::from(code),
            reason,
            message,
            fields: fields.collect(),
            retry_after: None,
            attempts: 1,
        }))
    }
}

/// The message of a status with the last cause beneath it, which is the one that names the broken thing.
fn detail_of(status: &Status) -> String {
    let said = status.message();
    match first_cause(status) {
        Some(cause) if cause != said => format!("{said}: {cause}"),
        _ => said.to_owned(),
    }
}

/// What is at the bottom of an error of the transport, whose own words say nothing.
pub(crate) fn causes(error: &tonic::transport::Error) -> String {
    first_cause(error).unwrap_or_else(|| error.to_string())
}

fn first_cause(error: &dyn std::error::Error) -> Option<String> {
    std::iter::successors(error.source(), |cause| (*cause).source()).last().map(ToString::to_string)
}

#[cfg(test)]
mod tests {
    use tonic_types::ErrorDetails;

    use super::*;

    #[test]
    fn what_the_message_says_already_is_not_said_again_for_the_field() {
        let problem = FieldProblem { field: "top_k".to_owned(), description: "at most 64".to_owned() };
        let refusal = |message: &str| Refusal {
            code: Code::InvalidArgument,
            reason: "FIELD_INVALID".to_owned(),
            message: message.to_owned(),
            fields: vec![problem.clone()],
            retry_after: None,
            attempts: 1,
        };
        assert_eq!(refusal("top_k: at most 64").to_string(), "top_k: at most 64 (FIELD_INVALID)");
        assert_eq!(
            refusal("a field is wrong").to_string(),
            "a field is wrong; top_k: at most 64 (FIELD_INVALID)"
        );
    }

    #[test]
    fn each_reason_is_dealt_with_as_the_table_of_duties_says() {
        let table = include_str!("../../README.md");
        let rows: Vec<Vec<_>> = table
            .lines()
            .filter(|line| line.starts_with("| `"))
            .map(|line| line.split('|').map(str::trim).collect())
            .filter(|cells: &Vec<_>| cells.len() == 7 && cells[2] != "-")
            .collect();
        assert!(rows.len() > 20, "{rows:?}");
        for cells in rows {
            let (reason, code, again) = (cells[1].trim_matches('`'), cells[2], cells[4]);
            let code = (0..17)
                .map(Code::from_i32)
                .find(|one| format!("{one:?}").eq_ignore_ascii_case(&code.replace('_', "")));
            let mut details = ErrorDetails::new();
            details.set_error_info(reason, "palpate.v1", []);
            if again == "after the wait" {
                details.set_retry_info(Some(Duration::from_millis(10)));
            }
            let status = Status::with_error_details(code.expect("a gRPC code"), "no", details);
            assert_eq!(Error::from_status(&status, 1).is_transient(), again != "no", "{cells:?}");
        }
    }
}
