//! What the service does, in messages of the contract: the one layer under gRPC and HTTP.
//!
//! Here a request is checked and turned into values of the method, and the outcome is turned back.
//! The transports above only move messages; the sessions below only keep order.
//!
//! Etags in messages are bare; HTTP puts the quotes around them.

mod capabilities;
mod evaluation;
mod experiments;
mod exploration;
mod explore;
mod export;
mod fork;
mod history;
mod import;
mod lease;
mod made_mesh;
mod mesh;
mod operation;
mod outbox;
mod places;
mod reading;
mod references;
mod replay;
mod series;
mod sessions;
mod surface_errors;
mod watch;

use std::net::IpAddr;
use std::sync::Arc;
use std::thread::available_parallelism;

use http::HeaderMap;
use palpate_core::reconstruction;
use palpate_proto::v1;
use prost::{Message, Name};
use sha2::{Digest, Sha256};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tracing::Instrument;
use uuid::Uuid;

use crate::access::{self, Caller};
use crate::compute::{Pool, on_account};
use crate::error::Error;
use crate::limits::{ERROR_TEXT_BYTES, Limits, SESSION_ID_BYTES};
use crate::metrics::Metrics;
use crate::session::Snapshot;
use crate::sessions::{Aggregate, Computed, Decision, RequestKey, Sessions, StoredEvent};
use crate::store::Store;
use crate::text::{Escaped, cut};
use crate::wire::{event, from_proto, to_proto};
use capabilities::capabilities;
pub(crate) use export::file_name;
use import::Imports;
use made_mesh::MadeMeshes;
pub(crate) use outbox::Replies;
use places::Places;
use references::ReadyReferences;
use surface_errors::ErrorTasks;
pub(crate) use watch::WatchUpdate;

/// The service; cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Api {
    sessions: Arc<Sessions<Snapshot>>,
    limits: Arc<Limits>,
    places: Places,
    meshes: Arc<MadeMeshes>,
    imports: Imports,
    references: Arc<ReadyReferences>,
    errors: Arc<ErrorTasks>,
    stopping: CancellationToken,
    instance_id: Uuid,
}

/// Who calls, and until when an answer is of use.
#[derive(Clone, Debug)]
pub(crate) struct Call {
    /// When the caller stops waiting; unset = the server's own bound.
    pub(crate) deadline: Option<Instant>,
    /// Who calls; its name goes into the log of events.
    pub(crate) caller: Caller,
    /// Where the call comes from, if the connection knows; it bounds the streams of one machine.
    pub(crate) peer: Option<IpAddr>,
    /// The revision that the session has to have reached: what the caller saw last, perhaps at another server.
    pub(crate) at_least: Option<i64>,
}

/// The header, or the metadata of gRPC, that says so.
pub(crate) const MIN_REVISION: &str = "x-min-revision";

/// What the header says.
///
/// # Errors
/// It is no revision.
pub(crate) fn min_revision(headers: &HeaderMap) -> Result<Option<i64>, Error> {
    let Some(value) = headers.get(MIN_REVISION) else { return Ok(None) };
    let revision =
        value.to_str().ok().and_then(|text| text.trim().parse().ok()).filter(|revision| *revision >= 0);
    revision.map(Some).ok_or_else(|| Error::field(MIN_REVISION, "is no revision: a number from 0 on"))
}

impl Api {
    /// The service over an open event log; `stopping` ends its streams and refuses changes.
    pub(crate) fn new(store: Store, limits: Limits, stopping: CancellationToken) -> Self {
        let cores = available_parallelism().map_or(1, usize::from);
        let pool = Pool::new(cores, &limits, store.metrics.clone());
        let limits = Arc::new(limits);
        let sessions = Arc::new(Sessions::new(store, pool, event::FOLDING, limits.clone(), stopping.clone()));
        tokio::spawn(sessions.clone().prove_all());
        tokio::spawn(sessions.clone().forget_idle());
        tokio::spawn(sessions.clone().follow_others());
        Self {
            sessions,
            places: Places::default(),
            meshes: Arc::new(MadeMeshes::new(limits.mesh_bytes)),
            imports: Imports::new(&limits),
            references: Arc::default(),
            errors: Arc::default(),
            limits,
            stopping,
            instance_id: Uuid::now_v7(),
        }
    }

    /// What the server is and can do.
    ///
    /// # Errors
    /// The caller may not know.
    pub(crate) async fn get_server_info(&self, call: Call) -> Result<v1::ServerInfo, Error> {
        self.run("GetServerInfo", "", &call, async |_| Ok(self.server_info())).await
    }

    fn server_info(&self) -> v1::ServerInfo {
        v1::ServerInfo {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            algorithm_version: reconstruction::version().to_owned(),
            capabilities: capabilities(),
            mesh_formats: mesh::FORMATS.map(i32::from).to_vec(),
            max_message_bytes: i64::try_from(self.limits.message_bytes).unwrap_or(i64::MAX),
            instance_id: self.instance_id.to_string(),
        }
    }

    /// Whether the service can do its work: the log takes writes, is read, and the server is not stopping.
    ///
    /// # Errors
    /// [`Error::Draining`] or [`Error::StoreDown`].
    pub(crate) async fn ready(&self) -> Result<(), Error> {
        if self.stopping.is_cancelled() {
            return Err(Error::Draining);
        }
        self.sessions.store.check_writable().await?;
        Ok(self.sessions.store.check_readable().await?)
    }

    /// How many sessions are quarantined, and how many acknowledged events were missing when the server started.
    ///
    /// # Errors
    /// [`Error::StoreDown`].
    pub(crate) async fn losses(&self) -> Result<(i64, i64), Error> {
        let store = &self.sessions.store;
        Ok((store.damaged_count().await?, store.missing()))
    }

    /// Waits until every accepted write is on disk, and closes the log.
    pub(crate) async fn finish(&self) {
        self.sessions.store.close().await;
    }

    /// What this service counts.
    pub(crate) fn metrics(&self) -> &Metrics {
        &self.sessions.store.metrics
    }

    /// The bounds that this service keeps.
    pub(crate) fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Gives `work` until the caller's deadline and logs what became of it: one line for each call.
    async fn run<T>(
        &self,
        method: &'static str,
        session_id: &str,
        call: &Call,
        work: impl AsyncFnOnce(Instant) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let started = Instant::now();
        let deadline = call.deadline.unwrap_or_else(|| started + self.limits.call_timeout);
        // What a caller calls a session may be of any length, until it is checked.
        let shown = cut(session_id, SESSION_ID_BYTES);
        let span = tracing::info_span!("call", method, session_id = &*shown, actor = call.caller.actor());
        async {
            let allowed = call.caller.check(access::needed(method));
            let outcome = match allowed {
                Ok(()) => {
                    let work = on_account(call.caller.account().clone(), work(deadline));
                    let answered = tokio::time::timeout_at(deadline, work).await;
                    answered.unwrap_or(Err(Error::DeadlineExceeded))
                }
                Err(refusal) => Err(refusal),
            };
            log(outcome.as_ref().err(), started);
            self.metrics().call(method, outcome.as_ref().err(), started.elapsed());
            outcome
        }
        .instrument(span)
        .await
    }

    /// [`Api::run`] for a call that is about one session and has to name it.
    async fn run_on_session<T>(
        &self,
        method: &'static str,
        session_id: &str,
        call: &Call,
        work: impl AsyncFnOnce(Instant) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.run(method, session_id, call, async |deadline| {
            from_proto::check_session_named("session_id", session_id)?;
            self.check_visible(session_id, &call.caller).await?;
            if let Some(revision) = call.at_least {
                self.sessions.reach(session_id, revision, deadline).await?;
            }
            work(deadline).await
        })
        .await
    }

    /// # Errors
    /// The session is not there for the caller: there is none, or it is of an experiment that the caller is kept from.
    async fn check_visible(&self, session_id: &str, caller: &Caller) -> Result<(), Error> {
        match self.sees(session_id, caller).await? {
            Some(true) => Ok(()),
            Some(false) | None => Err(Error::SessionNotFound { session_id: session_id.to_owned() }),
        }
    }

    /// Whether the caller may see a session; nothing where there is none to be kept from.
    async fn sees(&self, session_id: &str, caller: &Caller) -> Result<Option<bool>, Error> {
        if caller.experiments().is_none() {
            return Ok(Some(true));
        }
        let loaded = self.sessions.loaded(session_id).filter(|_| !self.sessions.store.is_shared());
        let experiment = match loaded {
            Some(snapshot) => Some(snapshot.definition.experiment.clone()),
            None => self.sessions.store.experiment_of(session_id).await?,
        };
        Ok(experiment.map(|experiment| caller.sees(&experiment)))
    }
}

fn log(failure: Option<&Error>, started: Instant) {
    let ms = three_digits(started.elapsed().as_secs_f64() * 1e3);
    match failure {
        None => tracing::info!(outcome = "OK", ms),
        Some(error) => match error.detail() {
            Some(detail) => tracing::error!(outcome = error.reason(), detail, ms),
            None => {
                let (outcome, error) = (error.reason(), error.to_string());
                let error = cut(&error, ERROR_TEXT_BYTES);
                tracing::info!(outcome, error = %Escaped(&error), ms);
            }
        },
    }
}

/// A duration is worth three significant digits.
fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Tells a retry of `request` from another request under the same id.
fn request_key<M: Message + Name>(id: &str, request: &M, limits: &Limits) -> Result<RequestKey, Error> {
    from_proto::check_name("request_id", id, limits)?;
    let mut hash = Sha256::new();
    hash.update(M::full_name());
    // Maps are ordered in the generated code, so equal messages have equal bytes.
    hash.update(request.encode_to_vec());
    Ok(RequestKey { id: id.to_owned(), digest: hash.finalize().to_vec() })
}

/// The session after a change and the reply to it, with all that the log keeps of both.
fn computed<M: Message>(after: Snapshot, reply: &M) -> Computed<Snapshot> {
    Computed {
        reply: reply.encode_to_vec(),
        state: to_proto::state(after.state).into(),
        summary: to_proto::session(&after).encode_to_vec(),
        stats_after: to_proto::stats(&after).encode_to_vec(),
        state_hash: after.state_hash(),
        append_us: after.updated_us,
        new_labels: None,
        after,
    }
}

/// An event to append, with the session after it and the reply to it.
fn appended<M: Message>(event: StoredEvent, after: Snapshot, reply: &M) -> Decision<Snapshot> {
    Decision::Append(event, computed(after, reply))
}

/// A message that this server wrote itself.
fn stored<M: Message + Default>(bytes: &[u8]) -> Result<M, Error> {
    M::decode(bytes).map_err(|error| Error::internal(format!("a stored reply cannot be read: {error}")))
}

/// How many items a page has.
fn page_size(wanted: i32, limits: &Limits) -> Result<u32, Error> {
    match u32::try_from(wanted) {
        Ok(0) => Ok(limits.page_size),
        Ok(wanted) => Ok(wanted.min(limits.page_size_max)),
        Err(_) => Err(Error::field("page_size", format!("{wanted} is negative"))),
    }
}

fn bad_page_token() -> Error {
    Error::field("page_token", "was not made by this service: give back next_page_token as it came")
}

#[cfg(test)]
mod tests;
