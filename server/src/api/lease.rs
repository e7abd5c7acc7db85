//! Candidates that a robot has to itself for a while.
//!
//! A lease is an event: it survives a restart, a watcher sees it, and a retry gets the first reply.
//! Where nothing is found there is nothing to promise, and the question changes nothing.

use std::sync::Arc;
use std::time::Duration;

use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use prost::Message;
use tokio::time::Instant;

use super::exploration::{answer, check_explained};
use super::{Api, appended, stored};
use crate::compute::Work;
use crate::error::Error;
use crate::limits::Limits;
use crate::session::{Question, Snapshot};
use crate::sessions::{Change, Decision, RequestKey};
use crate::wire::{event, from_proto, to_proto};

/// What is asked for, and for how long.
pub(super) struct Wish {
    pub(super) question: Question,
    pub(super) duration: Duration,
    /// Where the caller wrote the vertices that are asked about.
    pub(super) explain_field: &'static str,
}

impl Api {
    pub(super) async fn lease(
        &self,
        session_id: String,
        wish: Wish,
        request: RequestKey,
        actor: &str,
        deadline: Instant,
    ) -> Result<v1::ProposeContactsResponse, Error> {
        let limits = self.limits.clone();
        let compute = move |before: &Snapshot| promise(before, &wish, &limits);
        let change = Change {
            session_id,
            request,
            expected_revision: None,
            actor: actor.to_owned(),
            work: Work::Proposal,
            compute: Arc::new(compute),
        };
        stored(&self.sessions.change(change, deadline).await?.bytes)
    }
}

/// The candidates, and the event that promises them.
fn promise(
    before: &Snapshot,
    Wish { question, duration, explain_field }: &Wish,
    limits: &Limits,
) -> Result<Decision<Snapshot>, Error> {
    if before.reconstruction.last_estimate().is_none() {
        return Err(Error::NoVisualPrior);
    }
    check_explained(before, question, explain_field)?;
    let at_us = before.next_event_us();
    let proposal = before.propose(question, at_us);
    if proposal.candidates.is_empty() {
        return Ok(Decision::Answer(answer(before, question, &proposal).encode_to_vec()));
    }
    let expire_us = at_us.saturating_add(i64::try_from(duration.as_micros()).unwrap_or(i64::MAX));
    // The ids are of the revision that this event makes, as the caller goes on from there.
    let mut reply = answer(&before.lease(Vec::new(), at_us), question, &proposal);
    for candidate in &mut reply.candidates {
        candidate.lease_expire_time = Some(to_proto::timestamp(expire_us));
    }
    let lease = v1::Lease {
        robot_id: question.robot_id.clone(),
        candidate_ids: reply.candidates.iter().map(|candidate| candidate.candidate_id.clone()).collect(),
        expire_time: Some(to_proto::timestamp(expire_us)),
    };
    let after = before.lease(from_proto::leases(&lease)?, at_us);
    if after.leases.len() > limits.leased_places {
        return Err(Error::Quota {
            what: "leased places",
            limit: limits.leased_places as u64,
            hint: "report what became of leased candidates, or wait until the leases expire",
        });
    }
    Ok(appended(event::encode(Kind::Lease(lease)), after, &reply))
}
