//! Puts a copy of the log in the place of a log, which is kept aside.
//!
//! ```text
//! lock --> copied beside --> brought up to date --> every link checked --> old files aside --> in place --> witness
//! ```
//! The witness knows how many events were acknowledged. What it or the log that was here has more than the copy is
//! told to whoever restores, and the witness then goes on from the copy: the next start finds nothing missing.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use sqlx::migrate::MigrateError;

use super::backup::{BackupError, Hear, Partial, Progress, check_open, sync_folder};
use super::engine::{Connection as Engine, sql};
use super::inspection::DATABASE_FILES;
use super::open::{self, OpenError};
use super::proof::Proof;
use super::witness::{self, Testimony, Witness};
use super::{files, linking};
use crate::session::now_us;

/// Bytes that are copied between two looks at the progress.
const COPIED_AT_ONCE: u64 = 8 << 20;

/// A log that was put in place, and what became of the one before.
#[derive(Clone, Debug)]
pub struct Restored {
    /// What its sessions turned out to be.
    pub proof: Proof,
    /// Where the log is now that was there before.
    pub kept: Option<PathBuf>,
    /// What that one had more.
    pub older: Older,
}

/// In what the restored log is older than the one before it, or than its witness.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Older {
    /// Sessions that are not in it.
    pub missing: Vec<String>,
    /// Sessions of which it has fewer events: how many, and how many there were.
    pub shorter: Vec<(String, i64, i64)>,
    /// Events that were acknowledged after the copy was taken, by the witness; nothing where it is of another log.
    pub events: Option<i64>,
}

impl Older {
    /// Whether it lacks nothing.
    pub fn is_nothing(&self) -> bool {
        self.missing.is_empty() && self.shorter.is_empty() && self.events.is_none_or(|events| events <= 0)
    }
}

/// Puts the copy `from` in the place of `database`; `replace` allows that there is a log already.
///
/// # Errors
/// A server holds the log, there is one and it is not to be replaced, or the copy does not prove itself.
pub async fn restore(
    from: &Path,
    database: &Path,
    replace: bool,
    hear: Hear<'_>,
) -> Result<Restored, BackupError> {
    if !from.is_file() {
        return Err(BackupError::Missing { path: from.into() });
    }
    if fs::metadata(files::beside(from, "-wal")).is_ok_and(|changes| changes.len() > 0) {
        return Err(BackupError::Unfinished { path: from.into() });
    }
    if database.exists() && !replace {
        return Err(BackupError::Exists { path: database.into() });
    }
    let witness = open::held(database).await.map_err(BackupError::file(database))?;
    let witness = witness.ok_or_else(|| OpenError::InUse { path: database.into() })?;
    let restored = restore_held(from, database, &witness, hear).await;
    if restored.is_err() {
        witness.remove_if_new();
    }
    restored
}

async fn restore_held(
    from: &Path,
    database: &Path,
    witness: &Witness,
    hear: Hear<'_>,
) -> Result<Restored, BackupError> {
    let partial = Partial::beside(database)?;
    copy(from, &partial, hear).map_err(BackupError::file(from))?;
    let connection = open::writer(&partial.path).await.map_err(|error| match error {
        OpenError::Migrate(MigrateError::VersionMissing(_)) => BackupError::Newer { path: from.into() },
        OpenError::Open { source, .. } => OpenError::Open { path: from.into(), source }.into(),
        other => other.into(),
    })?;
    let mut connection = Engine::Sqlite(connection);
    linking::link_all(&mut connection).await?;
    connection.close().await?;
    let connection = open::writer(&partial.path).await?;
    let (proof, mut connection) = check_open(connection, from, hear).await?;
    if let Some((session_id, reason)) = proof.broken.first().cloned() {
        return Err(BackupError::Broken { path: from.into(), session_id, reason });
    }
    let query = sql("select identity, appended from log");
    let said: Option<(String, i64)> = query.optional(&mut connection).await?;
    let (identity, appended) = said.ok_or(sqlx::Error::RowNotFound)?;
    let mut older = compared(&heads(&mut connection).await?, database).await;
    connection.close().await?;
    let said = witness.read().map_err(BackupError::file(witness.path()))?;
    older.events = said.filter(|said| said.identity == identity).map(|said| said.appended - appended);

    let kept = set_aside(database)?;
    partial.put_at(database)?;
    witness.rewrite(&Testimony { identity, appended }).map_err(BackupError::file(witness.path()))?;
    Ok(Restored { proof, kept, older })
}

fn copy(from: &Path, to: &Partial, hear: Hear<'_>) -> std::io::Result<()> {
    use std::io::Read;
    let mut source = File::open(from)?;
    let bytes = source.metadata()?.len();
    let mut target = File::options().write(true).open(&to.path)?;
    while std::io::copy(&mut (&mut source).take(COPIED_AT_ONCE), &mut target)? > 0 {
        hear(Progress::Copied(to.bytes(), bytes));
    }
    target.sync_all()
}

/// Session id, creation and last event of each session.
async fn heads(connection: &mut Engine) -> Result<Vec<(String, i64, i64)>, sqlx::Error> {
    sql("select session_id, created_us, head from sessions order by created_us, session_id")
        .all(connection)
        .await
}

/// What the log that is here has more; nothing where there is none that can be read.
async fn compared(restored: &[(String, i64, i64)], database: &Path) -> Older {
    let mut older = Older::default();
    if !database.is_file() {
        return older;
    }
    let Ok(connection) = open::reader(database).await else { return older };
    let mut connection = Engine::Sqlite(connection);
    let here = heads(&mut connection).await.unwrap_or_default();
    // Only reading ends.
    let _ = connection.close().await;
    for (session_id, created_us, head) in here {
        let same = restored.iter().find(|(id, created, _)| (id, *created) == (&session_id, created_us));
        match same {
            None => older.missing.push(session_id),
            Some((_, _, restored)) if *restored < head => older.shorter.push((session_id, *restored, head)),
            Some(_) => {}
        }
    }
    older
}

/// Keeps the log and what belongs to it under another name, and says which.
///
/// The database itself stays until the copy takes its place, so that at no moment a start would find none and begin
/// anew; its log of changes goes first, as it fits no other database. The witness is held, and is copied.
fn set_aside(database: &Path) -> Result<Option<PathBuf>, BackupError> {
    let aside = files::beside(database, &format!(".before-{}", now_us() / 1_000_000));
    let is_there = database.exists();
    for ending in DATABASE_FILES {
        let (here, there) = (files::beside(database, ending), files::beside(&aside, ending));
        let kept = match ending {
            "" => fs::hard_link(&here, &there).or_else(|_| fs::copy(&here, &there).map(drop)),
            witness::ENDING if is_there => fs::copy(&here, &there).map(drop),
            witness::ENDING => Ok(()),
            _ => fs::rename(&here, &there),
        };
        match kept {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(BackupError::file(&here)(error));
            }
            _ => {}
        }
    }
    sync_folder(database).map_err(BackupError::file(database))?;
    Ok(is_there.then_some(aside))
}
