//! Forks: the same touches under another method, strategy or symmetry.
//!
//! Nothing is copied but what robots and cameras sent: each event is computed anew, under the same number and with the
//! time at which it happened, so that a fork with the same configuration has the same states and one with another says
//! what that would have made of the same evidence.

use std::sync::Arc;

use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use prost::Message;

use super::exploration::{absorb_prior, absorb_result};
use super::{Api, Call, computed, request_key, stored};
use crate::access::Caller;
use crate::compute::Queue;
use crate::error::Error;
use crate::limits::Limits;
use crate::session::{Definition, Question, SessionState, Snapshot};
use crate::sessions::{Carried, Computed, Copy, Created, Creation, Original, RequestKey};
use crate::store::Event;
use crate::wire::{event, from_proto, mask, to_proto};

impl Api {
    /// Makes a session of the events of another one, up to any revision, with another configuration if wanted.
    ///
    /// # Errors
    /// No such session or revision, the id is taken, or the configuration does not fit the events.
    pub(crate) async fn fork_session(
        &self,
        request: v1::ForkSessionRequest,
        call: Call,
    ) -> Result<v1::Session, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("ForkSession", &session_id, &call, async |deadline| {
            let key = request_key(&request.request_id, &request, &self.limits)?;
            if !request.new_session_id.is_empty() {
                from_proto::check_session_id(&request.new_session_id)
                    .map_err(|error| error.of_field("new_session_id"))?;
            }
            let parent = self.sessions.newest(&session_id, deadline).await?;
            let parent = match last_to_copy(&parent, request.revision)? {
                last if last == parent.revision => parent,
                last => {
                    let queue = Queue::READERS;
                    self.sessions.at_revision(&session_id, last, queue, deadline).await?
                }
            };
            let forked = forked(&parent.definition, parent.revision, &request)?;
            call.caller.check_experiment(experiment_of(&forked))?;
            // Checked before the copy begins, as nothing of it depends on the id.
            from_proto::fork(&forked, 0, &self.limits)?;
            let copy = Copy {
                creation: creation(request.new_session_id, forked, key, &call.caller, &self.limits),
                original: Original::Session(session_id.clone(), parent.revision),
                carry: Arc::new(carry(self.limits.clone())),
                reply: |copy| to_proto::session(copy).encode_to_vec(),
            };
            stored(&self.sessions.copy(copy).await?.bytes)
        })
        .await
    }
}

/// The experiment of a fork that begins so.
pub(super) fn experiment_of(forked: &v1::Forked) -> &str {
    forked.definition.as_ref().map_or("", |definition| definition.experiment.as_str())
}

/// The last event that a fork takes over: that a session was finished is no part of it.
fn last_to_copy(parent: &Snapshot, wanted: i64) -> Result<i64, Error> {
    let head = parent.revision;
    if !(0..=head).contains(&wanted) {
        let description = format!("{wanted} is not between 1 and the session's revision {head}");
        return Err(Error::field("revision", description));
    }
    let wanted = if wanted == 0 { head } else { wanted };
    Ok(if parent.state == SessionState::Finished { wanted.min(head - 1) } else { wanted })
}

/// The first event of a fork of this session at a revision.
pub(super) fn forked(
    known: &Definition,
    revision: i64,
    request: &v1::ForkSessionRequest,
) -> Result<v1::Forked, Error> {
    let v1::ForkSessionRequest { config, config_mask, display_name, experiment, labels, .. } = request;
    let or_known = |new: &String, known: &String| if new.is_empty() { known.clone() } else { new.clone() };
    let paths = config_mask.as_ref().map(|mask| mask.paths.as_slice()).unwrap_or_default();
    let config = mask::changed(&to_proto::session_config(known), config.as_ref(), paths)?;
    let mut all_labels = known.labels.clone();
    all_labels.extend(labels.clone());
    let nearest = v1::Ancestor { session_id: known.session_id.clone(), revision };
    let others = known.ancestors.iter().map(|ancestor| v1::Ancestor {
        session_id: ancestor.session_id.clone(),
        revision: ancestor.revision,
    });
    Ok(v1::Forked {
        definition: Some(v1::CreateSessionRequest {
            session_id: String::new(),
            display_name: or_known(display_name, &known.display_name),
            experiment: or_known(experiment, &known.experiment),
            frame_id: known.frame_id.clone(),
            labels: all_labels,
            config: Some(config),
            request_id: String::new(),
        }),
        ancestors: std::iter::once(nearest).chain(others).collect(),
    })
}

/// The creation of a fork that begins with `forked`.
pub(super) fn creation(
    session_id: String,
    forked: v1::Forked,
    request: RequestKey,
    caller: &Caller,
    limits: &Arc<Limits>,
) -> Creation<Snapshot> {
    let limits = limits.clone();
    let create = move |session_id: &str, now_us: i64| {
        let mut forked = forked.clone();
        let request = forked.definition.get_or_insert_default();
        request.session_id = session_id.to_owned();
        let definition = from_proto::fork(&forked, now_us, &limits)?;
        // The log keeps the defaults of today, so that those of tomorrow change nothing.
        forked.definition.get_or_insert_default().config = Some(to_proto::session_config(&definition));
        let (experiment, labels) = (definition.experiment.clone(), definition.labels.clone());
        let created = Snapshot::created(Arc::new(definition));
        let session = to_proto::session(&created);
        let event = event::encode(Kind::Forked(forked));
        Ok(Created { event, computed: computed(created, &session), experiment, labels })
    };
    let (actor, owner) = (caller.actor().to_owned(), caller.owner());
    Creation { session_id, request, actor, owner, create: Arc::new(create) }
}

/// What an event of the original comes to in the copy.
pub(super) fn carry(limits: Arc<Limits>) -> impl Fn(&Snapshot, &Event) -> Result<Carried<Snapshot>, Error> {
    move |before, row| {
        let kind = event::kind(row.seq, &row.payload).map_err(|error| Error::internal(error.to_string()))?;
        carried(before, row, kind, &limits).map_err(|error| {
            let description = format!("event {} cannot be taken over with it: {error}", row.seq);
            Error::field("config", description)
        })
    }
}

fn carried(before: &Snapshot, row: &Event, kind: Kind, limits: &Limits) -> Result<Carried<Snapshot>, Error> {
    let at_us = row.append_us;
    let computed = match &kind {
        Kind::VisualPrior(prior) => absorb_prior(before, prior, "prior", &Question::none(), at_us)?,
        Kind::ContactResult(result) => absorb_result(before, result, &Question::none(), at_us, limits)?,
        Kind::Lease(lease) => {
            let after = before.lease(from_proto::leases(lease)?, at_us);
            // The places were promised as they were.
            Computed { reply: row.reply.clone(), ..computed(after, &v1::ProposeContactsResponse::default()) }
        }
        Kind::RetractedSeq(seq) => {
            let after = before.retracted(*seq, at_us);
            let reply = to_proto::session(&after);
            return Ok(((event::RETRACTED, row.payload.clone()), computed(after, &reply)));
        }
        // The fork began with the names of its origin, and is open.
        Kind::Updated(_) | Kind::Finished(_) | Kind::Created(_) | Kind::Forked(_) => {
            let after = before.noted(at_us);
            let reply = to_proto::session(&after);
            return Ok((event::encode(Kind::Updated(v1::Updated::default())), computed(after, &reply)));
        }
    };
    Ok((event::encode(kind), computed))
}
