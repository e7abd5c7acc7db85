//! `palpate backup`: a copy of the database, while a server runs or not.

use std::path::PathBuf;

use bytesize::ByteSize;
use palpate_server::{Proof, back_up};

use super::database::DatabaseArgs;
use crate::failure::{Ended, Failure};
use crate::progress::CopyProgress;
use crate::terminal::{counted, say, warn};
use crate::writable;

pub(super) const ABOUT: &str = "\
Copies the database into one file, while a server appends to it or not, and checks all of the copy: its pages, its \
tables and the links of every session's log.

For instance: palpate backup --database palpate.db --to /backup/palpate-monday.db";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    database: DatabaseArgs,

    /// Where the copy is written; an existing file is never overwritten.
    #[arg(long, value_name = "FILE")]
    to: PathBuf,
}

/// Copies, and says what is in the copy.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let Args { database, to } = args;
    let instead = "copy it with pg_dump, or into a file with `palpate migrate --from ADDRESS --to copy.db`";
    let database = database.file(instead)?;
    writable::check("--to", &to)?;
    let progress = CopyProgress::new()?;
    let show = |step| progress.show(step);
    let copied = tokio::select! {
        copied = back_up(&database, &to, &show) => copied?,
        interrupted = tokio::signal::ctrl_c() => {
            interrupted?;
            return Err(Ended::Interrupted("interrupted: no copy was kept".to_owned()).into());
        }
    };
    progress.finish();
    let proof = &copied.proof;
    let size = ByteSize::b(copied.bytes);
    say(format_args!("{}: {}, {size}; {}", to.display(), contents(proof), newest(proof)))?;
    told_damage(proof)
}

/// What is in a log.
pub(super) fn contents(proof: &Proof) -> String {
    let sessions = counted(usize::try_from(proof.sessions).unwrap_or(usize::MAX), "session", "sessions");
    let events = counted(usize::try_from(proof.events).unwrap_or(usize::MAX), "event", "events");
    format!("{sessions} with {events}")
}

/// Until when it goes.
pub(super) fn newest(proof: &Proof) -> String {
    let microseconds = u64::try_from(proof.newest_us).unwrap_or(0);
    if microseconds == 0 {
        return "no event yet".to_owned();
    }
    let at = std::time::UNIX_EPOCH + std::time::Duration::from_micros(microseconds);
    format!("the newest of {}", humantime::format_rfc3339_seconds(at))
}

/// Warns of sessions that are quarantined, and fails where others do not prove themselves.
fn told_damage(proof: &Proof) -> Result<(), Failure> {
    for (session_id, reason) in &proof.quarantined {
        warn(format_args!("session {session_id} is quarantined in it, as in the database: {reason}"));
    }
    let Some((session_id, reason)) = proof.broken.first() else { return Ok(()) };
    let text = format!(
        "the copy is written, but {} does not prove itself, in the database neither; the first is {session_id}: {reason}.\n\
         Keep earlier copies, and ask `palpate doctor`.",
        counted(proof.broken.len(), "session", "sessions"),
    );
    Err(text.into())
}
