//! The attempts of a session as a table, one row each.
//!
//! Spreadsheets take a text for a formula that begins with one of a few characters, and what a robot is called comes
//! from outside: such a text gets an apostrophe in front.

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome;
use palpate_proto::v1::event::Kind;
use prost::Message;

use super::unwritten;
use crate::error::Error;
use crate::store::Event;
use crate::wire::{event, to_proto};

const COLUMNS: [&str; 20] = [
    "seq",
    "attempt",
    "time",
    "outcome",
    "candidate_id",
    "robot_id",
    "x_m",
    "y_m",
    "z_m",
    "force_n",
    "contact_uncertainty",
    "max_vertex_move_m",
    "mean_uncertainty",
    "max_uncertainty",
    "mean_std_m",
    "max_std_m",
    "contacts",
    "failures",
    "warnings",
    "retracted_by_seq",
];

/// A table that grows by the events of a log.
pub(crate) struct Table {
    csv: csv::Writer<Vec<u8>>,
    attempts: u32,
    /// After the event before.
    before: v1::SessionStats,
}

impl Table {
    /// The heads of the columns.
    ///
    /// # Errors
    /// None but by a bug of this server.
    pub(crate) fn new() -> Result<Self, Error> {
        let mut csv = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(Vec::new());
        csv.write_record(COLUMNS).map_err(unwritten)?;
        Ok(Self { csv, attempts: 0, before: v1::SessionStats::default() })
    }

    /// The next event of the log, which is a row if it is an attempt.
    ///
    /// # Errors
    /// The event cannot be read.
    pub(crate) fn add_event(&mut self, row: &Event, retracted_by: Option<i64>) -> Result<(), Error> {
        let unreadable = |error: prost::DecodeError| Error::internal(format!("event {}: {error}", row.seq));
        let stats = v1::SessionStats::decode(row.stats_after.as_slice()).map_err(unreadable)?;
        let before = std::mem::replace(&mut self.before, stats.clone());
        let kind = event::kind(row.seq, &row.payload).map_err(|error| Error::internal(error.to_string()))?;
        let Kind::ContactResult(result) = kind else { return Ok(()) };
        let Some(outcome) = outcome(&result, &before, &stats) else { return Ok(()) };
        let reply = v1::ReportContactResponse::decode(row.reply.as_slice()).map_err(unreadable)?;
        self.attempts += 1;
        let touched = reply.touched_points.first();
        let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
        self.csv
            .write_record([
                row.seq.to_string(),
                self.attempts.to_string(),
                to_proto::timestamp(row.append_us).to_string(),
                outcome.to_owned(),
                text(&result.candidate_id),
                text(&result.robot_id),
                number(touched.map(|point| point.x)),
                number(touched.map(|point| point.y)),
                number(touched.map(|point| point.z)),
                number(force_n(&result)),
                number(touched.map(|_| reply.contact_uncertainty)),
                number(Some(reply.max_vertex_move_m)),
                number(Some(stats.mean_uncertainty)),
                number(Some(stats.max_uncertainty)),
                number(stats.mean_std_m),
                number(stats.max_std_m),
                stats.contacts.to_string(),
                stats.failures.to_string(),
                reply.warning_details.len().to_string(),
                retracted_by.map(|seq| seq.to_string()).unwrap_or_default(),
            ])
            .map_err(unwritten)
    }

    /// The whole table.
    ///
    /// # Errors
    /// None but by a bug of this server.
    pub(crate) fn finish(self) -> Result<Vec<u8>, Error> {
        self.csv.into_inner().map_err(unwritten)
    }
}

/// What an attempt came to; nothing for what is none.
fn outcome(
    result: &v1::ContactResult,
    before: &v1::SessionStats,
    after: &v1::SessionStats,
) -> Option<&'static str> {
    // Whether a touch was early or beside the pad is found out by the session, which counts it.
    let touch = || {
        if after.early_contacts > before.early_contacts {
            "early_contact"
        } else if after.invalid_contacts > before.invalid_contacts {
            "invalid_contact"
        } else {
            "contact"
        }
    };
    match result.outcome.as_ref()? {
        Outcome::Contact(_) | Outcome::Contacts(_) => Some(touch()),
        Outcome::NoContact(_) => Some("no_contact"),
        Outcome::Rejected(_) => Some("rejected"),
        Outcome::InvalidContact(_) => Some("invalid_contact"),
        Outcome::ObjectMoved(_) => None,
    }
}

/// The magnitude of the force of the first contact, less that at rest, in newtons.
pub(super) fn force_n(result: &v1::ContactResult) -> Option<f64> {
    let contact = first_contact(result)?;
    let force = contact.wrench?.force?;
    let rest = contact.rest_wrench.and_then(|wrench| wrench.force).unwrap_or_default();
    let (x, y, z) = (force.x - rest.x, force.y - rest.y, force.z - rest.z);
    Some(nalgebra::Vector3::new(x, y, z).norm())
}

/// The contact that the candidate was meant for.
pub(super) fn first_contact(result: &v1::ContactResult) -> Option<&v1::Contact> {
    match result.outcome.as_ref()? {
        Outcome::Contact(contact) => Some(contact),
        Outcome::Contacts(v1::Contacts { contacts }) => contacts.first(),
        _ => None,
    }
}

/// A text that no spreadsheet takes for a formula.
fn text(text: &str) -> String {
    if text.starts_with(['=', '+', '-', '@', '\t', '\r']) { format!("'{text}") } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_no_formula() {
        for formula in ["=1+1", "+1", "-1", "@sum", "\tx"] {
            assert_eq!(text(formula), format!("'{formula}"));
        }
        assert_eq!(text("arm-1"), "arm-1");
    }

    #[test]
    fn the_force_is_that_of_the_touch_alone() {
        let wrench = |z: f64| v1::Wrench { force: Some(v1::Vector3 { x: 3.0, y: 0.0, z }), torque: None };
        let contact =
            v1::Contact { wrench: Some(wrench(-5.0)), rest_wrench: Some(wrench(-1.0)), ..Default::default() };
        let result = v1::ContactResult { outcome: Some(Outcome::Contact(contact)), ..Default::default() };
        assert_eq!(force_n(&result), Some(4.0));
    }
}
