//! One row per view and per attempt of a session: how it went, what it changed, what others would have done.

use palpate_core::evidence::Evidence;
use palpate_core::exploration::{self, hindsight};
use palpate_core::geometry::{Point, SurfaceIndex};
use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome;
use palpate_proto::v1::event::Kind;

use super::{Api, Call};
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::session::{Snapshot, hex};
use crate::sessions::Aggregate;
use crate::store::Event;
use crate::wire::{event, to_proto};

/// Events read from the log at once, if they are not large.
const CHUNK: i64 = 64;

impl Api {
    /// One row per view and per attempt.
    ///
    /// # Errors
    /// No such session.
    pub(crate) async fn get_series(
        &self,
        request: v1::GetSeriesRequest,
        call: Call,
    ) -> Result<v1::GetSeriesResponse, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("GetSeries", &session_id, &call, async |deadline| {
            let v1::GetSeriesRequest { session_id, after_revision, without_shadow } = request;
            if after_revision < 0 {
                return Err(Error::field("after_revision", format!("{after_revision} is negative")));
            }
            let newest = self.sessions.at_revision(&session_id, 0, Queue::READERS, deadline).await?;
            let mut rows = self.rows(&newest, after_revision).await?;
            if without_shadow {
                rows.iter_mut().for_each(|row| row.shadow_choices.clear());
            }
            let (reference_sha256, errors_pending) = self.add_errors(&session_id, &mut rows).await?;
            let revision = newest.revision;
            let look_back = move || look_back(rows, &newest);
            let rows =
                self.sessions.pool.run(Queue::READERS, Work::Table, &session_id, deadline, look_back).await?;
            Ok(v1::GetSeriesResponse { rows, revision, reference_sha256, errors_pending })
        })
        .await
    }

    /// The rows of the events after `after`, up to a state, as the log has them.
    async fn rows(&self, newest: &Snapshot, after: i64) -> Result<Vec<v1::SeriesRow>, Error> {
        let (session_id, _) = newest.identity();
        let retractions = self.sessions.retractions(session_id, newest.revision).await?;
        let mut rows = Vec::new();
        let mut before = Before::default();
        // What a row says of the time since, and of an early contact, rests on the event before it.
        let mut last = (after - 1).max(0);
        while last < newest.revision {
            let (store, count) = (&self.sessions.store, CHUNK.min(newest.revision - last));
            let events = store.events_within(session_id, last, count, self.limits.read_bytes).await?;
            if events.is_empty() {
                return Err(Error::SessionNotFound { session_id: session_id.to_owned() });
            }
            for stored in events {
                last = stored.seq;
                let (row, this) = row(stored, &before, retractions.of(last))?;
                rows.extend(row.filter(|_| last > after));
                before = this;
            }
        }
        Ok(rows)
    }

    /// Adds the errors that are known: against which reference, and how many are missing, which are then computed.
    async fn add_errors(&self, session_id: &str, rows: &mut [v1::SeriesRow]) -> Result<(String, u32), Error> {
        let Some(kept) = self.sessions.store.reference(session_id).await? else {
            return Ok((String::new(), 0));
        };
        let known = self.known_errors(session_id).await?;
        let mut pending = 0;
        for row in rows {
            match known.get(&row.revision) {
                Some(error) => row.surface_distance_m = *error,
                None => pending += 1,
            }
        }
        if pending > 0 {
            self.compute_errors(session_id);
        }
        Ok((hex(&kept.key.sha256), pending))
    }
}

/// What a row needs to know of the event before it.
#[derive(Default)]
struct Before {
    early_contacts: u32,
    append_us: Option<i64>,
}

/// The row of an event, if it is a view or a result, and what the next one needs to know of it.
fn row(
    stored: Event,
    before: &Before,
    retracted_by: Option<i64>,
) -> Result<(Option<v1::SeriesRow>, Before), Error> {
    let append_us = stored.append_us;
    let event =
        event::decode(stored, false, retracted_by).map_err(|error| Error::internal(error.to_string()))?;
    let stats = event.stats_after.unwrap_or_default();
    let after = Before { early_contacts: stats.early_contacts, append_us: Some(append_us) };
    let is_early = stats.early_contacts > before.early_contacts;
    let (outcome, result) = match event.kind {
        Some(Kind::VisualPrior(_)) => ("view", v1::ContactResult::default()),
        Some(Kind::ContactResult(result)) => (outcome_name(result.outcome.as_ref(), is_early), result),
        _ => return Ok((None, after)),
    };
    let is_attempt = !matches!(outcome, "view" | "object_moved");
    // The events of a fork happened before it was made.
    let since_us = before.append_us.map_or(0, |before| (append_us - before).max(0));
    let row = v1::SeriesRow {
        revision: event.seq,
        attempt: if is_attempt { stats.attempts } else { 0 },
        append_time: event.append_time,
        outcome: outcome.to_owned(),
        force_n: force_n(&result),
        candidate_id: result.candidate_id,
        robot_id: result.robot_id,
        mean_uncertainty: stats.mean_uncertainty,
        max_uncertainty: stats.max_uncertainty,
        mean_std_m: stats.mean_std_m,
        failures: stats.failures,
        surface_distance_m: None,
        duration: Some(to_proto::duration(since_us)),
        doubted: false,
        retracted_by_seq: event.retracted_by_seq,
        shadow_choices: event.shadow_choices,
    };
    Ok((Some(row), after))
}

fn outcome_name(outcome: Option<&Outcome>, is_early: bool) -> &'static str {
    match outcome {
        Some(Outcome::Contact(_) | Outcome::Contacts(_)) if is_early => "early_contact",
        Some(Outcome::Contact(_) | Outcome::Contacts(_)) => "contact",
        Some(Outcome::NoContact(_)) => "no_contact",
        Some(Outcome::Rejected(_)) => "rejected",
        Some(Outcome::InvalidContact(_)) => "invalid_contact",
        Some(Outcome::ObjectMoved(_)) => "object_moved",
        None => "",
    }
}

/// The force at the touch that was aimed, less that at rest.
fn force_n(result: &v1::ContactResult) -> Option<f64> {
    let contact = match result.outcome.as_ref()? {
        Outcome::Contact(contact) => contact,
        Outcome::Contacts(contacts) => contacts.contacts.first()?,
        _ => return None,
    };
    let force = contact.wrench.as_ref()?.force?;
    let rest = contact.rest_wrench.as_ref().and_then(|rest| rest.force).unwrap_or_default();
    Some((force.x - rest.x).hypot(force.y - rest.y).hypot(force.z - rest.z))
}

/// The same rows with what is known at the newest revision: which touches are doubted, and what the others' choices
/// would have come to.
fn look_back(mut rows: Vec<v1::SeriesRow>, newest: &Snapshot) -> Vec<v1::SeriesRow> {
    let doubted: Vec<i64> = newest.findings.doubted.iter().map(|found| newest.seq_of(found.at)).collect();
    rows.iter_mut().for_each(|row| row.doubted = doubted.contains(&row.revision));
    if rows.iter().all(|row| row.shadow_choices.is_empty()) {
        return rows;
    }
    let surface = newest.reconstruction.surface();
    let Some(solid) = surface.and_then(|surface| SurfaceIndex::of_solid(&surface.mesh)) else { return rows };
    let failure_distance_m = newest.definition.config.failure_distance_m;
    // What was chosen before the object moved aims at where it is no more.
    let moved = last_motion(newest);
    let choices = rows.iter_mut().filter(|row| row.revision >= moved).flat_map(|row| &mut row.shadow_choices);
    for choice in choices {
        let Some(candidate) = &choice.candidate else { continue };
        let places = [candidate.point, candidate.probe_start, candidate.probe_end];
        let [Some(target), Some(start), Some(end)] = places.map(|place| place.map(point)) else { continue };
        let seen = match hindsight(&solid, &target, &start, &end, failure_distance_m) {
            exploration::Hindsight::Hit => v1::Hindsight::Hit,
            exploration::Hindsight::Miss => v1::Hindsight::Miss,
            exploration::Hindsight::Early => v1::Hindsight::Early,
        };
        choice.set_hindsight(seen);
    }
    rows
}

/// The first event after the last motion of the object, as it was reported or found.
fn last_motion(newest: &Snapshot) -> i64 {
    let reported = newest.evidence.iter().filter(|(_, evidence)| matches!(**evidence, Evidence::Moved(_)));
    let reported = reported.map(|(seq, _)| *seq).max();
    let found = newest.findings.motion.map(|motion| newest.seq_of(motion.since));
    reported.max(found).unwrap_or(0)
}

fn point(place: v1::Vector3) -> Point {
    Point::new(place.x, place.y, place.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wrench(z: f64) -> Option<v1::Wrench> {
        Some(v1::Wrench { force: Some(v1::Vector3 { x: 3.0, y: 0.0, z }), torque: None })
    }

    #[test]
    fn the_force_is_that_of_the_pad_that_was_aimed_less_that_at_rest() {
        let contact = v1::Contact { wrench: wrench(-5.0), rest_wrench: wrench(-1.0), ..Default::default() };
        let other = v1::Contact { wrench: wrench(0.0), ..Default::default() };
        let said = |outcome| v1::ContactResult { outcome: Some(outcome), ..Default::default() };
        assert_eq!(force_n(&said(Outcome::Contact(other.clone()))), Some(3.0));
        let both = v1::Contacts { contacts: vec![contact, other] };
        assert_eq!(force_n(&said(Outcome::Contacts(both))), Some(4.0));
        assert_eq!(force_n(&said(Outcome::NoContact(v1::NoContact::default()))), None);
        assert_eq!(force_n(&said(Outcome::Contact(v1::Contact::default()))), None);
    }
}
