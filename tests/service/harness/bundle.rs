//! Bundles as anybody else would read and forge them, by docs/formats.md alone.

use palpate_proto::v1;
use prost::Message;
use sha2::{Digest, Sha256};
use std::io::Read;

/// The members of a tar file but for the digests, in their order.
#[derive(Clone, Debug)]
pub(crate) struct Members(pub(crate) Vec<(String, Vec<u8>)>);

impl Members {
    pub(crate) fn of(bundle: &[u8]) -> Self {
        let mut members = Vec::new();
        for entry in tar::Archive::new(bundle).entries().unwrap() {
            let mut entry = entry.unwrap();
            let name = entry.path().unwrap().to_str().unwrap().to_owned();
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).unwrap();
            members.push((name, bytes));
        }
        assert_eq!(members.pop().unwrap().0, "SHA256SUMS");
        Self(members)
    }

    pub(crate) fn names(&self) -> Vec<&str> {
        self.0.iter().map(|(name, _)| name.as_str()).collect()
    }

    pub(crate) fn get(&mut self, name: &str) -> &mut Vec<u8> {
        &mut self.0.iter_mut().find(|(member, _)| member == name).unwrap().1
    }

    /// The digests as `sha256sum` writes them.
    pub(crate) fn sums(&self) -> String {
        self.0.iter().map(|(name, bytes)| format!("{}  {name}\n", hex(&Sha256::digest(bytes)))).collect()
    }

    /// A tar file with these members and their digests.
    pub(crate) fn pack(&self) -> Vec<u8> {
        let sums = ("SHA256SUMS".to_owned(), self.sums().into_bytes());
        pack(self.0.iter().chain([&sums]))
    }

    /// The log.
    pub(crate) fn events(&self) -> Vec<v1::LoggedEvent> {
        let logged = self.0.iter().filter(|(name, _)| name.starts_with("log/"));
        logged.map(|(_, bytes)| v1::LoggedEvent::decode(bytes.as_slice()).unwrap()).collect()
    }

    /// The same bundle with another log, linked as if it had always been so.
    pub(crate) fn forged(&self, session_id: &str, change: impl FnOnce(&mut Vec<v1::LoggedEvent>)) -> Self {
        let mut events = self.events();
        change(&mut events);
        let mut link = hash("palpate log 1", &[session_id.as_bytes()]);
        let mut members = self.clone();
        for mut event in events {
            link = self::link(&link, &event);
            event.link = link.clone().into();
            *members.get(&format!("log/{:06}.pb", event.seq)) = event.encode_to_vec();
        }
        members
    }
}

pub(crate) fn pack<'a>(members: impl IntoIterator<Item = &'a (String, Vec<u8>)>) -> Vec<u8> {
    let mut tar = tar::Builder::new(Vec::new());
    for (name, bytes) in members {
        let mut header = tar::Header::new_ustar();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        // Written as it is, since the library would refuse some of the names that are tried.
        header.as_old_mut().name[..name.len()].copy_from_slice(name.as_bytes());
        header.set_cksum();
        tar.append(&header, bytes.as_slice()).unwrap();
    }
    tar.into_inner().unwrap()
}

/// The link of an event after the one with the link `before`.
fn link(before: &[u8], event: &v1::LoggedEvent) -> Vec<u8> {
    let has_request_id = [u8::from(event.request_id.is_some())];
    hash(
        "palpate event 1",
        &[
            before,
            &event.seq.to_le_bytes(),
            &has_request_id,
            event.request_id.as_deref().unwrap_or_default().as_bytes(),
            &event.request_digest,
            event.kind.as_bytes(),
            &event.payload,
            &event.reply,
            event.state_hash.as_bytes(),
            &event.stats_after,
            event.algorithm_version.as_bytes(),
            &event.append_us.to_le_bytes(),
            event.actor.as_bytes(),
        ],
    )
}

fn hash(what: &str, fields: &[&[u8]]) -> Vec<u8> {
    let mut hash = Sha256::new();
    for field in [what.as_bytes()].iter().chain(fields) {
        hash.update((field.len() as u64).to_le_bytes());
        hash.update(field);
    }
    hash.finalize().to_vec()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
