//! What the log in a bundle says, held against what this server would have accepted.
//!
//! A fold reads a log as one that was checked when it was written, with no bound on texts. Here it was not.

use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use prost::Message;
use uuid::Uuid;

use super::reading::Bundle;
use super::wrong;
use crate::error::Error;
use crate::limits::Limits;
use crate::session::Definition;
use crate::store::Event;
use crate::text::quoted;
use crate::wire::{event, from_proto};

/// Bytes of a digest, and of one in hexadecimal.
const DIGEST_BYTES: usize = 32;
/// The years 1970 to 9999, in microseconds.
const TIMES_US: std::ops::RangeInclusive<i64> = 0..=253_402_300_799_999_999;

/// The session that a bundle is of, as its log ends.
#[derive(Debug)]
pub(crate) struct Origin {
    pub(crate) definition: Definition,
    /// The last event that a fork of it has: that it was finished is no part of one.
    pub(crate) last_to_copy: i64,
    is_finished: bool,
}

/// Whether an id is one that a server gives or takes.
pub(super) fn is_session_id(id: &str) -> bool {
    from_proto::check_session_id(id).is_ok() || Uuid::try_parse(id).is_ok_and(|uuid| uuid.to_string() == id)
}

/// Checks each event by itself.
///
/// # Errors
/// An event could not have been accepted here, by its number; `data` says what is wrong.
pub(crate) fn check(bundle: &Bundle, limits: &Limits) -> Result<Origin, Error> {
    let Bundle { session_id, events } = bundle;
    let mut origin: Option<Origin> = None;
    let mut attempts = 0;
    for row in events {
        let failed =
            |error: Error| wrong(format!("has an event {} that cannot be taken over: {error}", row.seq));
        let kind = check_columns(row, session_id, limits).map_err(failed)?;
        if let Kind::ContactResult(_) = kind {
            attempts += 1;
        }
        if attempts > limits.contacts {
            let limit = limits.contacts;
            return Err(wrong(format!("has more contact results than the limit of {limit} for a session")));
        }
        match &mut origin {
            None => origin = Some(first(&kind, row, session_id, limits).map_err(failed)?),
            Some(origin) => follow(origin, kind, row, limits).map_err(failed)?,
        }
    }
    origin.ok_or_else(|| wrong("has no events"))
}

fn first(kind: &Kind, row: &Event, session_id: &str, limits: &Limits) -> Result<Origin, Error> {
    let definition = match kind {
        Kind::Created(request) => from_proto::definition(request, row.append_us, limits)?,
        Kind::Forked(forked) => from_proto::fork(forked, row.append_us, limits)?,
        _ => return Err(Error::field("kind", "a log begins with a creation")),
    };
    if definition.session_id != session_id {
        let description = format!("creates {} and no {}", quoted(&definition.session_id), quoted(session_id));
        return Err(Error::field("session_id", description));
    }
    let ancestors = definition.ancestors.iter();
    if ancestors.clone().count() > limits.archive_members
        || ancestors.into_iter().any(|a| !is_session_id(&a.session_id))
    {
        return Err(Error::field("ancestors", "has one that is no session"));
    }
    Ok(Origin { definition, last_to_copy: row.seq, is_finished: false })
}

fn follow(origin: &mut Origin, kind: Kind, row: &Event, limits: &Limits) -> Result<(), Error> {
    let Origin { definition, last_to_copy, is_finished } = origin;
    if *is_finished {
        return Err(Error::field("kind", "comes after the session was finished"));
    }
    match kind {
        Kind::ContactResult(result) => {
            from_proto::reported(&result, definition, row.seq - 1, limits)?;
        }
        Kind::Updated(v1::Updated { update_mask, display_name, labels }) => {
            from_proto::check_name("display_name", &display_name, limits)?;
            from_proto::check_labels(&labels, limits)?;
            let paths = update_mask.unwrap_or_default().paths;
            if paths.iter().any(|path| path == event::DISPLAY_NAME) {
                definition.display_name = display_name;
            }
            if paths.iter().any(|path| path == event::LABELS) {
                definition.labels = labels;
            }
        }
        Kind::Finished(note) => {
            from_proto::check_text("note", &note, limits.text_bytes)?;
            *is_finished = true;
            return Ok(());
        }
        Kind::Lease(lease) => {
            from_proto::leases(&lease)?;
            from_proto::check_name("robot_id", &lease.robot_id, limits)?;
            if lease.candidate_ids.len() > limits.leased_places {
                return Err(Error::field("candidate_ids", "has more places than a session may lease"));
            }
        }
        Kind::VisualPrior(_) | Kind::RetractedSeq(_) => {}
        Kind::Created(_) | Kind::Forked(_) => {
            return Err(Error::field("kind", "a log has one creation, and begins with it"));
        }
    }
    *last_to_copy = row.seq;
    Ok(())
}

/// What goes with an event: as this server would have written it.
fn check_columns(row: &Event, session_id: &str, limits: &Limits) -> Result<Kind, Error> {
    let Event {
        seq: _,
        request_id,
        request_digest,
        kind: name,
        payload,
        reply: _,
        state_hash,
        stats_after,
        algorithm_version,
        append_us,
        actor,
    } = row;
    from_proto::check_name("request_id", request_id.as_deref().unwrap_or_default(), limits)?;
    from_proto::check_name("algorithm_version", algorithm_version, limits)?;
    from_proto::check_name("actor", actor, limits)?;
    let is_hash =
        state_hash.len() == 2 * DIGEST_BYTES && state_hash.bytes().all(|byte| byte.is_ascii_hexdigit());
    if !is_hash || !matches!(request_digest.len(), 0 | DIGEST_BYTES) {
        return Err(Error::field("state_hash", "is no SHA-256, or the request_digest is none"));
    }
    if !TIMES_US.contains(append_us) {
        return Err(Error::field("append_us", format!("{append_us} is no time")));
    }
    let undecodable =
        |field: &'static str| move |error: prost::DecodeError| Error::field(field, error.to_string());
    v1::SessionStats::decode(stats_after.as_slice()).map_err(undecodable("stats_after"))?;
    let stored = v1::Event::decode(payload.as_slice()).map_err(undecodable("payload"))?;
    from_proto::check_text("retraction_reason", &stored.retraction_reason, limits.text_bytes)?;
    let kind = stored.kind.ok_or_else(|| Error::field("payload", "says nothing"))?;
    if event::name(&kind) != name {
        return Err(Error::field("kind", format!("{} is not what the event is", quoted(name))));
    }
    let of_the_reply = |error: crate::sessions::FoldError| Error::field("reply", error.to_string());
    let (session, _) = event::reply_after(row).map_err(of_the_reply)?;
    if session.is_some_and(|session| session.session_id != session_id) {
        return Err(Error::field("reply", "is about another session"));
    }
    Ok(kind)
}
