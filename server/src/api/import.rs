//! A session from a bundle: the same session under the same id, or a fork of it under another name.
//!
//! The bundle is in memory from its first byte to the answer, and nowhere else; all bundles together have a bound.

use std::collections::VecDeque;
use std::io::{self, Read};
use std::pin::pin;
use std::sync::Arc;

use futures_util::{Stream, StreamExt};
use palpate_proto::v1;
use palpate_proto::v1::import_session_request::Part;
use prost::Message;
use sha2::{Digest, Sha256};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::Instant;

use super::fork::{carry, creation, experiment_of, forked};
use super::{Api, Call, computed, request_key, stored};
use crate::archive::{self, Bundle, Origin};
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::limits::Limits;
use crate::session::Snapshot;
use crate::sessions::{Copy, Created, Original, RequestKey, Takeover};
use crate::wire::{from_proto, to_proto};

/// Bytes of a bundle that are kept in one piece, and freed together once they are read.
const BLOCK_BYTES: usize = 1 << 20;

/// Room for all bundles that are being imported, in bytes.
#[derive(Clone, Debug)]
pub(super) struct Imports {
    room: Arc<Semaphore>,
    limit_bytes: usize,
}

/// A bundle as it came.
struct Received {
    blocks: VecDeque<Vec<u8>>,
    digest: Sha256,
    bytes: u64,
    /// Room for it, until it is answered.
    room: Option<OwnedSemaphorePermit>,
}

impl Imports {
    pub(super) fn new(limits: &Limits) -> Self {
        let limit_bytes =
            usize::try_from(limits.import_bytes).unwrap_or(usize::MAX).min(Semaphore::MAX_PERMITS);
        Self { room: Arc::new(Semaphore::new(limit_bytes)), limit_bytes }
    }
}

impl Api {
    /// Makes a session of a bundle: the header comes first, then the bytes.
    ///
    /// # Errors
    /// The bundle is none, not whole or not sound, the id is taken, or the server has no room.
    pub(crate) async fn import_session(
        &self,
        parts: impl Stream<Item = Result<v1::ImportSessionRequest, Error>> + Send,
        call: Call,
    ) -> Result<v1::Session, Error> {
        // It takes as long as its bytes come and its touches take together, so the bound on other calls is too short.
        let deadline = call.deadline.unwrap_or_else(|| Instant::now() + self.limits.recompute_timeout);
        let call = Call { deadline: Some(deadline), ..call };
        self.run("ImportSession", "", &call, async |deadline| {
            let mut parts = pin!(parts);
            let header = self.header(self.next_part(&mut parts).await?)?;
            let Received { blocks, digest, bytes: _, room } = self.receive(&mut parts).await?;
            let request = key(&header, digest, &self.limits)?;
            let limits = self.limits.clone();
            let read = move || {
                let bundle = archive::read(Blocks { blocks, read: 0 }, &limits)?;
                let origin = archive::check(&bundle, &limits)?;
                Ok::<_, Error>((bundle, origin))
            };
            let (bundle, origin) =
                self.sessions.pool.run(Queue::READERS, Work::File, "", deadline, read).await??;
            let is_the_same = is_empty(&header);
            let session = if is_the_same {
                self.take_over(bundle, &origin, request, &call).await
            } else {
                self.fork_of(bundle, origin, header, request, &call).await
            };
            drop(room);
            session
        })
        .await
    }

    async fn next_part(
        &self,
        parts: &mut (impl Stream<Item = Result<v1::ImportSessionRequest, Error>> + Unpin),
    ) -> Result<Option<Part>, Error> {
        let limit = self.limits.body_timeout;
        let next = tokio::time::timeout(limit, parts.next()).await;
        let next = next.map_err(|_elapsed| Error::BodyTooSlow { limit })?;
        Ok(next.transpose()?.and_then(|request| request.part))
    }

    fn header(&self, part: Option<Part>) -> Result<v1::CreateSessionRequest, Error> {
        let Some(Part::Header(header)) = part else {
            return Err(Error::field("header", "is missing: it comes first, and may be empty"));
        };
        if !header.session_id.is_empty() {
            from_proto::check_session_id(&header.session_id)?;
        }
        from_proto::check_name("display_name", &header.display_name, &self.limits)?;
        from_proto::check_name("experiment", &header.experiment, &self.limits)?;
        from_proto::check_name("request_id", &header.request_id, &self.limits)?;
        from_proto::check_labels(&header.labels, &self.limits)?;
        let given = [("frame_id", !header.frame_id.is_empty()), ("config", header.config.is_some())];
        match given.into_iter().find(|(_, is_given)| *is_given) {
            Some((field, _)) => Err(Error::field(field, "comes from the bundle: leave it out")),
            None => Ok(header),
        }
    }

    async fn receive(
        &self,
        parts: &mut (impl Stream<Item = Result<v1::ImportSessionRequest, Error>> + Unpin),
    ) -> Result<Received, Error> {
        let mut received = Received { blocks: VecDeque::new(), digest: Sha256::new(), bytes: 0, room: None };
        while let Some(part) = self.next_part(parts).await? {
            let Part::Data(data) = part else {
                return Err(Error::field("header", "comes twice: send it once, before the data"));
            };
            received.take(&data, &self.imports, &self.limits)?;
        }
        Ok(received)
    }

    async fn take_over(
        &self,
        bundle: Bundle,
        origin: &Origin,
        request: RequestKey,
        call: &Call,
    ) -> Result<v1::Session, Error> {
        call.caller.check_experiment(&origin.definition.experiment)?;
        let Bundle { session_id, events } = bundle;
        let takeover = Takeover { session_id, request, events, owner: call.caller.owner(), describe };
        stored(&self.sessions.take_over(takeover).await?.bytes)
    }

    async fn fork_of(
        &self,
        bundle: Bundle,
        origin: Origin,
        header: v1::CreateSessionRequest,
        request: RequestKey,
        call: &Call,
    ) -> Result<v1::Session, Error> {
        let Origin { definition, last_to_copy, .. } = origin;
        let v1::CreateSessionRequest { session_id, display_name, experiment, labels, .. } = header;
        let names = v1::ForkSessionRequest { display_name, experiment, labels, ..Default::default() };
        let forked = forked(&definition, last_to_copy, &names)?;
        call.caller.check_experiment(experiment_of(&forked))?;
        // Checked before the copy begins, as nothing of it depends on the id.
        from_proto::fork(&forked, 0, &self.limits)?;
        let mut events = bundle.events;
        events.truncate(usize::try_from(last_to_copy).unwrap_or(0));
        let copy = Copy {
            creation: creation(session_id, forked, request, &call.caller, &self.limits),
            original: Original::Events(events),
            carry: Arc::new(carry(self.limits.clone())),
            reply: |copy| to_proto::session(copy).encode_to_vec(),
        };
        let made = self.sessions.copy(copy).await.map_err(|error| error.of_field("data"))?;
        stored(&made.bytes)
    }
}

/// Whether nothing is said of the new session, so that it is the one in the bundle.
fn is_empty(header: &v1::CreateSessionRequest) -> bool {
    let v1::CreateSessionRequest {
        session_id,
        display_name,
        experiment,
        frame_id: _,
        labels,
        config: _,
        request_id: _,
    } = header;
    session_id.is_empty() && display_name.is_empty() && experiment.is_empty() && labels.is_empty()
}

/// Tells a retry from another import: header and bytes are the same.
fn key(header: &v1::CreateSessionRequest, content: Sha256, limits: &Limits) -> Result<RequestKey, Error> {
    let RequestKey { id, digest } = request_key(&header.request_id, header, limits)?;
    let mut both = Sha256::new_with_prefix("palpate import 1");
    both.update(&digest);
    both.update(content.finalize());
    Ok(RequestKey { id, digest: both.finalize().to_vec() })
}

/// What lists show of a session that was taken over, and the reply to the caller.
fn describe(session: Snapshot) -> Created<Snapshot> {
    let reply = to_proto::session(&session);
    let (experiment, labels) = (session.definition.experiment.clone(), session.definition.labels.clone());
    // Its events are there already.
    Created { event: ("", Vec::new()), computed: computed(session, &reply), experiment, labels }
}

impl Received {
    fn take(&mut self, data: &[u8], imports: &Imports, limits: &Limits) -> Result<(), Error> {
        self.bytes += data.len() as u64;
        if self.bytes > limits.archive_bytes {
            return Err(Error::TooLarge {
                what: "the bundle".into(),
                limit: format!("{} bytes", limits.archive_bytes),
                hint: "no session is so large: send a bundle as it was exported",
            });
        }
        let overloaded = Error::Overloaded { limit: imports.limit_bytes };
        let count = u32::try_from(data.len()).map_err(|_| overloaded.clone())?;
        let taken = imports.room.clone().try_acquire_many_owned(count).map_err(|_| overloaded)?;
        match &mut self.room {
            Some(room) => room.merge(taken),
            none => *none = Some(taken),
        }
        self.digest.update(data);
        // Small pieces are put together, so that a bundle takes the memory that it has bytes.
        match self.blocks.back_mut() {
            Some(last) if last.len() + data.len() <= BLOCK_BYTES => last.extend_from_slice(data),
            _ => {
                let mut block = Vec::with_capacity(data.len().max(BLOCK_BYTES));
                block.extend_from_slice(data);
                self.blocks.push_back(block);
            }
        }
        Ok(())
    }
}

/// Reads blocks, and frees each once it is read.
struct Blocks {
    blocks: VecDeque<Vec<u8>>,
    /// Bytes of the first block that are read.
    read: usize,
}

impl Read for Blocks {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        while let Some(first) = self.blocks.front() {
            let count = (&first[self.read..]).read(into)?;
            if count > 0 || into.is_empty() {
                self.read += count;
                return Ok(count);
            }
            self.blocks.pop_front();
            self.read = 0;
        }
        Ok(0)
    }
}
