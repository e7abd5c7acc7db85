//! From messages to values: everything that a caller can get wrong is refused here, by its name.

mod config;
mod contact;
mod definition;
mod depth;
mod geometry;
mod lease;
mod prior;
mod reference;
mod robot;
mod size;

use palpate_core::error::FieldError;
use palpate_proto::Timestamp;

use crate::error::{Error, FieldViolation};
use crate::limits::{Limits, SESSION_ID_BYTES};
use crate::text::{is_forbidden_in_names, quoted};

pub(crate) use contact::{Reported, reported, sent_report};
pub(crate) use definition::{check_labels, check_session_id, definition, fork};
pub(crate) use lease::{lease_duration, leases};
pub(crate) use prior::{Prior, is_readable, sent_prior, visual_prior};
pub(crate) use reference::{ReferenceFile, ReferenceNames, reference_file, reference_mesh};
pub(crate) use robot::{explaining, exploration_request};
pub(crate) use size::check_size;

/// The years 1 to 9999 in seconds since 1970, UTC: what a time in JSON may say.
const SHOWABLE_SECONDS: std::ops::RangeInclusive<i64> = -62_135_596_800..=253_402_300_799;

/// The method's complaint about a field, with the path at which the caller wrote it.
fn at(path: &str, error: FieldError) -> Error {
    let FieldError { field, reason, non_finite } = error;
    Error::Fields(vec![FieldViolation::new(format!("{path}.{field}"), reason, non_finite)])
}

fn required<'a, T>(field: &str, value: Option<&'a T>) -> Result<&'a T, Error> {
    value.ok_or_else(|| Error::field(field, "is missing"))
}

fn non_finite(field: impl Into<String>, description: impl Into<String>) -> Error {
    Error::Fields(vec![FieldViolation::new(field, description, true)])
}

/// Refuses a call that does not say which session it is about, or names one that cannot be: before anything else is
/// done with the id.
pub(crate) fn check_session_named(field: &str, session_id: &str) -> Result<(), Error> {
    let is_possible = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_' | b'.');
    if session_id.is_empty() {
        Err(Error::field(field, "is missing: say which session"))
    } else if session_id.len() > SESSION_ID_BYTES || !session_id.bytes().all(is_possible) {
        let rule = format!("ids have at most {SESSION_ID_BYTES} letters, digits and hyphens");
        Err(Error::field(field, format!("{} is no session's id: {rule}", quoted(session_id))))
    } else {
        Ok(())
    }
}

/// Refuses texts that are longer than `limit` bytes.
pub(crate) fn check_text(field: &str, text: &str, limit: usize) -> Result<(), Error> {
    if text.len() <= limit {
        return Ok(());
    }
    Err(Error::field(field, format!("has {} bytes, more than the limit of {limit}", text.len())))
}

/// Refuses names, labels and ids that are too long, or that have characters which nobody sees: they go into logs and
/// onto screens.
pub(crate) fn check_name(field: &str, name: &str, limits: &Limits) -> Result<(), Error> {
    check_text(field, name, limits.name_bytes)?;
    match name.chars().find(|&character| is_forbidden_in_names(character)) {
        Some(character) if !limits.unprintable_names => {
            let number = u32::from(character);
            let description = format!(
                "has the character U+{number:04X}: leave out control characters and bidirectional marks"
            );
            Err(Error::field(field, description))
        }
        _ => Ok(()),
    }
}

/// Refuses a time that JSON cannot write: it would be in the log, and no list of events could show it. Asked where it is
/// sent, not where a log is replayed.
fn check_showable(field: &str, time: Option<&Timestamp>) -> Result<(), Error> {
    match time {
        Some(Timestamp { seconds, nanos: _ }) if !SHOWABLE_SECONDS.contains(seconds) => {
            let description = format!("{seconds} s since 1970 are not within the years 1 to 9999");
            Err(Error::field(field, description))
        }
        _ => Ok(()),
    }
}

fn check_timestamp(field: &str, time: Option<&Timestamp>) -> Result<(), Error> {
    match time {
        Some(Timestamp { seconds: _, nanos }) if !(0..1_000_000_000).contains(nanos) => {
            Err(Error::field(field, format!("{nanos} ns are no part of a second")))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
