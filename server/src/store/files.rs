//! The files of the log: held by one server, readable by their owner only, and still the ones that were opened.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Makes the database file for its owner only, where there is none; SQLite gives the files beside it the same rights.
///
/// # Errors
/// It cannot be made.
pub(super) fn create_private(path: &Path) -> io::Result<()> {
    match private().create_new(true).open(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
        other => other.map(drop),
    }
}

/// The file at `path`, made for its owner only where there is none, and locked until it is dropped or the process
/// dies; nothing where another process holds it.
///
/// # Errors
/// It cannot be opened or locked.
pub(super) fn lock(path: &Path) -> io::Result<Option<File>> {
    let file = private().create(true).truncate(false).open(path)?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

fn private() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

/// A path with something added to its file's name, as SQLite names the files beside a database.
pub(super) fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    name.into()
}

/// The room that is left for its owner on the disk of a file, if the system tells.
#[cfg(unix)]
pub(super) fn free_bytes(path: &Path) -> Option<u64> {
    let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

#[cfg(not(unix))]
pub(super) fn free_bytes(_: &Path) -> Option<u64> {
    None
}

/// Bytes of a file that are read at once.
const READ_AT_ONCE: usize = 1 << 20;

/// Reads the database and its log of changes from end to end: SQLite says that a file is damaged where the disk does
/// not read it, and only the disk itself tells the one from the other.
///
/// # Errors
/// The disk does not read one of them. A file that cannot be opened has nothing to say here.
pub(super) fn read_through(database: &Path) -> io::Result<()> {
    let mut bytes = vec![0; READ_AT_ONCE];
    for path in [database.to_owned(), beside(database, "-wal")] {
        let Ok(mut file) = File::open(&path) else { continue };
        while file.read(&mut bytes)? > 0 {}
    }
    Ok(())
}

/// The files as they were opened: SQLite goes on writing into files that were deleted or replaced, as if nothing had
/// happened.
#[derive(Debug)]
pub(super) struct OpenedFiles {
    files: Vec<(PathBuf, Identity)>,
}

/// Which file it is, whatever its name.
type Identity = (u64, u64);

impl OpenedFiles {
    /// The database and its log of changes, which is there once something was written.
    ///
    /// # Errors
    /// One of them is not there.
    pub(super) fn of(database: &Path) -> io::Result<Self> {
        let identified = |path: PathBuf| identity(&path).map(|identity| (path, identity));
        let files = [database.to_owned(), beside(database, "-wal")].map(identified);
        Ok(Self { files: files.into_iter().collect::<io::Result<_>>()? })
    }

    /// What is wrong with them now; nothing where they are the ones that were opened.
    pub(super) fn problem(&self) -> Option<String> {
        let changed = |(path, opened): &(PathBuf, Identity)| match identity(path) {
            Ok(now) if now == *opened => None,
            Ok(_) => Some(format!("{} was replaced by another file while the server runs", path.display())),
            Err(error) => Some(format!(
                "{} was deleted or moved while the server runs ({error}): put it back, or stop the server",
                path.display()
            )),
        };
        self.files.iter().find_map(changed)
    }
}

#[cfg(unix)]
fn identity(path: &Path) -> io::Result<Identity> {
    use std::os::unix::fs::MetadataExt;
    let metadata = fs::metadata(path)?;
    Ok((metadata.dev(), metadata.ino()))
}

/// Elsewhere an open file cannot be deleted.
#[cfg(not(unix))]
fn identity(path: &Path) -> io::Result<Identity> {
    fs::metadata(path).map(|_| (0, 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_was_deleted_moved_or_replaced_is_noticed_and_one_that_came_back_is_well() {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("log.db");
        let wal = beside(&database, "-wal");
        fs::write(&database, "a").unwrap();
        fs::write(&wal, "b").unwrap();
        let opened = OpenedFiles::of(&database).unwrap();
        assert_eq!(opened.problem(), None);
        for path in [&database, &wal] {
            let away = folder.path().join("away");
            fs::rename(path, &away).unwrap();
            assert!(opened.problem().unwrap().contains("deleted or moved"));
            fs::write(path, "c").unwrap();
            assert!(opened.problem().unwrap().contains("replaced"));
            fs::rename(&away, path).unwrap();
            assert_eq!(opened.problem(), None);
        }
    }

    #[cfg(unix)]
    #[test]
    fn files_are_made_for_their_owner_only_and_held_by_one() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.db");
        create_private(&path).unwrap();
        create_private(&path).unwrap();
        let held = folder.path().join("held");
        let first = lock(&held).unwrap().unwrap();
        for path in [&path, &held] {
            assert_eq!(fs::metadata(path).unwrap().permissions().mode() & 0o777, 0o600);
        }
        assert!(lock(&held).unwrap().is_none());
        drop(first);
        assert!(lock(&held).unwrap().is_some());
    }
}
