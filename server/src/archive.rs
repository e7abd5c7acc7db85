//! Sessions as files: a bundle that another server takes over, a table of attempts, a recording for viewers.
//!
//! ```text
//! events of the log, in order --> one of these writers, a few at a time --> bytes, a few at a time
//! bytes of a bundle --> what it says, checked member by member --> events of a log
//! ```
//! Nothing here waits or keeps more than a member of a file; docs/formats.md is the reference.

mod bundle;
mod check;
mod descriptors;
mod reading;
mod recording;
mod scene;
mod sink;
mod table;

pub(crate) use bundle::BundleWriter;
pub(crate) use check::{Origin, check};
pub(crate) use reading::{Bundle, read};
pub(crate) use recording::Recording;
pub(crate) use table::Table;

use std::fmt::Display;

use crate::error::Error;

/// What is wrong with a bundle that was sent.
fn wrong(description: impl Into<String>) -> Error {
    Error::field("data", description)
}

/// A failure of a writer into memory, which is a bug.
fn unwritten(error: impl Display) -> Error {
    Error::internal(format!("an archive could not be written: {error}"))
}
