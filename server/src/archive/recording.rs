//! A session as an MCAP recording: at the time of each event, what a viewer draws and what a program reads.
//!
//! Drawn by viewers: `/surface`, `/points`, `/next`, `/log`. In the contract's own messages, each explained by the
//! descriptors in the file: `/result`, `/wrench`, `/candidate`, `/stats`.

use std::collections::BTreeMap;
use std::sync::Arc;

use foxglove::messages::{Log, PointCloud, PoseInFrame, SceneUpdate, log};
use foxglove::{Channel, Context, McapWriteOptions, McapWriterHandle, PartialMetadata, RawChannel, Schema};
use palpate_core::reconstruction::Surface;
use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use prost::{Message, Name};

use super::descriptors::descriptors;
use super::scene::{self, Touched};
use super::sink::Sink;
use super::table::first_contact;
use super::unwritten;
use crate::error::Error;
use crate::session::{Definition, SessionState, Snapshot};
use crate::store::Event;
use crate::wire::{event, to_proto};

/// Bytes that are collected before they are written together.
const CHUNK_BYTES: u64 = 256 << 10;

/// A recording that grows by the events of a log.
pub(crate) struct Recording {
    sink: Sink,
    file: McapWriterHandle<Sink>,
    surfaces: Channel<SceneUpdate>,
    points: Channel<PointCloud>,
    next: Channel<PoseInFrame>,
    log: Channel<Log>,
    results: Arc<RawChannel>,
    wrenches: Arc<RawChannel>,
    candidates: Arc<RawChannel>,
    stats: Arc<RawChannel>,
    /// Where each attempt so far touched.
    touched: BTreeMap<i64, Touched>,
    /// The surface that was written last.
    shown: Option<Arc<Snapshot>>,
    /// Keeps the channels together with their file.
    _context: Arc<Context>,
}

impl Recording {
    /// A recording of this session.
    ///
    /// # Errors
    /// None but by a bug of this server.
    pub(crate) fn new(definition: &Definition) -> Result<Self, Error> {
        let sink = Sink::default();
        let context = Context::new();
        let options =
            McapWriteOptions::new().compression(None).chunk_size(Some(CHUNK_BYTES)).disable_seeking(true);
        let file = context.mcap_writer_with_options(options).create(sink.clone()).map_err(unwritten)?;
        file.write_metadata("palpate", metadata(definition)).map_err(unwritten)?;
        let channel = |topic: &str| context.channel_builder(topic);
        Ok(Self {
            surfaces: channel("/surface").build(),
            points: channel("/points").build(),
            next: channel("/next").build(),
            log: channel("/log").build(),
            results: own::<v1::ContactResult>(&context, "/result")?,
            wrenches: own::<v1::Wrench>(&context, "/wrench")?,
            candidates: own::<v1::Candidate>(&context, "/candidate")?,
            stats: own::<v1::SessionStats>(&context, "/stats")?,
            touched: BTreeMap::new(),
            shown: None,
            sink,
            file,
            _context: context,
        })
    }

    /// The next event of the log, with the session after it.
    ///
    /// # Errors
    /// The event cannot be read.
    pub(crate) fn add_event(&mut self, row: &Event, state: &Arc<Snapshot>) -> Result<(), Error> {
        let unreadable = |error: prost::DecodeError| Error::internal(format!("event {}: {error}", row.seq));
        let at = at(row.append_us);
        let stats = v1::SessionStats::decode(row.stats_after.as_slice()).map_err(unreadable)?;
        log_own(&self.stats, &stats, at);
        let kind = event::kind(row.seq, &row.payload).map_err(|error| Error::internal(error.to_string()))?;
        if let Kind::ContactResult(result) = &kind {
            log_own(&self.results, result, at);
            if let Some(wrench) = first_contact(result).and_then(|contact| contact.wrench) {
                log_own(&self.wrenches, &wrench, at);
            }
            let reply = v1::ReportContactResponse::decode(row.reply.as_slice()).map_err(unreadable)?;
            let touched = Touched { points: reply.touched_points, uncertainty: reply.contact_uncertainty };
            self.touched.insert(row.seq, touched);
        }
        for (level, message) in remarks(row, &kind).map_err(unreadable)? {
            self.say(row, level, message);
        }
        self.draw(row, state);
        Ok(())
    }

    /// The surface and the points where they changed, and the next candidate.
    fn draw(&mut self, row: &Event, state: &Arc<Snapshot>) {
        let Some(surface) = state.reconstruction.surface() else {
            self.shown = None;
            return;
        };
        let is_shown = |shown: &Arc<Snapshot>| shown.reconstruction.has_surface_of(&state.reconstruction);
        if self.shown.as_ref().is_some_and(is_shown) {
            return;
        }
        self.shown = Some(state.clone());
        self.draw_surface(&surface, row, state);
        self.points.log_with_meta(&scene::cloud(state, &self.touched), at(row.append_us));
        if state.state != SessionState::Active {
            return;
        }
        let choice = state.choice_of(state.definition.config.strategy);
        let candidates = choice.map(|choice| to_proto::candidates(state, &[choice])).unwrap_or_default();
        if let Some(candidate) = candidates.first() {
            log_own(&self.candidates, candidate, at(row.append_us));
            let pose = scene::next_pose(candidate, &state.definition.frame_id, row.append_us);
            self.next.log_with_meta(&pose, at(row.append_us));
        }
    }

    fn draw_surface(&self, surface: &Surface, row: &Event, state: &Snapshot) {
        let scene = scene::scene(surface, &state.definition.frame_id, row.append_us);
        self.surfaces.log_with_meta(&scene, at(row.append_us));
    }

    fn say(&self, row: &Event, level: log::Level, message: String) {
        let line = Log {
            timestamp: Some(scene::timestamp(row.append_us)),
            level: level.into(),
            message,
            name: format!("event {}", row.seq),
            file: String::new(),
            line: 0,
        };
        self.log.log_with_meta(&line, at(row.append_us));
    }

    /// What was written since the last time.
    pub(crate) fn take(&mut self) -> Vec<u8> {
        self.sink.take()
    }

    /// The end of the file.
    ///
    /// # Errors
    /// None but by a bug of this server.
    pub(crate) fn finish(self) -> Result<Vec<u8>, Error> {
        self.file.close().map_err(unwritten)?;
        Ok(self.sink.take())
    }
}

fn metadata(definition: &Definition) -> BTreeMap<String, String> {
    let Definition { session_id, frame_id, .. } = definition;
    let server = env!("CARGO_PKG_VERSION");
    let pairs = [
        ("session_id", session_id.as_str()),
        ("frame_id", frame_id),
        ("unit", "m"),
        ("server_version", server),
    ];
    pairs.into_iter().map(|(name, value)| (name.to_owned(), value.to_owned())).collect()
}

/// A channel for a message of the contract.
fn own<M: Name>(context: &Arc<Context>, topic: &str) -> Result<Arc<RawChannel>, Error> {
    let schema = Schema::new(M::full_name(), "protobuf", descriptors::<M>()?);
    context.channel_builder(topic).message_encoding("protobuf").schema(schema).build_raw().map_err(unwritten)
}

fn log_own<M: Message>(channel: &RawChannel, message: &M, at: PartialMetadata) {
    channel.log_with_meta(&message.encode_to_vec(), at);
}

/// When an event was appended, in nanoseconds.
fn at(append_us: i64) -> PartialMetadata {
    PartialMetadata { log_time: Some(u64::try_from(append_us).unwrap_or(0).saturating_mul(1000)) }
}

/// What people should read of an event.
fn remarks(row: &Event, kind: &Kind) -> Result<Vec<(log::Level, String)>, prost::DecodeError> {
    let reply = row.reply.as_slice();
    let warnings = match kind {
        Kind::VisualPrior(_) => v1::AddVisualPriorResponse::decode(reply)?.warnings,
        Kind::ContactResult(_) => v1::ReportContactResponse::decode(reply)?.warnings,
        _ => Vec::new(),
    };
    let mut remarks: Vec<_> = warnings.into_iter().map(|warning| (log::Level::Warning, warning)).collect();
    let said = match kind {
        Kind::RetractedSeq(seq) => {
            let reason = v1::Event::decode(row.payload.as_slice())?.retraction_reason;
            Some(format!("event {seq} is retracted: {reason}"))
        }
        Kind::Finished(note) => Some(format!("finished: {note}")),
        Kind::Updated(_) => Some("renamed".to_owned()),
        Kind::Created(_) => Some("created".to_owned()),
        Kind::Forked(_) => Some("forked".to_owned()),
        Kind::VisualPrior(_) => Some("a view was added".to_owned()),
        Kind::ContactResult(_) | Kind::Lease(_) => None,
    };
    remarks.extend(said.map(|said| (log::Level::Info, said)));
    Ok(remarks)
}
