//! One line of what was found: how it is, and what to do about it.

use std::fmt::{Display, Formatter};

use anstyle::{AnsiColor, Style};
use serde::Serialize;

use crate::terminal::{ODD, styled};

const BAD: Style = AnsiColor::Red.on_default();

/// How something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Level {
    Ok,
    Warning,
    Problem,
}

/// What was found out about one thing.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Finding {
    check: &'static str,
    pub(super) level: Level,
    found: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    advice: Option<&'static str>,
}

impl Display for Finding {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let level = match self.level {
            Level::Ok => "ok      ".to_owned(),
            Level::Warning => styled(ODD, "warning "),
            Level::Problem => styled(BAD, "problem "),
        };
        write!(f, "{level} {:<11} {}", self.check, self.found)?;
        self.advice.map_or(Ok(()), |advice| write!(f, "\n{:21}{advice}", ""))
    }
}

/// All that was found, in order.
#[derive(Debug, Default)]
pub(super) struct Findings(Vec<Finding>);

impl Findings {
    pub(super) fn all(&self) -> &[Finding] {
        &self.0
    }

    pub(super) fn ok(&mut self, check: &'static str, found: impl Into<String>) {
        self.0.push(Finding { check, level: Level::Ok, found: found.into(), advice: None });
    }

    pub(super) fn warn(&mut self, check: &'static str, found: impl Into<String>, advice: &'static str) {
        self.0.push(Finding { check, level: Level::Warning, found: found.into(), advice: Some(advice) });
    }

    pub(super) fn problem(&mut self, check: &'static str, found: impl Into<String>, advice: &'static str) {
        self.0.push(Finding { check, level: Level::Problem, found: found.into(), advice: Some(advice) });
    }
}
