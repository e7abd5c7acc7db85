//! A session as a file, written while the log is read.
//!
//! What is being written is a few events large; a reader who takes nothing loses the stream, as any other does.

use std::sync::Arc;

use futures_util::future::try_join_all;
use palpate_proto::v1;
use palpate_proto::v1::mesh::Body;
use sha2::{Digest, Sha256};
use tokio::time::Instant;
use tracing::Instrument;

use super::mesh::Form;
use super::outbox::{self, Gone, Outbox};
use super::watch::try_again;
use super::{Api, Call, Replies};
use crate::archive::{BundleWriter, Recording, Table};
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::mesh_format::FileFormat;
use crate::session::{Snapshot, hex};
use crate::sessions::{Aggregate, Entered, FreshFold, Retractions};
use crate::store::{Event, first_link};
use crate::wire::json::to_json;
use crate::wire::to_proto;

/// Events that are written in one job.
const PAGE: i64 = 16;
/// The same where each brings a mesh.
const PAGE_OF_MESHES: i64 = 4;

/// Bytes of a file in one message.
const CHUNK_BYTES: usize = 256 << 10;

/// A session on its way out as a file.
#[derive(Debug)]
pub(crate) struct Export {
    pub(crate) file_name: String,
    pub(crate) content_type: &'static str,
    /// Names the bytes of the file: an export of the same revision by the same version has the same.
    pub(crate) etag: String,
    pub(crate) chunks: Replies<v1::Chunk>,
}

/// A name for the file of a session at a revision; files of one session sort by their revisions.
pub(crate) fn file_name(session_id: &str, revision: i64, extension: &str) -> String {
    format!("{session_id}-r{revision:04}.{extension}")
}

impl Api {
    /// Streams a session as a file.
    ///
    /// # Errors
    /// No such session, revision or format; later failures are the stream's last item.
    pub(crate) async fn export_session(
        &self,
        request: v1::ExportSessionRequest,
        call: Call,
    ) -> Result<Export, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("ExportSession", &session_id, &call, async |deadline| {
            let v1::ExportSessionRequest { session_id, revision, format } = request;
            let format = v1::ArchiveFormat::try_from(format)
                .map_err(|_| Error::field("format", format!("{format} is no format")))?;
            let mut place = self.places.take(call.peer, &self.limits)?;
            let state = self.sessions.at_revision(&session_id, revision, Queue::READERS, deadline).await?;
            place.enter(&session_id, &self.limits)?;
            let (chunks, stream) = outbox::stream(&self.limits);
            let (writer, extension, content_type) = Writer::new(format, &state)?;
            let etag = format!("{}-{extension}-{}", state.etag(), env!("CARGO_PKG_VERSION"));
            let export = Export {
                file_name: file_name(&session_id, state.revision, extension),
                content_type,
                etag: format!("r{}-{etag}", state.revision),
                chunks: stream,
            };
            let file = Outgoing { chunks, digest: Sha256::new(), waiting: Vec::new() };
            let run = Run { api: self.clone(), state, file };
            let run = async move {
                run.run(writer).await;
                drop(place);
            };
            tokio::spawn(run.in_current_span());
            Ok(export)
        })
        .await
    }
}

/// The writer of one format.
enum Writer {
    Bundle(Box<BundleWriter>, Table),
    Table(Table),
    Recording(Box<Recording>),
}

/// An event with what its writer needs beside it.
struct Step {
    row: Event,
    retracted_by: Option<i64>,
    /// The session after it, for recordings only.
    state: Option<Arc<Snapshot>>,
}

impl Writer {
    /// The writer with the extension and the media type of its files.
    fn new(format: v1::ArchiveFormat, state: &Snapshot) -> Result<(Self, &'static str, &'static str), Error> {
        Ok(match format {
            v1::ArchiveFormat::Unspecified | v1::ArchiveFormat::Bundle => {
                let mut session = to_proto::session(state);
                if let Some(stats) = &mut session.stats {
                    // It differs each time the same state is computed, and the file would too.
                    stats.last_update = None;
                }
                let json = to_json(&session)? + "\n";
                let bundle = BundleWriter::new(&session, &json, first_link(&session.session_id))?;
                (Self::Bundle(Box::new(bundle), Table::new()?), "palpate.tar", "application/x-tar")
            }
            v1::ArchiveFormat::Csv => (Self::Table(Table::new()?), "csv", "text/csv; charset=utf-8"),
            v1::ArchiveFormat::Mcap => {
                let recording = Box::new(Recording::new(&state.definition)?);
                (Self::Recording(recording), "mcap", "application/octet-stream")
            }
        })
    }

    /// Events that are written in one job.
    fn page(&self) -> i64 {
        if matches!(self, Self::Recording(_)) { PAGE_OF_MESHES } else { PAGE }
    }

    /// Writes some events, and gives what there is of the file by now.
    fn add(&mut self, steps: &[Step]) -> Result<Vec<u8>, Error> {
        for Step { row, retracted_by, state } in steps {
            match (&mut *self, state) {
                (Self::Bundle(bundle, table), _) => {
                    bundle.add_event(row)?;
                    table.add_event(row, *retracted_by)?;
                }
                (Self::Table(table), _) => table.add_event(row, *retracted_by)?,
                (Self::Recording(recording), Some(state)) => recording.add_event(row, state)?,
                (Self::Recording(_), None) => return Err(Error::internal("a recording needs the session")),
            }
        }
        Ok(match self {
            Self::Bundle(bundle, _) => bundle.take(),
            Self::Table(_) => Vec::new(),
            Self::Recording(recording) => recording.take(),
        })
    }

    fn finish(self, mesh: Option<&[u8]>) -> Result<Vec<u8>, Error> {
        match self {
            Self::Bundle(bundle, table) => bundle.finish(&table.finish()?, mesh),
            Self::Table(table) => table.finish(),
            Self::Recording(recording) => recording.finish(),
        }
    }
}

/// From where the states of a recording are computed.
#[derive(Default)]
struct States {
    entered: Entered<Snapshot>,
    fold: FreshFold<Snapshot>,
}

/// An export while it is written.
struct Run {
    api: Api,
    /// The session at the revision that is exported.
    state: Arc<Snapshot>,
    file: Outgoing,
}

impl Run {
    async fn run(mut self, writer: Writer) {
        let stopping = self.api.stopping.clone();
        let outcome = tokio::select! {
            outcome = self.write(writer) => outcome,
            () = stopping.cancelled() => Err(Error::Draining),
        };
        if let Err(error) = outcome {
            tracing::info!(%error, "an export ended");
            self.file.chunks.end(error);
        }
    }

    /// Ends without error when the caller is gone.
    async fn write(&mut self, mut writer: Writer) -> Result<(), Error> {
        let (session_id, created_us) = self.state.identity();
        let session_id = session_id.to_owned();
        let last = self.state.revision;
        let retractions = self.api.sessions.retractions(&session_id, last).await?;
        let mut states = States::default();
        let mut written = 0;
        while written < last {
            let count = writer.page().min(last - written);
            let read_bytes = self.api.limits.read_bytes;
            let rows = self.api.sessions.store.events_within(&session_id, written, count, read_bytes).await?;
            let now = self.api.sessions.store.session(&session_id).await?;
            if rows.is_empty() || now.is_none_or(|now| now.created_us != created_us) {
                return Err(Error::SessionNotFound { session_id });
            }
            written += rows.len() as i64;
            let steps = self.steps(rows, &retractions, &writer, &mut states).await?;
            let bytes;
            (writer, bytes) = self
                .in_pool(move || {
                    let bytes = writer.add(&steps)?;
                    Ok((writer, bytes))
                })
                .await?;
            if self.file.send(&bytes).await.is_err() {
                return Ok(());
            }
        }
        let mesh = if matches!(writer, Writer::Bundle(..)) { self.mesh().await? } else { None };
        let bytes = self.in_pool(move || writer.finish(mesh.as_deref())).await?;
        if self.file.send(&bytes).await.is_ok() {
            let _ = self.file.finish().await;
        }
        Ok(())
    }

    async fn steps(
        &self,
        rows: Vec<Event>,
        retractions: &Retractions,
        writer: &Writer,
        states: &mut States,
    ) -> Result<Vec<Step>, Error> {
        let seqs: Vec<i64> = rows.iter().map(|row| row.seq).collect();
        let states = match writer {
            Writer::Recording(_) => self.states_after(&seqs, states).await?.into_iter().map(Some).collect(),
            Writer::Bundle(..) | Writer::Table(_) => vec![None; rows.len()],
        };
        let step = |(row, state): (Event, _)| Step { retracted_by: retractions.of(row.seq), row, state };
        Ok(rows.into_iter().zip(states).map(step).collect())
    }

    /// The session after each of some events that follow each other, as it was then: where there are checkpoints all at
    /// a time, on as many cores as nobody else needs, and else one after the other.
    async fn states_after(&self, seqs: &[i64], states: &mut States) -> Result<Vec<Arc<Snapshot>>, Error> {
        let alone = try_join_all(seqs.iter().map(|seq| self.state_alone(*seq, &states.entered))).await?;
        let mut found = Vec::with_capacity(seqs.len());
        for (seq, alone) in seqs.iter().zip(alone) {
            found.push(match alone {
                Some(state) => state,
                None => self.state_after(*seq, &mut states.fold).await?,
            });
        }
        if let Some(last) = seqs.last() {
            self.enter(*last, &mut states.entered).await?;
        }
        Ok(found)
    }

    async fn state_alone(
        &self,
        seq: i64,
        entered: &Entered<Snapshot>,
    ) -> Result<Option<Arc<Snapshot>>, Error> {
        let (session_id, _) = self.state.identity();
        loop {
            let sessions = &self.api.sessions;
            match sessions.restored_alone(session_id, entered, seq, Queue::WATCHERS, self.deadline()).await {
                Ok(state) => return Ok(state),
                Err(error) => try_again(error).await?,
            }
        }
    }

    async fn enter(&self, seq: i64, entered: &mut Entered<Snapshot>) -> Result<(), Error> {
        let (session_id, _) = self.state.identity();
        loop {
            let sessions = &self.api.sessions;
            let before = std::mem::take(entered);
            match sessions.enter(session_id, before, seq, Queue::WATCHERS, self.deadline()).await {
                Ok(reached) => {
                    *entered = reached;
                    return Ok(());
                }
                Err(error) => try_again(error).await?,
            }
        }
    }

    /// The session after an event, as it was then.
    async fn state_after(&self, seq: i64, fold: &mut FreshFold<Snapshot>) -> Result<Arc<Snapshot>, Error> {
        let (session_id, _) = self.state.identity();
        loop {
            let sessions = &self.api.sessions;
            match sessions.fold_afresh(session_id, fold, seq, Queue::WATCHERS, self.deadline()).await {
                Ok(state) if state.revision == seq => return Ok(state),
                Ok(state) => state.check_open()?,
                Err(error) => try_again(error).await?,
            }
        }
    }

    /// The surface as a file; nothing before there is one.
    async fn mesh(&self) -> Result<Option<palpate_proto::Bytes>, Error> {
        let (revision, form) = (self.state.revision, Form::File(FileFormat::Ply));
        loop {
            let made =
                self.api.made_mesh(&self.state, revision, form, Queue::WATCHERS, self.deadline()).await;
            match made.map(|made| made.for_caller_with("").0.body) {
                Ok(Some(Body::File(file))) => return Ok(Some(file)),
                Ok(_) => return Err(Error::internal("a mesh that is no file")),
                Err(Error::NoVisualPrior) => return Ok(None),
                Err(error) => try_again(error).await?,
            }
        }
    }

    async fn in_pool<T: Send + 'static>(
        &self,
        job: impl FnOnce() -> Result<T, Error> + Send + 'static,
    ) -> Result<T, Error> {
        let (session_id, _) = self.state.identity();
        self.api.sessions.pool.run(Queue::WATCHERS, Work::File, session_id, self.deadline(), job).await?
    }

    fn deadline(&self) -> Instant {
        Instant::now() + self.api.limits.recompute_timeout
    }
}

/// The file as it leaves, in pieces of one size, with the digest of all in the last message.
struct Outgoing {
    chunks: Outbox<v1::Chunk>,
    digest: Sha256,
    waiting: Vec<u8>,
}

impl Outgoing {
    async fn send(&mut self, bytes: &[u8]) -> Result<(), Gone> {
        self.digest.update(bytes);
        self.waiting.extend_from_slice(bytes);
        let whole = self.waiting.len() - self.waiting.len() % CHUNK_BYTES;
        let rest = self.waiting.split_off(whole);
        for piece in std::mem::replace(&mut self.waiting, rest).chunks(CHUNK_BYTES) {
            let chunk = v1::Chunk { data: piece.to_vec().into(), sha256: String::new() };
            self.chunks.send(chunk, piece.len()).await?;
        }
        Ok(())
    }

    async fn finish(&mut self) -> Result<(), Gone> {
        let data = std::mem::take(&mut self.waiting);
        let (bytes, sha256) = (data.len(), hex(&self.digest.finalize_reset()));
        self.chunks.send(v1::Chunk { data: data.into(), sha256 }, bytes).await
    }
}
