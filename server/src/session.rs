//! What a session is: its definition, fixed at creation, and a snapshot of its state per revision.
//!
//! ```text
//! created --> AwaitingPrior --first visual prior--> Active
//!    forked -->     |                                  |
//!                   |------------ finished ------------+--> Finished
//!                   `--- a log that cannot be replayed +--> Quarantined
//! ```

mod clutter;
mod leases;
mod shown;
mod views;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use palpate_core::config::{Config, Strategy};
use palpate_core::evidence::{Evidence, Pad as TouchingPad};
use palpate_core::exploration::{Candidate, KeepOut, MountedPad, Proposal, ProposalRequest};
use palpate_core::geometry::Pose;
use palpate_core::reconstruction::{self, Findings, Reconstruction, Stats, StopReason, Update, WarmStart};

use sha2::{Digest, Sha256};

use crate::error::Error;
use crate::sessions::Aggregate;
use crate::store::Event;

pub(crate) use leases::{Lease, Leases};
pub(crate) use shown::{Doubted, Shown};
pub(crate) use views::AddedView;

/// Half the side of the pad that is assumed where none is declared, in metres.
pub(crate) const DEFAULT_PAD_HALF_SIDE_M: f64 = 0.009;

/// What a session is created with.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Definition {
    pub(crate) session_id: String,
    pub(crate) display_name: String,
    pub(crate) experiment: String,
    /// The frame of every pose and point.
    pub(crate) frame_id: String,
    pub(crate) labels: BTreeMap<String, String>,
    pub(crate) config: Config,
    /// The probe's declared pads.
    pub(crate) sensors: Vec<Sensor>,
    /// Regions that no approach may enter.
    pub(crate) keep_out: Vec<KeepOut>,
    /// Which sizes of a view are plausible.
    pub(crate) plausible_size: PlausibleSize,
    /// Strategies that are asked beside the session's own, and not followed.
    pub(crate) shadow: Vec<Strategy>,
    /// The sessions that this one was forked from, the nearest first.
    pub(crate) ancestors: Vec<Ancestor>,
    /// Microseconds since 1970, UTC.
    pub(crate) created_us: i64,
}

/// A session that another one was forked from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Ancestor {
    pub(crate) session_id: String,
    /// The last of its events that the fork has.
    pub(crate) revision: i64,
}

/// Which lengths of a view are plausible, in metres, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlausibleSize {
    /// A shorter one is warned about.
    pub(crate) min_m: f64,
    /// A longer one is warned about.
    pub(crate) max_m: f64,
    /// A longer one is refused.
    pub(crate) refuse_above_m: f64,
}

impl Default for PlausibleSize {
    fn default() -> Self {
        Self { min_m: 0.005, max_m: 1.0, refuse_above_m: 100.0 }
    }
}

/// One square contact pad of the probe.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sensor {
    pub(crate) id: String,
    /// The sensor's frame has its origin at the centre of the pad's face and z out of the pad.
    pub(crate) tool_from_sensor: Pose,
    /// Normal force at which an approach should stop, in newtons.
    pub(crate) contact_force_n: Option<f64>,
    /// The pad as the method sees it: its size, its noise and the point that touches.
    pub(crate) pad: TouchingPad,
}

/// What a robot asks of a session.
#[derive(Clone, Debug)]
pub(crate) struct Question {
    pub(crate) request: ProposalRequest,
    /// Who asks; empty is nobody in particular.
    pub(crate) robot_id: String,
}

impl Question {
    /// Asks for nothing.
    pub(crate) fn none() -> Self {
        Self { request: ProposalRequest::best(0), robot_id: String::new() }
    }
}

impl Definition {
    /// Where no approach of this session may go, whoever asks.
    fn forbidden(&self) -> Vec<KeepOut> {
        let support = self
            .config
            .support
            .and_then(|plane| KeepOut::half_space(plane.normal().into_inner(), plane.offset_m()).ok());
        self.keep_out.iter().copied().chain(support).collect()
    }

    /// A tag that tells its candidates from those of other sessions.
    pub(crate) fn tag(&self) -> u32 {
        tag(&self.session_id)
    }

    /// Whether candidates with this tag that were proposed at `revision` aim at this session's object: its own do, and
    /// those that its ancestors proposed before it was forked.
    pub(crate) fn knows(&self, candidate_tag: u32, revision: i64) -> bool {
        let is_of =
            |ancestor: &Ancestor| tag(&ancestor.session_id) == candidate_tag && revision <= ancestor.revision;
        candidate_tag == self.tag() || self.ancestors.iter().any(is_of)
    }

    /// The pads to choose from, in the order of their declaration.
    fn pads(&self) -> Vec<MountedPad> {
        let assumed = MountedPad { tool_from_sensor: Pose::identity(), half_side_m: DEFAULT_PAD_HALF_SIDE_M };
        if self.sensors.is_empty() {
            return vec![assumed];
        }
        let pad = |sensor: &Sensor| MountedPad {
            tool_from_sensor: sensor.tool_from_sensor,
            half_side_m: sensor.pad.half_side_m(),
        };
        self.sensors.iter().map(pad).collect()
    }

    /// The pad that a contact names: the only one where it names none.
    pub(crate) fn sensor(&self, id: &str) -> Option<Sensor> {
        match self.sensors.as_slice() {
            [] if id.is_empty() => Some(Sensor {
                id: String::new(),
                tool_from_sensor: Pose::identity(),
                contact_force_n: None,
                pad: TouchingPad::default(),
            }),
            [only] if id.is_empty() => Some(only.clone()),
            sensors => sensors.iter().find(|sensor| sensor.id == id).cloned(),
        }
    }
}

fn tag(session_id: &str) -> u32 {
    let digest = Sha256::digest(session_id);
    u32::from_be_bytes([digest[0], digest[1], digest[2], digest[3]])
}

/// Which calls a session takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SessionState {
    /// Nothing was seen yet.
    AwaitingPrior,
    /// There is an estimate; contacts are taken.
    Active,
    /// Closed by the caller: it is read only.
    Finished,
    /// The log is damaged: the state is that of the last event before the damage.
    Quarantined,
}

/// Why a session is quarantined.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SetAside {
    pub(crate) reason: String,
    /// Where its log should end.
    pub(crate) head: i64,
}

/// A session after one of its events; shared by readers, never changed.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot {
    pub(crate) definition: Arc<Definition>,
    /// The seq of the last event.
    pub(crate) revision: i64,
    pub(crate) state: SessionState,
    /// Why the log after this revision is not trusted, if so.
    pub(crate) set_aside: Option<SetAside>,
    /// All evidence as it is in the estimate, each with the seq of its event.
    pub(crate) evidence: Vec<(i64, Arc<Evidence>)>,
    /// The edge of the voxels in which all views are thinned, in metres, once that was needed.
    pub(crate) view_edge_m: Option<f64>,
    /// Places that are promised to a robot; those that expired since are among them.
    pub(crate) leases: Leases,
    /// The events that were retracted, by their seq, in the order of their retraction.
    pub(crate) retracted: Vec<i64>,
    /// The remark that the session was finished with.
    pub(crate) finish_note: String,
    pub(crate) reconstruction: Reconstruction,
    pub(crate) stats: Stats,
    /// What the session found out about its evidence.
    pub(crate) findings: Findings,
    pub(crate) should_stop: Option<StopReason>,
    pub(crate) digest: [u8; 32],
    /// When the last event was accepted, in microseconds since 1970, UTC.
    pub(crate) updated_us: i64,
    /// What the last event cost to compute.
    pub(crate) last_update: Duration,
}

impl Snapshot {
    /// A session after its creation, which is event 1.
    pub(crate) fn created(definition: Arc<Definition>) -> Self {
        let reconstruction = Reconstruction::new(definition.config.clone());
        Self {
            revision: 1,
            state: SessionState::AwaitingPrior,
            set_aside: None,
            evidence: Vec::new(),
            view_edge_m: None,
            leases: Leases::default(),
            retracted: Vec::new(),
            finish_note: String::new(),
            stats: reconstruction.stats(),
            findings: Findings::default(),
            should_stop: None,
            digest: reconstruction.digest(),
            updated_us: definition.created_us,
            last_update: Duration::ZERO,
            reconstruction,
            definition,
        }
    }

    /// The session after one more attempt, of a candidate where its id is not empty, accepted at
    /// `at_us`. Costs milliseconds.
    ///
    /// # Errors
    /// Nothing was seen yet.
    pub(crate) fn absorb(
        &self,
        evidence: Evidence,
        candidate_id: &str,
        at_us: i64,
    ) -> Result<(Self, Update), palpate_core::error::Error> {
        let started = Instant::now();
        let new = Arc::new(evidence);
        let (reconstruction, update) = self.reconstruction.absorb(&new)?;
        let evidence = self.evidence.iter().cloned().chain([(self.revision + 1, new)]).collect();
        let next = self.next(reconstruction, evidence, at_us, started);
        let leases = next.leases.clone().without(candidate_id);
        Ok((Self { leases, ..next }, update))
    }

    /// The next revision, with this estimate.
    fn next(
        &self,
        reconstruction: Reconstruction,
        evidence: Vec<(i64, Arc<Evidence>)>,
        at_us: i64,
        started: Instant,
    ) -> Self {
        let next = Self {
            revision: self.revision + 1,
            state: SessionState::Active,
            set_aside: None,
            evidence,
            leases: self.leases.at(at_us),
            updated_us: at_us,
            last_update: started.elapsed(),
            reconstruction,
            ..self.clone()
        };
        if next.reconstruction.is_deferring() { next } else { next.summed_up() }
    }

    /// The same state with what follows from its estimate.
    fn summed_up(self) -> Self {
        Self {
            stats: self.reconstruction.stats(),
            findings: self.reconstruction.findings(),
            should_stop: self.reconstruction.stop_reason(),
            digest: self.reconstruction.digest(),
            ..self
        }
    }

    /// The session after an event that leaves the estimate as it is, accepted at `at_us`.
    pub(crate) fn noted(&self, at_us: i64) -> Self {
        Self {
            revision: self.revision + 1,
            updated_us: at_us,
            leases: self.leases.at(at_us),
            last_update: Duration::ZERO,
            ..self.clone()
        }
    }

    /// The session after it was closed.
    pub(crate) fn finished(&self, note: String, at_us: i64) -> Self {
        Self { state: SessionState::Finished, finish_note: note, ..self.noted(at_us) }
    }

    /// The session after what people call it was changed; `None` leaves a part as it is.
    pub(crate) fn renamed(
        &self,
        display_name: Option<String>,
        labels: Option<BTreeMap<String, String>>,
        at_us: i64,
    ) -> Self {
        let mut definition = (*self.definition).clone();
        definition.display_name = display_name.unwrap_or(definition.display_name);
        definition.labels = labels.unwrap_or(definition.labels);
        Self { definition: Arc::new(definition), ..self.noted(at_us) }
    }

    /// The session after the event `seq` was retracted, which its evidence does not have any more.
    pub(crate) fn retracted(&self, seq: i64, at_us: i64) -> Self {
        let mut after = self.noted(at_us);
        after.retracted.push(seq);
        after
    }

    /// Whether the event `seq` can be retracted: it is evidence that counts.
    pub(crate) fn is_evidence(&self, seq: i64) -> bool {
        self.evidence.iter().any(|(known, _)| *known == seq)
    }

    /// Where to touch next with the session's pads, away from what it must keep out of and from what is
    /// promised to others at `now_us`.
    pub(crate) fn propose(&self, question: &Question, now_us: i64) -> Proposal {
        self.reconstruction.propose(&self.within_bounds(question, now_us))
    }

    /// Where a strategy would touch next, the session's own or another one; nothing where it finds nothing.
    pub(crate) fn choice_of(&self, strategy: Strategy) -> Option<Candidate> {
        let question = Question { request: ProposalRequest::best(1), robot_id: String::new() };
        let request = self.within_bounds(&question, self.updated_us);
        // The definition has only strategies that its method takes.
        let proposal = self.reconstruction.propose_by(strategy, &request).ok()?;
        proposal.candidates.into_iter().next()
    }

    fn within_bounds(&self, question: &Question, now_us: i64) -> ProposalRequest {
        let Question { request, robot_id } = question;
        request
            .clone()
            .keeping_out_of(self.definition.forbidden())
            .for_pads(self.definition.pads())
            .leaving(self.leases.at(now_us).of_others(robot_id))
    }

    /// The seqs of all views and results, those that were retracted included, in their order.
    pub(crate) fn evidence_seqs(&self) -> Vec<i64> {
        let counting = self.evidence.iter().map(|(seq, _)| *seq);
        let mut seqs: Vec<i64> = counting.chain(self.retracted.iter().copied()).collect();
        seqs.sort_unstable();
        seqs
    }

    /// Refuses a session that is quarantined.
    ///
    /// # Errors
    /// Why it is.
    pub(crate) fn check_sound(&self) -> Result<(), Error> {
        if self.state == SessionState::Quarantined { self.check_open() } else { Ok(()) }
    }

    /// The seq of the event of a piece of evidence by its number.
    pub(crate) fn seq_of(&self, evidence: usize) -> i64 {
        self.evidence.get(evidence).map_or(self.revision, |(seq, _)| *seq)
    }

    /// The touches that contradict what else is known.
    fn doubted(&self) -> impl Iterator<Item = Doubted> {
        self.findings.doubted.iter().map(|found| Doubted {
            seq: self.seq_of(found.at),
            point: found.point.coords.into(),
            doubt: found.doubt,
        })
    }

    /// Whether the session says where no approach may go.
    pub(crate) fn keeps_out(&self) -> bool {
        !self.definition.keep_out.is_empty() || self.definition.config.support.is_some()
    }

    /// Changes with every event, and differs from that of an earlier session of the same id.
    pub(crate) fn etag(&self) -> String {
        etag(self.definition.created_us, self.set_aside.as_ref().map_or(self.revision, |aside| aside.head))
    }

    /// When an event that is accepted now happens: the clock, but never before the last event.
    pub(crate) fn next_event_us(&self) -> i64 {
        now_us().max(self.updated_us)
    }
}

impl Aggregate for Snapshot {
    fn algorithm_version() -> &'static str {
        reconstruction::version()
    }

    fn identity(&self) -> (&str, i64) {
        (&self.definition.session_id, self.definition.created_us)
    }

    fn revision(&self) -> i64 {
        self.revision
    }

    fn bytes(&self) -> usize {
        self.reconstruction.bytes()
    }

    fn state_hash(&self) -> String {
        hex(&self.digest)
    }

    fn check_open(&self) -> Result<(), Error> {
        match self.state {
            SessionState::AwaitingPrior | SessionState::Active => Ok(()),
            SessionState::Finished => {
                Err(Error::SessionFinished { session_id: self.definition.session_id.clone() })
            }
            SessionState::Quarantined => {
                let reason = self.set_aside.as_ref().map(|aside| aside.reason.clone()).unwrap_or_default();
                let session_id = self.definition.session_id.clone();
                Err(Error::SessionQuarantined { session_id, sound: self.revision, reason })
            }
        }
    }

    fn without_event(&self, row: &Event) -> Self {
        self.noted(row.append_us)
    }

    fn deferring(&self) -> Self {
        Self { reconstruction: self.reconstruction.clone().deferring(), ..self.clone() }
    }

    fn checkpoint(&self) -> Option<Vec<u8>> {
        postcard::to_stdvec(self.reconstruction.warm_start()?).ok()
    }

    fn shares_checkpoint_with(&self, before: &Self) -> bool {
        self.reconstruction.shares_estimate_with(&before.reconstruction)
    }

    fn restored(&self, checkpoint: &[u8]) -> Option<Self> {
        let start: WarmStart = postcard::from_bytes(checkpoint).ok()?;
        let reconstruction = self.reconstruction.clone().estimated_from(start);
        Some(Self { reconstruction, ..self.clone() }.summed_up())
    }

    fn shown(&self) -> Option<Vec<u8>> {
        Shown::of(self)?.packed()
    }

    fn quarantined(&self, reason: &str, head: i64) -> Self {
        let set_aside = Some(SetAside { reason: reason.to_owned(), head });
        Self { state: SessionState::Quarantined, set_aside, ..self.clone() }
    }
}

/// The etag of a session created at `created_us`, at `revision`.
pub(crate) fn etag(created_us: i64, revision: i64) -> String {
    format!("{revision}-{created_us:x}")
}

/// Lower-case hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The server's clock, in microseconds since 1970, UTC.
pub(crate) fn now_us() -> i64 {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since_1970.as_micros()).unwrap_or(i64::MAX)
}
