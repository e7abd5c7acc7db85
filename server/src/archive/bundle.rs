//! The bundle: a plain tar file whose last member has the digests of the others.

use palpate_proto::{Bytes, v1};
use prost::Message;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::unwritten;
use crate::error::Error;
use crate::session::hex;
use crate::store::{Event, Link};

/// What a bundle calls itself, and the version that is written and read here.
pub(super) const FORMAT: &str = "palpate-bundle";
pub(super) const VERSION: u32 = 1;

pub(super) const MANIFEST: &str = "manifest.json";
pub(super) const SESSION: &str = "session.json";
pub(super) const TABLE: &str = "attempts.csv";
pub(super) const MESH: &str = "mesh.ply";
pub(super) const SUMS: &str = "SHA256SUMS";

/// The name of the member that has an event.
pub(super) fn event_name(seq: i64) -> String {
    format!("log/{seq:06}.pb")
}

/// What a bundle is, in its first member.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Manifest {
    format: String,
    version: u32,
    pub(crate) session_id: String,
    /// The last event that is in it.
    pub(crate) revision: i64,
    algorithm_version: String,
    server_version: String,
    create_time: String,
    update_time: String,
}

impl Manifest {
    /// The manifest of a bundle of this session at its last revision.
    pub(crate) fn of(session: &v1::Session) -> Self {
        let time = |time: &Option<palpate_proto::Timestamp>| {
            time.as_ref().map(ToString::to_string).unwrap_or_default()
        };
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            session_id: session.session_id.clone(),
            revision: session.revision,
            algorithm_version: session.algorithm_version.clone(),
            server_version: env!("CARGO_PKG_VERSION").to_owned(),
            create_time: time(&session.create_time),
            update_time: time(&session.update_time),
        }
    }
}

/// Writes a bundle, member by member.
pub(crate) struct BundleWriter {
    tar: tar::Builder<Vec<u8>>,
    sums: String,
    /// When the session changed last, in seconds since 1970: the time of all members.
    changed_s: u64,
    link: Link,
}

impl BundleWriter {
    /// A bundle of this session up to its revision; `first` is what the first event is linked to.
    ///
    /// # Errors
    /// None but by a bug of this server.
    pub(crate) fn new(session: &v1::Session, session_json: &str, first: Link) -> Result<Self, Error> {
        let changed_s = session.update_time.as_ref().map_or(0, |time| time.seconds);
        let changed_s = u64::try_from(changed_s).unwrap_or(0);
        let mut writer =
            Self { tar: tar::Builder::new(Vec::new()), sums: String::new(), changed_s, link: first };
        let manifest = serde_json::to_string_pretty(&Manifest::of(session)).map_err(unwritten)?;
        writer.add(MANIFEST, (manifest + "\n").as_bytes())?;
        writer.add(SESSION, session_json.as_bytes())?;
        Ok(writer)
    }

    /// The next event of the log.
    ///
    /// # Errors
    /// None but by a bug of this server.
    pub(crate) fn add_event(&mut self, event: &Event) -> Result<(), Error> {
        self.link = event.link(&self.link);
        self.add(&event_name(event.seq), &logged(event, &self.link).encode_to_vec())
    }

    /// What was written since the last time.
    pub(crate) fn take(&mut self) -> Vec<u8> {
        std::mem::take(self.tar.get_mut())
    }

    /// The members after the log, and the end.
    ///
    /// # Errors
    /// None but by a bug of this server.
    pub(crate) fn finish(mut self, table: &[u8], mesh: Option<&[u8]>) -> Result<Vec<u8>, Error> {
        self.add(TABLE, table)?;
        if let Some(mesh) = mesh {
            self.add(MESH, mesh)?;
        }
        let sums = std::mem::take(&mut self.sums);
        self.add(SUMS, sums.as_bytes())?;
        self.tar.into_inner().map_err(unwritten)
    }

    fn add(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        let mut header = tar::Header::new_ustar();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        header.set_mtime(self.changed_s);
        header.set_entry_type(tar::EntryType::Regular);
        self.tar.append_data(&mut header, name, bytes).map_err(unwritten)?;
        self.sums.push_str(&sum(name, bytes));
        Ok(())
    }
}

/// The line of a member, as `sha256sum` writes it.
pub(super) fn sum(name: &str, bytes: &[u8]) -> String {
    format!("{}  {name}\n", hex(&Sha256::digest(bytes)))
}

fn logged(event: &Event, link: &Link) -> v1::LoggedEvent {
    let Event {
        seq,
        request_id,
        request_digest,
        kind,
        payload,
        reply,
        state_hash,
        stats_after,
        algorithm_version,
        append_us,
        actor,
    } = event.clone();
    v1::LoggedEvent {
        seq,
        request_id,
        request_digest: request_digest.into(),
        kind,
        payload: payload.into(),
        reply: reply.into(),
        state_hash,
        stats_after: stats_after.into(),
        algorithm_version,
        append_us,
        actor,
        link: Bytes::copy_from_slice(link),
    }
}
