//! What a command says when it does not go on.

use std::fmt::{Display, Formatter};

/// What happened and what to do, for people.
pub(crate) type Failure = Box<dyn std::error::Error + Send + Sync>;

/// An end that is no failure of the program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    /// Nobody reads the output any more, as in `palpate demo | head`.
    Unread,
    /// All was said that there is to say, and it is not well.
    Told,
    /// Ctrl-C; what there is to say of what was done until then.
    Interrupted(String),
}

impl Display for Ended {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unread => f.write_str("nobody reads the output any more"),
            Self::Told => f.write_str("not all is well"),
            Self::Interrupted(text) => f.write_str(text),
        }
    }
}

impl std::error::Error for Ended {}

/// Arguments that contradict each other in a manner that only the command itself knows.
pub(crate) fn wrong_usage(text: &str) -> Failure {
    clap::Error::raw(clap::error::ErrorKind::ArgumentConflict, format!("{text}\n")).into()
}
