//! The robot's loop: add a view, ask where to touch, report what came of it.

use std::sync::Arc;

use palpate_core::exploration::{self, Proposal};
use palpate_core::warning::{Warning, WarningKind};
use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use tokio::time::Instant;

use super::lease::Wish;
use super::{Api, Call, computed, request_key, stored};
use crate::access::Scope;
use crate::compute::{Queue, Work};
use crate::error::{Error, FieldViolation};
use crate::limits::Limits;
use crate::session::{AddedView, Question, SessionState, Snapshot, now_us};
use crate::sessions::{Change, Computed, Decision, RequestKey};
use crate::wire::{event, from_proto, to_proto};

/// Where a caller wrote the parts of a request: the unary calls and the stream differ in that.
#[derive(Clone, Copy, Debug)]
pub(super) struct FieldNames {
    pub(super) prior: &'static str,
    pub(super) propose: &'static str,
    pub(super) robot: &'static str,
    pub(super) lease: &'static str,
    pub(super) explain: &'static str,
}

const UNARY: FieldNames = FieldNames {
    prior: "prior",
    propose: "propose",
    robot: "robot",
    lease: "lease",
    explain: "explain_vertices",
};

impl Api {
    /// Adds a camera's view of the object.
    ///
    /// # Errors
    /// The view cannot be used, or the session is not as the caller expects.
    pub(crate) async fn add_visual_prior(
        &self,
        request: v1::AddVisualPriorRequest,
        call: Call,
    ) -> Result<v1::AddVisualPriorResponse, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("AddVisualPrior", &session_id, &call, async |deadline| {
            let key = request_key(&request.request_id, &request, &self.limits)?;
            self.add_prior(request, None, key, call.caller.actor(), UNARY, deadline).await
        })
        .await
    }

    /// Proposes where to touch next; changes nothing unless a lease is asked.
    ///
    /// # Errors
    /// A field cannot be used, or there is no estimate yet.
    pub(crate) async fn propose_contacts(
        &self,
        request: v1::ProposeContactsRequest,
        call: Call,
    ) -> Result<v1::ProposeContactsResponse, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("ProposeContacts", &session_id, &call, async |deadline| {
            // Without one it only reads.
            if request.lease.is_some() {
                call.caller.check(Scope::Robot)?;
            }
            self.propose(request, call.caller.actor(), FieldNames { propose: "top_k", ..UNARY }, deadline)
                .await
        })
        .await
    }

    /// Reports what came of an approach.
    ///
    /// # Errors
    /// The report cannot be used, or the session is not as the caller expects.
    pub(crate) async fn report_contact(
        &self,
        request: v1::ReportContactRequest,
        call: Call,
    ) -> Result<v1::ReportContactResponse, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("ReportContact", &session_id, &call, async |deadline| {
            let key = request_key(&request.request_id, &request, &self.limits)?;
            self.report(request, key, call.caller.actor(), UNARY, deadline).await
        })
        .await
    }

    pub(super) async fn add_prior(
        &self,
        request: v1::AddVisualPriorRequest,
        robot: Option<&v1::RobotContext>,
        key: RequestKey,
        actor: &str,
        names: FieldNames,
        deadline: Instant,
    ) -> Result<v1::AddVisualPriorResponse, Error> {
        let v1::AddVisualPriorRequest { session_id, prior, expected_revision, request_id: _, propose } =
            request;
        let prior = prior.ok_or_else(|| Error::field(names.prior, "is missing"))?;
        let wanted =
            from_proto::exploration_request(names.propose, propose, names.robot, robot, &self.limits)?;
        let event = event::encode(Kind::VisualPrior(prior.clone()));
        let compute = move |before: &Snapshot| {
            let at_us = before.next_event_us();
            let computed = absorb_prior(before, &prior, names.prior, &wanted, at_us)?;
            Ok(Decision::Append(event.clone(), computed))
        };
        let (actor, work, compute) = (actor.to_owned(), Work::View, Arc::new(compute));
        let change = Change { session_id, request: key, expected_revision, actor, work, compute };
        let reply = self.sessions.change(change, deadline).await?;
        let first: v1::AddVisualPriorResponse = stored(&reply.bytes)?;
        if !reply.duplicate {
            self.metrics().view(&first.warning_details);
        }
        Ok(first)
    }

    pub(super) async fn propose(
        &self,
        request: v1::ProposeContactsRequest,
        actor: &str,
        names: FieldNames,
        deadline: Instant,
    ) -> Result<v1::ProposeContactsResponse, Error> {
        // Only a lease changes anything, so without one asking again needs no protection.
        let key = request_key(&request.request_id, &request, &self.limits)?;
        let v1::ProposeContactsRequest { session_id, top_k, robot, lease, request_id: _, explain_vertices } =
            request;
        let top_k = top_k.max(1);
        let question =
            from_proto::exploration_request(names.propose, top_k, names.robot, robot.as_ref(), &self.limits)?;
        let question = from_proto::explaining(names.explain, explain_vertices, question, &self.limits)?;
        if let Some(wanted) = lease {
            let duration =
                from_proto::lease_duration(names.lease, wanted, names.robot, &question, &self.limits)?;
            let wish = Wish { question, duration, explain_field: names.explain };
            return self.lease(session_id, wish, key, actor, deadline).await;
        }
        let snapshot = self.sessions.newest(&session_id, deadline).await?;
        if snapshot.state == SessionState::Finished {
            // Whoever asks is about to move, and could not report what came of it.
            return Err(Error::SessionFinished { session_id });
        }
        if snapshot.reconstruction.last_estimate().is_none() {
            return Err(Error::NoVisualPrior);
        }
        check_explained(&snapshot, &question, names.explain)?;
        let propose = move || answer(&snapshot, &question, &snapshot.propose(&question, now_us()));
        let pool = &self.sessions.pool;
        let reply = pool.run(Queue::ROBOTS, Work::Proposal, &session_id, deadline, propose).await?;
        self.metrics().warned(&reply.warning_details);
        Ok(reply)
    }

    pub(super) async fn report(
        &self,
        request: v1::ReportContactRequest,
        key: RequestKey,
        actor: &str,
        names: FieldNames,
        deadline: Instant,
    ) -> Result<v1::ReportContactResponse, Error> {
        let v1::ReportContactRequest { session_id, result, expected_revision, request_id: _, propose, robot } =
            request;
        let result = result.ok_or_else(|| Error::field("result", "is missing"))?;
        let wanted = from_proto::exploration_request(
            names.propose,
            propose,
            names.robot,
            robot.as_ref(),
            &self.limits,
        )?;
        let event = event::encode(Kind::ContactResult(result.clone()));
        let outcome = result.outcome.clone();
        let limits = self.limits.clone();
        let compute = move |before: &Snapshot| {
            let at_us = before.next_event_us();
            let computed = absorb_result(before, &result, &wanted, at_us, &limits)?;
            Ok(Decision::Append(event.clone(), computed))
        };
        let (actor, work, compute) = (actor.to_owned(), Work::Contact, Arc::new(compute));
        let change = Change { session_id, request: key, expected_revision, actor, work, compute };
        let reply = self.sessions.change(change, deadline).await?;
        let first: v1::ReportContactResponse = stored(&reply.bytes)?;
        if let Some(outcome) = outcome.filter(|_| !reply.duplicate) {
            self.metrics().contact(&outcome, &first.warning_details);
        }
        Ok(v1::ReportContactResponse { duplicate: reply.duplicate, ..first })
    }
}

/// The session after a view that was accepted at `at_us`, with the reply.
pub(super) fn absorb_prior(
    before: &Snapshot,
    prior: &v1::VisualPrior,
    path: &str,
    wanted: &Question,
    at_us: i64,
) -> Result<Computed<Snapshot>, Error> {
    let from_proto::Prior { evidence, finite, non_finite, repeated, flying, voxel_m, mut warnings } =
        from_proto::sent_prior(path, prior)?;
    let added = before.add_view(&evidence, prior.keep_clutter, at_us);
    let (after, AddedView { update, accepted, edge_m, clutter }) =
        added.map_err(|error| refused(path, error))?;
    let plausible = &before.definition.plausible_size;
    warnings.extend(from_proto::check_size(path, &clutter.kept, plausible)?);
    warnings.extend(clutter.warnings());
    warnings.extend(update.warnings);
    let count = |points: usize| u32::try_from(points).unwrap_or(u32::MAX);
    let reply = v1::AddVisualPriorResponse {
        session: Some(to_proto::session(&after)),
        accepted_points: count(accepted),
        dropped_points: count(finite.saturating_sub(clutter.count() + accepted)),
        candidates: next_candidates(&after, wanted),
        warnings: to_proto::warning_texts(&warnings),
        warning_details: to_proto::warnings(&warnings),
        set_aside: Some(v1::SetAside {
            repeated_points: count(repeated),
            support_points: count(clutter.support),
            isolated_points: count(clutter.isolated),
            flying_points: count(flying + clutter.flying),
            points_f32_le: to_proto::points_f32(&clutter.shown),
            support: clutter.plane.as_ref().map(to_proto::half_space),
        }),
        should_stop: to_proto::stop_reason(after.should_stop).into(),
        // The caller's own voxels count where they are the larger ones.
        voxel_m: edge_m.unwrap_or(0.0).max(voxel_m.unwrap_or(0.0)),
        non_finite_points: count(non_finite),
        shadow_choices: to_proto::shadow_choices(&after),
    };
    Ok(computed(after, &reply))
}

/// The session after a result that was accepted at `at_us`, with the reply.
pub(super) fn absorb_result(
    before: &Snapshot,
    result: &v1::ContactResult,
    wanted: &Question,
    at_us: i64,
    limits: &Limits,
) -> Result<Computed<Snapshot>, Error> {
    if before.stats.attempts >= limits.contacts {
        return Err(Error::SessionFull { limit: limits.contacts });
    }
    let from_proto::Reported { evidence, mut warnings } =
        from_proto::sent_report(result, &before.definition, before.revision, limits)?;
    let absorbed = before.absorb(evidence, &result.candidate_id, at_us);
    let (after, update) = absorbed.map_err(|error| refused("result", error))?;
    warnings.extend(update.warnings);
    let (touched, how_touched) = after.reconstruction.latest_touches();
    let reply = v1::ReportContactResponse {
        session: Some(to_proto::session(&after)),
        seq: after.revision,
        duplicate: false,
        contact_uncertainty: update.contact_uncertainty.unwrap_or(0.0),
        max_vertex_move_m: update.max_vertex_move_m,
        candidates: next_candidates(&after, wanted),
        warnings: to_proto::warning_texts(&warnings),
        warning_details: to_proto::warnings(&warnings),
        touched_points: touched.iter().map(to_proto::point).collect(),
        touched_point: to_proto::touched_point(how_touched, touched.is_empty()).into(),
        should_stop: to_proto::stop_reason(after.should_stop).into(),
        shadow_choices: to_proto::shadow_choices(&after),
    };
    Ok(computed(after, &reply))
}

fn next_candidates(after: &Snapshot, wanted: &Question) -> Vec<v1::Candidate> {
    if wanted.request.top_k() == 0 {
        return Vec::new();
    }
    to_proto::candidates(after, &after.propose(wanted, after.updated_us).candidates)
}

/// Refuses vertices that the newest surface does not have.
pub(super) fn check_explained(snapshot: &Snapshot, question: &Question, field: &str) -> Result<(), Error> {
    let vertices = snapshot.reconstruction.surface().map_or(0, |surface| surface.mesh.vertices.len());
    let asked = question.request.asked();
    match asked.iter().enumerate().find(|(_, vertex)| **vertex as usize >= vertices) {
        None => Ok(()),
        Some((index, vertex)) => Err(Error::field(
            format!("{field}[{index}]"),
            format!("{vertex} is no vertex of revision {}, which has {vertices}, from 0", snapshot.revision),
        )),
    }
}

/// The reply to a question, for a session as it is after the proposal.
pub(super) fn answer(
    snapshot: &Snapshot,
    question: &Question,
    proposal: &Proposal,
) -> v1::ProposeContactsResponse {
    let mut should_stop = to_proto::stop_reason(snapshot.should_stop);
    if proposal.candidates.is_empty() && proposal.excluded.leased == 0 && snapshot.should_stop.is_none() {
        // The session would go on, but not within what this robot must keep away from. What others have
        // to themselves is free again soon.
        should_stop = v1::StopReason::NoAdmissibleCandidate;
    }
    let warnings = below_object(snapshot, question, &proposal.candidates);
    v1::ProposeContactsResponse {
        revision: snapshot.revision,
        candidates: to_proto::candidates(snapshot, &proposal.candidates),
        excluded: Some(to_proto::excluded(&proposal.excluded)),
        explained: proposal.explained.iter().map(to_proto::explained).collect(),
        should_stop: should_stop.into(),
        warnings: to_proto::warning_texts(&warnings),
        warning_details: to_proto::warnings(&warnings),
    }
}

/// Warns of an approach that begins below all of the object where nothing says what it stands on.
/// Heights are along z, up in nearly every robot's base frame.
fn below_object(
    snapshot: &Snapshot,
    question: &Question,
    candidates: &[exploration::Candidate],
) -> Vec<Warning> {
    if question.request.keeps_out() || snapshot.keeps_out() {
        return Vec::new();
    }
    let lowest_m = snapshot.reconstruction.surface().map_or(f64::NEG_INFINITY, |surface| {
        surface.mesh.vertices.iter().map(|vertex| vertex.z).fold(f64::INFINITY, f64::min)
    });
    let lowest_start_m = candidates.iter().map(|c| c.probe_start.z).fold(f64::INFINITY, f64::min);
    if lowest_start_m >= lowest_m {
        return Vec::new();
    }
    let message = format!(
        "an approach begins at z = {lowest_start_m:.3} m, below the object, and no table was declared: if the \
         object stands on one at height h, create the session with \
         config.support {{normal: {{z: 1}}, offset_m: h}}"
    );
    vec![Warning::new(WarningKind::NoTable, message).with("start_z_m", lowest_start_m)]
}

fn refused(path: &str, error: palpate_core::error::Error) -> Error {
    match error {
        palpate_core::error::Error::NoVisualPrior => Error::NoVisualPrior,
        palpate_core::error::Error::Field(violation) => Error::Fields(vec![FieldViolation {
            field: format!("{path}.{}", violation.field),
            description: violation.reason,
            non_finite: violation.non_finite,
        }]),
    }
}
