//! A bundle that somebody sent: nothing of it is believed, and nothing of it is written to a disk.
//!
//! Only what this service writes is read: plain members by their own names, in their order, within bounds, each with
//! the digest that the last one says. Everything else is refused, whatever another program would make of it.

use std::io::Read;

use palpate_proto::v1;
use prost::Message;

use super::bundle::{FORMAT, MANIFEST, MESH, Manifest, SESSION, SUMS, TABLE, VERSION, event_name, sum};
use super::check::is_session_id;
use super::wrong;
use crate::error::Error;
use crate::limits::Limits;
use crate::store::{Event, Link, first_link};
use crate::text::quoted;

/// Bytes of a manifest, which has some three hundred.
const MANIFEST_BYTES: u64 = 16 << 10;

/// Bytes of the line of a member in the digests: 64 of the digest, two spaces, the name.
const SUM_LINE_BYTES: u64 = 128;

/// The log in a bundle: whole, linked from the first event on, and not looked into.
#[derive(Debug)]
pub(crate) struct Bundle {
    pub(crate) session_id: String,
    pub(crate) events: Vec<Event>,
}

/// What of a bundle was read.
#[derive(Default)]
struct Progress {
    /// The members so far, in their order.
    names: Vec<String>,
    sums: String,
    manifest: Option<Manifest>,
    events: Vec<Event>,
    link: Link,
    is_complete: bool,
}

/// Reads a bundle.
///
/// # Errors
/// It is none, or not whole, or not as it was written; `data` says what is wrong.
pub(crate) fn read(mut archive: impl Read, limits: &Limits) -> Result<Bundle, Error> {
    let mut progress = Progress::default();
    {
        let mut tar = tar::Archive::new(&mut archive);
        // Raw, so that the library acts on no extension of the format: long names, sparse files, other sizes.
        for entry in tar.entries().map_err(damaged)?.raw(true) {
            progress.take(entry.map_err(damaged)?, limits)?;
        }
    }
    check_rest(archive)?;
    progress.finish()
}

impl Progress {
    fn take(&mut self, mut entry: tar::Entry<'_, impl Read>, limits: &Limits) -> Result<(), Error> {
        let name = std::str::from_utf8(&entry.path_bytes()).map(str::to_owned);
        let name = name.map_err(|_| wrong("has a member whose name is no UTF-8"))?;
        let shown = quoted(&name);
        if entry.header().entry_type() != tar::EntryType::Regular {
            return Err(wrong(format!("has a member {shown} that is no plain file")));
        }
        if self.is_complete {
            return Err(wrong(format!("has a member {shown} after {SUMS}, which is the last")));
        }
        if self.names.contains(&name) {
            return Err(wrong(format!("has the member {shown} twice")));
        }
        if self.names.len() >= limits.archive_members {
            return Err(wrong(format!("has more members than the limit of {}", limits.archive_members)));
        }
        let most = self.most_bytes(&name, limits)?;
        let size = entry.header().entry_size().map_err(damaged)?;
        if size > most {
            return Err(wrong(format!(
                "has a member {shown} of {size} bytes, more than the limit of {most}"
            )));
        }
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).map_err(damaged)?;
        if bytes.len() as u64 != size {
            return Err(wrong(format!("ends within the member {shown}: was it cut on the way?")));
        }
        self.keep(name, &bytes)
    }

    /// How large the next member may be, where it may have this name at all.
    fn most_bytes(&self, name: &str, limits: &Limits) -> Result<u64, Error> {
        // An event has a request, which was within the limit on messages, and the reply to it.
        let of_a_message = 2 * limits.message_bytes as u64;
        let next_event = event_name(self.events.len() as i64 + 1);
        match name {
            MANIFEST if self.manifest.is_none() => Ok(MANIFEST_BYTES),
            _ if self.manifest.is_none() => {
                Err(wrong(format!("does not begin with {MANIFEST}: is it a bundle?")))
            }
            SESSION | TABLE | MESH => Ok(of_a_message),
            SUMS => Ok(SUM_LINE_BYTES * (self.names.len() as u64 + 1)),
            name if name == next_event => Ok(of_a_message),
            name if name.starts_with("log/") => {
                Err(wrong(format!("has {} in the place of {next_event}", quoted(name))))
            }
            other => Err(wrong(format!("has a member {} that no bundle has", quoted(other)))),
        }
    }

    fn keep(&mut self, name: String, bytes: &[u8]) -> Result<(), Error> {
        match name.as_str() {
            MANIFEST => {
                let manifest = manifest(bytes)?;
                self.link = first_link(&manifest.session_id);
                self.manifest = Some(manifest);
            }
            SUMS => {
                self.is_complete = true;
                return self.compare(bytes);
            }
            SESSION | TABLE | MESH => {}
            _ => {
                self.sums.push_str(&sum(&name, bytes));
                self.names.push(name);
                return self.keep_event(bytes);
            }
        }
        self.sums.push_str(&sum(&name, bytes));
        self.names.push(name);
        Ok(())
    }

    fn keep_event(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let expected = self.events.len() as i64 + 1;
        let logged = v1::LoggedEvent::decode(bytes);
        let logged =
            logged.map_err(|error| wrong(format!("has an event {expected} that is none: {error}")))?;
        let (event, link) = event(logged);
        if event.seq != expected {
            return Err(wrong(format!("has event {} in the place of event {expected}", event.seq)));
        }
        let next = event.link(&self.link);
        if link != next {
            let description = format!(
                "has an event {expected} that does not follow what is before it: its link is another one"
            );
            return Err(wrong(description));
        }
        self.link = next;
        self.events.push(event);
        Ok(())
    }

    /// The digests must be those of the members, and of no others.
    fn compare(&self, claimed: &[u8]) -> Result<(), Error> {
        if claimed == self.sums.as_bytes() {
            return Ok(());
        }
        let claimed = String::from_utf8_lossy(claimed);
        let is_claimed = |line: &str| claimed.lines().any(|claim| claim == line);
        let differing = self.sums.lines().zip(&self.names).find(|(line, _)| !is_claimed(line));
        Err(wrong(match differing {
            Some((_, name)) => format!("has a member {name} that is not what {SUMS} says"),
            None => format!("has fewer members than {SUMS} says, or others"),
        }))
    }

    fn finish(self) -> Result<Bundle, Error> {
        let manifest = self
            .manifest
            .ok_or_else(|| wrong("is empty, or no tar file: send a bundle as it was exported"))?;
        if !self.is_complete {
            return Err(wrong(format!("ends before {SUMS}: was it cut on the way?")));
        }
        let events = self.events.len();
        if usize::try_from(manifest.revision) != Ok(events) {
            let description = format!("has {events} events, and its manifest says {}", manifest.revision);
            return Err(wrong(description));
        }
        Ok(Bundle { session_id: manifest.session_id, events: self.events })
    }
}

fn manifest(bytes: &[u8]) -> Result<Manifest, Error> {
    let unreadable =
        |error: serde_json::Error| wrong(format!("has a {MANIFEST} that cannot be read: {error}"));
    // A later version may have other fields, and is to be told apart first.
    let value: serde_json::Value = serde_json::from_slice(bytes).map_err(unreadable)?;
    if value["format"] != FORMAT {
        return Err(wrong(format!("is no bundle: its {MANIFEST} is not of the format {FORMAT}")));
    }
    if value["version"] != VERSION {
        let found = quoted(&value["version"].to_string());
        return Err(wrong(format!(
            "is a bundle of version {found}, and this server reads version {VERSION}"
        )));
    }
    let manifest: Manifest = serde_json::from_value(value).map_err(unreadable)?;
    if !is_session_id(&manifest.session_id) {
        return Err(wrong(format!("is of {}, which is no session's id", quoted(&manifest.session_id))));
    }
    Ok(manifest)
}

fn event(logged: v1::LoggedEvent) -> (Event, Vec<u8>) {
    let v1::LoggedEvent {
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
        link,
    } = logged;
    let event = Event {
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
    };
    (event, link.into())
}

/// After the end of a tar file there is nothing but zeros.
fn check_rest(mut archive: impl Read) -> Result<(), Error> {
    let mut block = [0; 4096];
    loop {
        match archive.read(&mut block).map_err(damaged)? {
            0 => return Ok(()),
            count if block[..count].iter().any(|&byte| byte != 0) => {
                return Err(wrong("goes on after its end: send a bundle as it was exported"));
            }
            _ => {}
        }
    }
}

#[expect(clippy::needless_pass_by_value, reason = "a conversion of errors takes them")]
fn damaged(error: std::io::Error) -> Error {
    wrong(format!("is no tar file, or a damaged one: {error}"))
}
