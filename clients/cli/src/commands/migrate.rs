//! `palpate migrate`: all sessions from one database to another, of SQLite or PostgreSQL.

use std::ffi::OsString;

use palpate_server::{Migrated, migrate};

use super::backup::{contents, newest};
use super::database::{check_writable, location};
use crate::failure::{Ended, Failure};
use crate::progress::CopyProgress;
use crate::terminal::{counted, say, warn};

pub(super) const ABOUT: &str = "\
Brings all sessions, with their whole history, and all tokens from one database to another: from a file of SQLite to \
PostgreSQL, back, or between two of the same kind. Of the source only the tables of an earlier version are changed, \
which are brought up to date. Each session is written at once, and afterwards all links of the target are followed.

An interrupted command goes on where it was when it is given again, and what was appended to the source since is \
brought over, too: so a large log is moved while servers run, and the rest of it, in moments, after they are stopped.

Whoever lists processes sees the addresses: leave a password out of them, and into ~/.pgpass or PGPASSWORD.

For instance: palpate migrate --from palpate.db --to postgres://palpate@db.lab/palpate";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The database to read: a file or an address of PostgreSQL.
    #[arg(long, value_name = "FILE|ADDRESS")]
    from: OsString,

    /// The database to write: a file, which is made where it does not exist, or an address of PostgreSQL.
    #[arg(long, value_name = "FILE|ADDRESS")]
    to: OsString,
}

/// Moves, and says what was moved.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let (from, to) = (location(&args.from)?, location(&args.to)?);
    check_writable("--to", &to)?;
    let progress = CopyProgress::in_events()?;
    let show = |step| progress.show(step);
    let moved = tokio::select! {
        moved = migrate(&from, &to, &show) => moved?,
        interrupted = tokio::signal::ctrl_c() => {
            interrupted?;
            return Err(Ended::Interrupted("interrupted: the same command goes on from here".to_owned()).into());
        }
    };
    progress.finish();
    let Migrated { sessions, there_already, events, proof } = &moved;
    let counted = |count: u64, one, many| counted(usize::try_from(count).unwrap_or(usize::MAX), one, many);
    say(format_args!(
        "{} written of {}, {there_already} of which were there already",
        counted(*events, "event", "events"),
        counted(*sessions, "session", "sessions"),
    ))?;
    say(format_args!("{to}: {}, all links followed; {}", contents(proof), newest(proof)))?;
    for (session_id, reason) in &proof.quarantined {
        warn(format_args!("session {session_id} is quarantined there: {reason}"));
    }
    match proof.broken.first() {
        None => Ok(()),
        Some((session_id, reason)) => {
            Err(format!("the log of session {session_id:?} does not prove itself in {to}: {reason}").into())
        }
    }
}
