//! A refused call, whichever way it travelled. Each one that a test sees is held against the table of reasons
//! in clients/README.md.

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
        assert_eq!(Some(status.code()), row(&info.reason).0, "{}", info.reason);
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
        assert_eq!(status, row(&reason).1, "{body}");
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
        let (_, _, is_to_wait) = row(&self.reason);
        assert!(!is_to_wait || self.retry_after.is_some(), "a time to wait is missing: {self:?}");
        self
    }
}

/// The page for authors of clients, with the table of reasons.
const DUTIES: &str = include_str!("../../../clients/README.md");

/// What the table says of a reason: the gRPC code, the HTTP status, and whether the answer names a time to wait.
#[track_caller]
fn row(reason: &str) -> (Option<Code>, u16, bool) {
    let line = DUTIES
        .lines()
        .find(|line| line.starts_with(&format!("| `{reason}` |")))
        .unwrap_or_else(|| panic!("{reason} is not in the table of clients/README.md"));
    let cells: Vec<_> = line.split('|').map(str::trim).collect();
    let code = (cells[2] != "-").then(|| code_named(cells[2]));
    (code, cells[3].parse().expect("an HTTP status"), cells[4] == "after the wait")
}

/// The code that the specification of gRPC calls `name`.
fn code_named(name: &str) -> Code {
    (0..17).map(Code::from_i32).find(|code| upper_snake(&format!("{code:?}")) == name).expect("a gRPC code")
}

fn upper_snake(camel: &str) -> String {
    let mut name = String::new();
    for (at, letter) in camel.chars().enumerate() {
        if at > 0 && letter.is_uppercase() {
            name.push('_');
        }
        name.push(letter.to_ascii_uppercase());
    }
    name
}
