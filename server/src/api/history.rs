//! Changes of a session that bring no evidence: its names, its end, and what is taken back.

use std::sync::Arc;

use palpate_proto::v1;
use palpate_proto::v1::event::Kind;

use super::{Api, Call, appended, computed, request_key, stored};
use crate::compute::Work;
use crate::error::Error;
use crate::limits::{Limits, OPAQUE_BYTES};
use crate::session::Snapshot;
use crate::sessions::{Change, Decision};
use crate::text::quoted;
use crate::wire::event::{DISPLAY_NAME, LABELS};
use crate::wire::{event, from_proto, to_proto};

impl Api {
    /// Changes what people call a session.
    ///
    /// # Errors
    /// A field cannot be changed or cannot be used, or the etag is missing or stale.
    pub(crate) async fn update_session(
        &self,
        request: v1::UpdateSessionRequest,
        call: Call,
    ) -> Result<v1::Session, Error> {
        let session_id =
            request.session.as_ref().map(|session| session.session_id.clone()).unwrap_or_default();
        self.run("UpdateSession", &session_id, &call, async |deadline| {
            from_proto::check_session_named("session.session_id", &session_id)?;
            self.check_visible(&session_id, &call.caller).await?;
            let key = request_key(&request.request_id, &request, &self.limits)?;
            let v1::UpdateSessionRequest { session, update_mask, request_id: _ } = request;
            let session = session.unwrap_or_default();
            let updated = updated(&session, update_mask, &self.limits)?;
            from_proto::check_text("session.etag", &session.etag, OPAQUE_BYTES)?;
            if session.etag.is_empty() {
                return Err(Error::EtagMissing);
            }
            let etag = session.etag;
            let compute = move |before: &Snapshot| {
                check_etag(before, &etag)?;
                let after = event::renamed(before, updated.clone(), before.next_event_us());
                let reply = to_proto::session(&after);
                let new_labels = updated_labels(&updated, &after);
                let mut computed = computed(after, &reply);
                computed.new_labels = new_labels;
                Ok(Decision::Append(event::encode(Kind::Updated(updated.clone())), computed))
            };
            let actor = call.caller.actor().to_owned();
            let compute = Arc::new(compute);
            let change = Change {
                session_id: session_id.clone(),
                request: key,
                expected_revision: None,
                actor,
                work: Work::Edit,
                compute,
            };
            stored(&self.sessions.change(change, deadline).await?.bytes)
        })
        .await
    }

    /// Closes a session.
    ///
    /// # Errors
    /// It is closed already, or its etag is another one.
    pub(crate) async fn finish_session(
        &self,
        request: v1::FinishSessionRequest,
        call: Call,
    ) -> Result<v1::Session, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("FinishSession", &session_id, &call, async |deadline| {
            let key = request_key(&request.request_id, &request, &self.limits)?;
            let v1::FinishSessionRequest { session_id, etag, note, request_id: _ } = request;
            from_proto::check_text("etag", &etag, OPAQUE_BYTES)?;
            from_proto::check_text("note", &note, self.limits.text_bytes)?;
            let compute = move |before: &Snapshot| {
                if !etag.is_empty() {
                    check_etag(before, &etag)?;
                }
                let after = before.finished(note.clone(), before.next_event_us());
                let reply = to_proto::session(&after);
                Ok(appended(event::encode(Kind::Finished(note.clone())), after, &reply))
            };
            let (actor, compute) = (call.caller.actor().to_owned(), Arc::new(compute));
            let work = Work::Edit;
            let change = Change { session_id, request: key, expected_revision: None, actor, work, compute };
            stored(&self.sessions.change(change, deadline).await?.bytes)
        })
        .await
    }

    /// Takes a view or a result out of the estimate.
    ///
    /// # Errors
    /// The event is none that counts, or later events need it.
    pub(crate) async fn retract_event(
        &self,
        request: v1::RetractEventRequest,
        call: Call,
    ) -> Result<v1::Session, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("RetractEvent", &session_id, &call, async |deadline| {
            let key = request_key(&request.request_id, &request, &self.limits)?;
            let v1::RetractEventRequest { session_id, seq, reason, request_id: _ } = request;
            from_proto::check_text("reason", &reason, self.limits.text_bytes)?;
            let compute = move |before: &Snapshot| {
                check_retractable(before, seq)?;
                let (at_us, reason) = (before.next_event_us(), reason.clone());
                Ok(Decision::Retract(
                    seq,
                    Box::new(move |without: &Snapshot| {
                        let after = without.retracted(seq, at_us);
                        let reply = to_proto::session(&after);
                        (event::encode_retraction(seq, reason), computed(after, &reply))
                    }),
                ))
            };
            let (actor, compute) = (call.caller.actor().to_owned(), Arc::new(compute));
            let work = Work::Edit;
            let change = Change { session_id, request: key, expected_revision: None, actor, work, compute };
            stored(&self.sessions.change(change, deadline).await?.bytes)
        })
        .await
    }
}

fn check_etag(session: &Snapshot, etag: &str) -> Result<(), Error> {
    let actual = session.etag();
    if etag.trim_matches('"') == actual {
        return Ok(());
    }
    Err(Error::EtagMismatch { expected: etag.to_owned(), actual })
}

fn check_retractable(session: &Snapshot, seq: i64) -> Result<(), Error> {
    if session.is_evidence(seq) {
        return Ok(());
    }
    let description = if session.retracted.contains(&seq) {
        format!("event {seq} is retracted already")
    } else if (1..=session.revision).contains(&seq) {
        format!("event {seq} is no evidence that counts: views and contact results can be retracted")
    } else {
        format!("there is no event {seq}: the session's last event is {}", session.revision)
    };
    Err(Error::field("seq", description))
}

/// What changes by a request, as the log keeps it.
fn updated(
    session: &v1::Session,
    update_mask: Option<palpate_proto::FieldMask>,
    limits: &Limits,
) -> Result<v1::Updated, Error> {
    let mask = update_mask.unwrap_or_default();
    if mask.paths.is_empty() {
        let description = format!("is empty: name what is to change, {DISPLAY_NAME} or {LABELS}");
        return Err(Error::field("update_mask", description));
    }
    if let Some(other) = mask.paths.iter().find(|path| ![DISPLAY_NAME, LABELS].contains(&path.as_str())) {
        let description =
            format!("{} cannot be changed: only {DISPLAY_NAME} and {LABELS} can", quoted(other));
        return Err(Error::field("update_mask", description));
    }
    let names = |field: &str| mask.paths.iter().any(|path| path == field);
    let mut updated = v1::Updated::default();
    if names(DISPLAY_NAME) {
        from_proto::check_name("session.display_name", &session.display_name, limits)?;
        updated.display_name.clone_from(&session.display_name);
    }
    if names(LABELS) {
        from_proto::check_labels(&session.labels, limits)?;
        updated.labels.clone_from(&session.labels);
    }
    let paths = [DISPLAY_NAME, LABELS].into_iter().filter(|field| names(field)).map(str::to_owned).collect();
    updated.update_mask = Some(palpate_proto::FieldMask { paths });
    Ok(updated)
}

fn updated_labels(
    updated: &v1::Updated,
    after: &Snapshot,
) -> Option<std::collections::BTreeMap<String, String>> {
    let mask = updated.update_mask.as_ref()?;
    mask.paths.iter().any(|path| path == LABELS).then(|| after.definition.labels.clone())
}
