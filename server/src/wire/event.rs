//! Events as they are stored, and what they do to a session.
//!
//! The payload is the `kind` of the contract's `Event`, so the log keeps what the caller sent, bit
//! for bit. Reading it back and applying it is the same code as for a live request.

use std::sync::Arc;

use palpate_proto::v1::event::Kind;
use palpate_proto::{Bytes, v1};
use prost::Message;

use super::{from_proto, to_proto};
use crate::limits::Limits;
use crate::session::Snapshot;
use crate::sessions::{FoldError, Folding};
use crate::store::Event;

/// The stored form of an event: its name for people who read the table, and its bytes.
pub(crate) fn encode(kind: Kind) -> (&'static str, Vec<u8>) {
    let name = name(&kind);
    (name, v1::Event { kind: Some(kind), ..v1::Event::default() }.encode_to_vec())
}

/// What an event is called in the table.
pub(crate) fn name(kind: &Kind) -> &'static str {
    match kind {
        Kind::Created(_) => "created",
        Kind::VisualPrior(_) => "visual_prior",
        Kind::ContactResult(_) => "contact_result",
        Kind::RetractedSeq(_) => RETRACTED,
        Kind::Finished(_) => "finished",
        Kind::Lease(_) => "lease",
        Kind::Forked(_) => "forked",
        Kind::Updated(_) => "updated",
    }
}

/// The stored form of a retraction of the event `seq`.
pub(crate) fn encode_retraction(seq: i64, reason: String) -> (&'static str, Vec<u8>) {
    let kind = Some(Kind::RetractedSeq(seq));
    (RETRACTED, v1::Event { kind, retraction_reason: reason, ..v1::Event::default() }.encode_to_vec())
}

/// The name of retractions in the table.
pub(crate) const RETRACTED: &str = "retracted";

/// The contract's event, which `retracted_by` retracts if it is given; the bytes of a cloud or an image are left out
/// unless `include_points`.
///
/// # Errors
/// The stored bytes are no event.
pub(crate) fn decode(
    row: Event,
    include_points: bool,
    retracted_by: Option<i64>,
) -> Result<v1::Event, FoldError> {
    let seq = row.seq;
    let Event {
        seq: _,
        request_id,
        request_digest: _,
        kind: _,
        payload,
        reply,
        state_hash,
        stats_after,
        algorithm_version: _,
        append_us,
        actor,
    } = row;
    let failed = |reason: String| FoldError { seq, reason };
    let stats_after = v1::SessionStats::decode(stats_after.as_slice());
    let stats_after = stats_after.map_err(|error| failed(error.to_string()))?;
    let stored = stored(seq, &payload)?;
    let mut kind = stored.kind.ok_or_else(|| failed("says nothing".into()))?;
    let shadow_choices = shadow_choices(&kind, &reply).map_err(|error| failed(error.to_string()))?;
    if let (Kind::VisualPrior(prior), false) = (&mut kind, include_points) {
        prior.points = Bytes::new();
        if let Some(depth) = &mut prior.depth {
            depth.mask_u8 = Bytes::new();
        }
    }
    Ok(v1::Event {
        seq,
        append_time: Some(to_proto::timestamp(append_us)),
        actor,
        request_id: request_id.unwrap_or_default(),
        kind: Some(kind),
        stats_after: Some(stats_after),
        state_hash,
        retraction_reason: stored.retraction_reason,
        retracted_by_seq: retracted_by.unwrap_or(0),
        shadow_choices,
    })
}

/// What the strategies would have touched after an event, which is kept in the reply to it.
fn shadow_choices(kind: &Kind, reply: &[u8]) -> Result<Vec<v1::ShadowChoice>, prost::DecodeError> {
    Ok(match kind {
        Kind::VisualPrior(_) => v1::AddVisualPriorResponse::decode(reply)?.shadow_choices,
        Kind::ContactResult(_) => v1::ReportContactResponse::decode(reply)?.shadow_choices,
        _ => Vec::new(),
    })
}

/// How a log becomes a session.
pub(crate) const FOLDING: Folding<Snapshot> = Folding { fold, retracts, retraction: RETRACTED };

/// The session after a stored event, which is the creation where there is no session before.
///
/// # Errors
/// The event cannot be read, or cannot be applied here: the log is damaged or of another version.
fn fold(before: Option<&Snapshot>, row: &Event) -> Result<Snapshot, FoldError> {
    let (seq, limits) = (row.seq, &replay_limits());
    let failed = |reason: String| FoldError { seq, reason };
    let expected = before.map_or(1, |snapshot| snapshot.revision + 1);
    if seq != expected {
        return Err(failed(format!("event {expected} is missing")));
    }
    let after = match (before, kind(seq, &row.payload)?) {
        (None, Kind::Created(request)) => {
            let definition = from_proto::definition(&request, row.append_us, limits);
            let definition = definition.map_err(|error| failed(error.to_string()))?;
            return Ok(Snapshot::created(Arc::new(definition)));
        }
        (None, Kind::Forked(forked)) => {
            let definition = from_proto::fork(&forked, row.append_us, limits);
            let definition = definition.map_err(|error| failed(error.to_string()))?;
            return Ok(Snapshot::created(Arc::new(definition)));
        }
        (Some(before), Kind::VisualPrior(prior)) => {
            let view =
                from_proto::visual_prior("prior", &prior).map_err(|error| failed(error.to_string()))?;
            before.add_view(&view.evidence, prior.keep_clutter, row.append_us).map(|(after, _added)| after)
        }
        (Some(before), Kind::ContactResult(result)) => {
            let reported = from_proto::reported(&result, &before.definition, before.revision, limits);
            let reported = reported.map_err(|error| failed(error.to_string()))?;
            before
                .absorb(reported.evidence, &result.candidate_id, row.append_us)
                .map(|(after, _update)| after)
        }
        (Some(before), Kind::Lease(lease)) => {
            let leases = from_proto::leases(&lease).map_err(|error| failed(error.to_string()))?;
            Ok(before.lease(leases, row.append_us))
        }
        // Whoever folds leaves out the event that is retracted.
        (Some(before), Kind::RetractedSeq(retracted)) => Ok(before.retracted(retracted, row.append_us)),
        (Some(before), Kind::Updated(updated)) => Ok(renamed(before, updated, row.append_us)),
        (Some(before), Kind::Finished(note)) => Ok(before.finished(note, row.append_us)),
        (Some(_), Kind::Created(_) | Kind::Forked(_)) | (None, _) => {
            return Err(failed("a session has one creation, and begins with it".into()));
        }
    };
    after.map_err(|error| failed(error.to_string()))
}

/// The session after what people call it was changed, as an event says it.
pub(crate) fn renamed(before: &Snapshot, updated: v1::Updated, at_us: i64) -> Snapshot {
    let v1::Updated { update_mask, display_name, labels } = updated;
    let names =
        |field: &str| update_mask.as_ref().is_some_and(|mask| mask.paths.iter().any(|path| path == field));
    before.renamed(names(DISPLAY_NAME).then_some(display_name), names(LABELS).then_some(labels), at_us)
}

/// The names of what can be changed of a session, in masks.
pub(crate) const DISPLAY_NAME: &str = "display_name";
pub(crate) const LABELS: &str = "labels";

/// The event that this one retracts, if it is a retraction.
fn retracts(row: &Event) -> Option<i64> {
    match kind(row.seq, &row.payload) {
        Ok(Kind::RetractedSeq(seq)) if row.kind == RETRACTED => Some(seq),
        _ => None,
    }
}

/// What was accepted once is replayed, whatever today's limits on texts are.
pub(super) fn replay_limits() -> Limits {
    Limits {
        name_bytes: usize::MAX,
        text_bytes: usize::MAX,
        unprintable_names: true,
        labels: usize::MAX,
        ..Limits::default()
    }
}

/// What a stored event says.
///
/// # Errors
/// The stored bytes are no event.
pub(crate) fn kind(seq: i64, payload: &[u8]) -> Result<Kind, FoldError> {
    stored(seq, payload)?.kind.ok_or_else(|| FoldError { seq, reason: "says nothing".into() })
}

fn stored(seq: i64, payload: &[u8]) -> Result<v1::Event, FoldError> {
    v1::Event::decode(payload).map_err(|error| FoldError { seq, reason: error.to_string() })
}

/// The session, where it was told, and the candidates, if some were requested, that the reply to a stored
/// event carried.
///
/// # Errors
/// The stored reply cannot be read.
pub(crate) fn reply_after(row: &Event) -> Result<(Option<v1::Session>, Vec<v1::Candidate>), FoldError> {
    let seq = row.seq;
    let bytes = row.reply.as_slice();
    let parts = match kind(seq, &row.payload)? {
        Kind::VisualPrior(_) => {
            v1::AddVisualPriorResponse::decode(bytes).map(|reply| (reply.session, reply.candidates))
        }
        Kind::ContactResult(_) => {
            v1::ReportContactResponse::decode(bytes).map(|reply| (reply.session, reply.candidates))
        }
        // Asking is no news of the session, so the reply has none.
        Kind::Lease(_) => v1::ProposeContactsResponse::decode(bytes).map(|reply| (None, reply.candidates)),
        // The reply to a fork is of the session as a whole, and this is its first event.
        Kind::Forked(_) => {
            let first = fold(None, row)?;
            return Ok((Some(to_proto::session(&first)), Vec::new()));
        }
        Kind::Created(_) | Kind::RetractedSeq(_) | Kind::Updated(_) | Kind::Finished(_) => {
            v1::Session::decode(bytes).map(|session| (Some(session), Vec::new()))
        }
    };
    parts.map_err(|error| FoldError { seq, reason: error.to_string() })
}
