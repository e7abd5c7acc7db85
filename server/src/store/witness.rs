//! A witness beside the database: how many events were acknowledged, in a small file of its own.
//!
//! SQLite drops what cannot be read at the end of its log of changes without a word, and the database then looks
//! sound. The witness is written and synced after each commit and before anything is acknowledged, so that a start
//! can say how many events are missing. Its lock also keeps a second server from the same file.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use sha2::{Digest, Sha256};

use super::files;

/// Two places are written in turn, so that one is whole whatever happens to the other.
const PLACE_BYTES: usize = 256;
/// What the name of the database gets.
pub(super) const ENDING: &str = "-witness";

/// The open and locked file.
#[derive(Debug)]
pub(super) struct Witness {
    path: PathBuf,
    file: Mutex<File>,
}

/// What it says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Testimony {
    /// Of which log.
    pub(super) identity: String,
    /// How many events it has had.
    pub(super) appended: i64,
}

impl Witness {
    /// Opens and locks the file beside the database; nothing where another process holds it.
    ///
    /// # Errors
    /// The file cannot be opened or locked.
    pub(super) fn open(database: &Path) -> io::Result<Option<Self>> {
        let path = files::beside(database, ENDING);
        let file = files::lock(&path)?;
        Ok(file.map(|file| Self { path, file: Mutex::new(file) }))
    }

    /// Opens the file without the lock.
    #[cfg(test)]
    pub(super) fn beside(database: &Path) -> Self {
        let path = files::beside(database, ENDING);
        let file = File::options().read(true).write(true).create(true).truncate(false).open(&path).unwrap();
        Self { path, file: Mutex::new(file) }
    }

    /// Removes the file where it says nothing: the log beside it could not be opened.
    pub(super) fn remove_if_new(&self) {
        if let Ok(None) = self.read() {
            // What cannot be removed is empty and does no harm.
            let _ = std::fs::remove_file(&self.path);
        }
    }

    /// Where it is.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// What was written last; nothing where nothing was, or nothing of it can be read.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn read(&self) -> io::Result<Option<Testimony>> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(0))?;
        (&mut *file).take(2 * PLACE_BYTES as u64).read_to_end(&mut bytes)?;
        Ok(testimony(&bytes))
    }

    /// Writes and syncs what is acknowledged.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn write(&self, testimony: &Testimony) -> io::Result<()> {
        let Testimony { identity, appended } = testimony;
        let mut line = format!("palpate-witness 1 {identity} {appended}");
        line = format!("{line} {}", checksum(&line));
        let place = format!("{line:<width$}\n", width = PLACE_BYTES - 1);
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(appended.rem_euclid(2) as u64 * PLACE_BYTES as u64))?;
        file.write_all(place.as_bytes())?;
        file.sync_data()
    }

    /// Forgets all that was said before, when it is about another log or less.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn rewrite(&self, testimony: &Testimony) -> io::Result<()> {
        self.file.lock().unwrap_or_else(PoisonError::into_inner).set_len(0)?;
        self.write(testimony)
    }
}

/// What a file says that was read.
pub(super) fn testimony(bytes: &[u8]) -> Option<Testimony> {
    bytes.chunks(PLACE_BYTES).filter_map(parse).max_by_key(|testimony| testimony.appended)
}

fn parse(place: &[u8]) -> Option<Testimony> {
    let line = std::str::from_utf8(place).ok()?.trim_matches(['\0', ' ', '\n']);
    let (said, sum) = line.rsplit_once(' ')?;
    let [_, _, identity, appended] = said.split(' ').collect::<Vec<_>>()[..] else { return None };
    let appended = appended.parse().ok()?;
    (checksum(said) == sum).then(|| Testimony { identity: identity.to_owned(), appended })
}

fn checksum(line: &str) -> String {
    Sha256::digest(line)[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(appended: i64) -> Testimony {
        Testimony { identity: "a-log".into(), appended }
    }

    #[test]
    fn what_was_written_last_is_read_and_a_torn_write_leaves_what_was_written_before() {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("log.db");
        let witness = Witness::open(&database).unwrap().unwrap();
        assert_eq!(witness.read().unwrap(), None);
        assert!(Witness::open(&database).unwrap().is_none(), "it is held");
        for appended in [1, 2, 3, 7, 8] {
            witness.write(&said(appended)).unwrap();
            assert_eq!(witness.read().unwrap(), Some(said(appended)));
        }
        let path = witness.path().to_owned();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[40] ^= 1; // the place of the even numbers
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(witness.read().unwrap(), Some(said(7)));
        witness.rewrite(&said(2)).unwrap();
        assert_eq!(witness.read().unwrap(), Some(said(2)));
    }

    #[test]
    fn a_file_of_something_else_says_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("log.db");
        std::fs::write(files::beside(&database, ENDING), vec![0xff; 5000]).unwrap();
        assert_eq!(Witness::open(&database).unwrap().unwrap().read().unwrap(), None);
    }
}
