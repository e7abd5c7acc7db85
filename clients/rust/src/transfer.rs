//! Streams with an end: a session as a file, out and in, and its steps again.

use palpate_proto::Bytes;
use palpate_proto::v1::import_session_request::Part;
use palpate_proto::v1::{
    Chunk, CreateSessionRequest, ExportSessionRequest, ImportSessionRequest, ReplaySessionRequest, Session,
    WatchSessionResponse,
};
use sha2::{Digest, Sha256};
use tonic::Streaming;

use crate::retry::ensure_request_id;
use crate::routing::{routed, to_session};
use crate::{Client, Error};

/// Bytes of a file in one message.
const CHUNK_BYTES: usize = 1 << 20;

/// The steps of a session, as they come.
#[derive(Debug)]
pub struct Replay {
    steps: Streaming<WatchSessionResponse>,
}

impl Replay {
    /// Waits for the next step; `None` after the last one.
    ///
    /// # Errors
    /// [`Error::Refused`] when the log is damaged or the server stops. Nothing is sent again: ask for the rest.
    pub async fn next(&mut self) -> Result<Option<WatchSessionResponse>, Error> {
        self.steps.message().await.map_err(|status| Error::from_status(&status, 1))
    }
}

/// A file, as it comes, checked at its end.
#[derive(Debug)]
pub struct Download {
    chunks: Streaming<Chunk>,
    digest: Sha256,
    is_whole: bool,
}

impl Download {
    /// Waits for the next bytes; `None` once the whole file came and is what the server sent.
    ///
    /// # Errors
    /// [`Error::Refused`] when the server cannot go on, [`Error::NoAnswer`] when the file was cut or changed on the way.
    pub async fn next(&mut self) -> Result<Option<Bytes>, Error> {
        let chunk = self.chunks.message().await.map_err(|status| Error::from_status(&status, 1))?;
        let Some(Chunk { data, sha256 }) = chunk else {
            return if self.is_whole { Ok(None) } else { Err(broken("the file was cut on the way")) };
        };
        self.digest.update(&data);
        if !sha256.is_empty() {
            let found: String =
                self.digest.finalize_reset().iter().map(|byte| format!("{byte:02x}")).collect();
            if found != sha256 {
                return Err(broken("the file was changed on the way: its SHA-256 is another one"));
            }
            self.is_whole = true;
        }
        Ok(Some(data))
    }
}

fn broken(detail: &str) -> Error {
    Error::NoAnswer { attempts: 1, detail: detail.to_owned() }
}

impl Client {
    /// Shows the steps of a session again, and with `verify` computes each anew.
    ///
    /// # Errors
    /// [`Error::Refused`] when there is no such session or revision.
    pub async fn replay_session(&self, request: ReplaySessionRequest) -> Result<Replay, Error> {
        let mut service = self.reconstruction();
        let steps = self.in_time(service.replay_session(routed(request)), 1).await?.into_inner();
        Ok(Replay { steps })
    }

    /// Streams a session as a file.
    ///
    /// # Errors
    /// [`Error::Refused`] when there is no such session or revision.
    pub async fn export_session(&self, request: ExportSessionRequest) -> Result<Download, Error> {
        let mut service = self.sessions();
        let chunks = self.in_time(service.export_session(routed(request)), 1).await?.into_inner();
        Ok(Download { chunks, digest: Sha256::new(), is_whole: false })
    }

    /// Creates a session from the bytes of an exported bundle. It is sent once, however long it takes: with a
    /// `request_id` of the caller's own it can be sent again.
    ///
    /// # Errors
    /// [`Error::Refused`] when the bundle cannot be taken over or the id is taken.
    pub async fn import_session(
        &self,
        mut header: CreateSessionRequest,
        bundle: Bytes,
    ) -> Result<Session, Error> {
        ensure_request_id(&mut header.request_id);
        let session_id = header.session_id.clone();
        let header = ImportSessionRequest { part: Some(Part::Header(header)) };
        let pieces = (0..bundle.len().div_ceil(CHUNK_BYTES)).map(move |index| {
            let start = index * CHUNK_BYTES;
            let data = bundle.slice(start..bundle.len().min(start + CHUNK_BYTES));
            ImportSessionRequest { part: Some(Part::Data(data)) }
        });
        let parts = tokio_stream::iter(std::iter::once(header).chain(pieces));
        let imported = self.sessions().import_session(to_session(&session_id, parts)).await;
        Ok(imported.map_err(|status| Error::from_status(&status, 1))?.into_inner())
    }
}
