//! The robot's loop: add a view, ask where to touch, report what came of it.

use std::sync::Arc;

use palpate_core::exploration::{self, ProposalRequest};
use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use tokio::time::Instant;

use super::{Api, Call, computed, request_key, stored};
use crate::error::{Error, FieldViolation};
use crate::limits::Limits;
use crate::session::{AddedView, Snapshot};
use crate::sessions::{Change, Computed, RequestKey};
use crate::wire::{event, from_proto, to_proto};

/// Where a caller wrote the parts of a request: the unary calls and the stream differ in that.
#[derive(Clone, Copy, Debug)]
pub(super) struct FieldNames {
    pub(super) prior: &'static str,
    pub(super) propose: &'static str,
    pub(super) robot: &'static str,
}

const UNARY: FieldNames = FieldNames { prior: "prior", propose: "propose", robot: "robot" };

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
            self.add_prior(request, None, key, &call.actor, UNARY, deadline).await
        })
        .await
    }

    /// Proposes where to touch next; changes nothing.
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
            self.propose(request, FieldNames { propose: "top_k", ..UNARY }, deadline).await
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
            self.report(request, key, &call.actor, UNARY, deadline).await
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
        let compute = move |before: &Snapshot| absorb_prior(before, &prior, names.prior, &wanted);
        let actor = actor.to_owned();
        let change =
            Change { session_id, request: key, expected_revision, actor, event, compute: Arc::new(compute) };
        stored(&self.sessions.change(change, deadline).await?.bytes)
    }

    pub(super) async fn propose(
        &self,
        request: v1::ProposeContactsRequest,
        names: FieldNames,
        deadline: Instant,
    ) -> Result<v1::ProposeContactsResponse, Error> {
        // A question changes nothing, so asking it again needs no protection.
        let v1::ProposeContactsRequest { session_id, top_k, robot, lease, request_id: _ } = request;
        if lease.is_some() {
            return Err(Error::unimplemented("lease"));
        }
        let top_k = top_k.max(1);
        let request =
            from_proto::exploration_request(names.propose, top_k, names.robot, robot.as_ref(), &self.limits)?;
        let snapshot = self.sessions.newest(&session_id, deadline).await?;
        if snapshot.reconstruction.last_estimate().is_none() {
            return Err(Error::NoVisualPrior);
        }
        self.sessions.pool.run(deadline, move || proposal(&snapshot, &request)).await
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
        let limits = self.limits.clone();
        let compute = move |before: &Snapshot| absorb_result(before, &result, &wanted, &limits);
        let actor = actor.to_owned();
        let change =
            Change { session_id, request: key, expected_revision, actor, event, compute: Arc::new(compute) };
        let reply = self.sessions.change(change, deadline).await?;
        let first: v1::ReportContactResponse = stored(&reply.bytes)?;
        Ok(v1::ReportContactResponse { duplicate: reply.duplicate, ..first })
    }
}

fn absorb_prior(
    before: &Snapshot,
    prior: &v1::VisualPrior,
    path: &str,
    wanted: &ProposalRequest,
) -> Result<Computed<Snapshot>, Error> {
    let from_proto::Prior { evidence, finite, non_finite, voxel_m } = from_proto::visual_prior(path, prior)?;
    let added = before.add_view(&evidence, before.next_event_us());
    let (after, AddedView { update, accepted, edge_m }) = added.map_err(|error| refused(path, error))?;
    let count = |points: usize| u32::try_from(points).unwrap_or(u32::MAX);
    let reply = v1::AddVisualPriorResponse {
        session: Some(to_proto::session(&after)),
        accepted_points: count(accepted),
        dropped_points: count(finite - accepted),
        candidates: next_candidates(&after, wanted),
        warnings: update.warnings,
        should_stop: to_proto::stop_reason(after.should_stop).into(),
        // The caller's own voxels count where they are the larger ones.
        voxel_m: edge_m.unwrap_or(0.0).max(voxel_m.unwrap_or(0.0)),
        non_finite_points: count(non_finite),
    };
    Ok(computed(after, &reply))
}

fn absorb_result(
    before: &Snapshot,
    result: &v1::ContactResult,
    wanted: &ProposalRequest,
    limits: &Limits,
) -> Result<Computed<Snapshot>, Error> {
    if before.stats.attempts >= limits.contacts {
        return Err(Error::SessionFull { limit: limits.contacts });
    }
    let attempt = from_proto::attempt(result, &before.definition, before.revision, limits)?;
    let absorbed = before.absorb(attempt, before.next_event_us());
    let (after, update) = absorbed.map_err(|error| refused("result", error))?;
    let reply = v1::ReportContactResponse {
        session: Some(to_proto::session(&after)),
        seq: after.revision,
        duplicate: false,
        contact_uncertainty: update.contact_uncertainty.unwrap_or(0.0),
        max_vertex_move_m: update.max_vertex_move_m,
        candidates: next_candidates(&after, wanted),
        warnings: update.warnings,
        should_stop: to_proto::stop_reason(after.should_stop).into(),
    };
    Ok(computed(after, &reply))
}

fn next_candidates(after: &Snapshot, wanted: &ProposalRequest) -> Vec<v1::Candidate> {
    if wanted.top_k() == 0 {
        return Vec::new();
    }
    to_proto::candidates(after, &after.propose(wanted).candidates)
}

fn proposal(snapshot: &Snapshot, request: &ProposalRequest) -> v1::ProposeContactsResponse {
    let proposal = snapshot.propose(request);
    let mut should_stop = to_proto::stop_reason(snapshot.should_stop);
    if proposal.candidates.is_empty() && snapshot.should_stop.is_none() {
        // The session would go on, but not within what this robot must keep away from.
        should_stop = v1::StopReason::NoAdmissibleCandidate;
    }
    v1::ProposeContactsResponse {
        revision: snapshot.revision,
        candidates: to_proto::candidates(snapshot, &proposal.candidates),
        excluded: Some(to_proto::excluded(&proposal.excluded)),
        should_stop: should_stop.into(),
        warnings: below_object(snapshot, request, &proposal.candidates),
    }
}

/// Warns of an approach that begins below all of the object where nothing says what it stands on.
/// Heights are along z, up in nearly every robot's base frame.
fn below_object(
    snapshot: &Snapshot,
    request: &ProposalRequest,
    candidates: &[exploration::Candidate],
) -> Vec<String> {
    if request.keeps_out() || !snapshot.definition.keep_out.is_empty() {
        return Vec::new();
    }
    let lowest_m = snapshot.reconstruction.surface().map_or(f64::NEG_INFINITY, |surface| {
        surface.mesh.vertices.iter().map(|vertex| vertex.z).fold(f64::INFINITY, f64::min)
    });
    let lowest_start_m = candidates.iter().map(|c| c.probe_start.z).fold(f64::INFINITY, f64::min);
    if lowest_start_m >= lowest_m {
        return Vec::new();
    }
    vec![format!(
        "an approach begins at z = {lowest_start_m:.3} m, below the object, and no table was declared: if the \
         object stands on one at height h, create the session with \
         config.keep_out [{{half_space: {{normal: {{z: 1}}, offset_m: h}}}}]"
    )]
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
