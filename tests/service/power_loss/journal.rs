//! What a server did to its disk, and what of it a loss of power leaves.
//!
//! A write is sure to survive once its file was synced after it. One that was not survives or not, each by itself, and
//! as a whole or in some of its sectors only. That a file was made or removed survives at once.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use crate::harness::Random;

/// What a disk writes as one.
const SECTOR_BYTES: usize = 512;
/// Frames of the log of changes follow its header.
const WAL_HEADER_BYTES: usize = 32;

/// The content of each file by its name.
pub(super) type Files = BTreeMap<String, Vec<u8>>;

/// Which syncs were done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Syncs {
    /// All that were asked for.
    Full,
    /// Those that SQLite asks for under `synchronous = normal`: all but the one at the end of a commit, which is the
    /// first one of the log of changes after frames were written into it. Before a checkpoint it is synced again.
    Normal,
}

/// What survives of the writes after the last sync.
#[derive(Clone, Copy, Debug)]
pub(super) enum Unsynced {
    Lost,
    Kept,
    Torn,
}

enum What {
    Write { at: usize, bytes: Range<usize> },
    Cut { length: usize },
    Sync,
    Gone,
}

struct Record {
    /// How long the journal was with it.
    end: usize,
    name: String,
    what: What,
}

/// Everything a server did to its files, in order.
pub(super) struct Journal {
    bytes: Vec<u8>,
    records: Vec<Record>,
}

impl Journal {
    /// Reads what `journal.c` wrote.
    pub(super) fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        let (mut records, mut at) = (Vec::new(), 0);
        while at < bytes.len() {
            let head = at + bytes[at..].iter().position(|&byte| byte == b'\n').unwrap();
            let line = std::str::from_utf8(&bytes[at..head]).unwrap();
            let [what, name, offset, length] = line.split(' ').collect::<Vec<_>>()[..] else {
                panic!("no record: {line}")
            };
            let (offset, length): (usize, usize) = (offset.parse().unwrap(), length.parse().unwrap());
            at = head + 1;
            let what = match what {
                "write" => {
                    let written = at..at + length;
                    at = written.end;
                    What::Write { at: offset, bytes: written }
                }
                "cut" => What::Cut { length: offset },
                "sync" => What::Sync,
                "gone" => What::Gone,
                other => panic!("no record: {other}"),
            };
            records.push(Record { end: at, name: name.to_owned(), what });
        }
        Self { bytes, records }
    }

    /// How long it is; its moments are numbered by that.
    pub(super) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// What is on the disk when it loses power at a moment, and had `before` when the journal begins.
    pub(super) fn image(
        &self,
        before: &Files,
        moment: usize,
        syncs: Syncs,
        unsynced: Unsynced,
        random: &mut Random,
    ) -> Files {
        let mut files = before.clone();
        let mut pending: BTreeMap<&str, Vec<&What>> = BTreeMap::new();
        let mut has_new_frames = false;
        for Record { name, what, .. } in self.records.iter().take_while(|record| record.end <= moment) {
            let is_wal = name.ends_with("-wal");
            match what {
                What::Gone => {
                    files.remove(name);
                    pending.remove(name.as_str());
                }
                What::Sync if is_wal && syncs == Syncs::Normal && has_new_frames => has_new_frames = false,
                What::Sync => {
                    has_new_frames &= !is_wal;
                    let file = files.entry(name.clone()).or_default();
                    for what in pending.remove(name.as_str()).unwrap_or_default() {
                        self.survive(file, what, |_| true);
                    }
                }
                What::Write { .. } | What::Cut { .. } => {
                    files.entry(name.clone()).or_default();
                    pending.entry(name).or_default().push(what);
                    has_new_frames |=
                        is_wal && matches!(what, What::Write { at, .. } if *at >= WAL_HEADER_BYTES);
                }
            }
        }
        for (name, whats) in pending {
            let file = files.entry(name.to_owned()).or_default();
            for what in whats {
                match unsynced {
                    Unsynced::Kept => self.survive(file, what, |_| true),
                    Unsynced::Torn if random.below(2) == 0 => {
                        let is_whole = random.below(2) == 0;
                        self.survive(file, what, |_| is_whole || random.below(2) == 0);
                    }
                    Unsynced::Lost | Unsynced::Torn => {}
                }
            }
        }
        files
    }

    /// Does to a file what was done, as far as its sectors survive.
    fn survive(&self, file: &mut Vec<u8>, what: &What, mut survives: impl FnMut(usize) -> bool) {
        match what {
            What::Cut { length } => file.resize(*length, 0),
            What::Write { at, bytes } => {
                let bytes = &self.bytes[bytes.clone()];
                file.resize(file.len().max(at + bytes.len()), 0);
                let mut done = 0;
                while done < bytes.len() {
                    let place = at + done;
                    let end = bytes.len().min(done + SECTOR_BYTES - place % SECTOR_BYTES);
                    if survives(place / SECTOR_BYTES) {
                        file[place..at + end].copy_from_slice(&bytes[done..end]);
                    }
                    done = end;
                }
            }
            What::Sync | What::Gone => {}
        }
    }
}
