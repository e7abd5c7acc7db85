//! `palpate restore`: a copy of the database in the place of a database.

use std::path::PathBuf;

use palpate_server::{Older, restore};

use super::backup::{contents, newest};
use super::database::DatabaseArgs;
use crate::failure::Failure;
use crate::progress::CopyProgress;
use crate::terminal::{counted, say, warn};
use crate::writable;

pub(super) const ABOUT: &str = "\
Puts a copy that `palpate backup` wrote in the place of a database, after all of it was checked. No server may hold \
the database meanwhile. A database that is there is kept beside it, under another name, and what it had more than the \
copy is told.

For instance: palpate restore --from /backup/palpate-monday.db --database palpate.db";

/// Sessions that are told by name.
const TOLD: usize = 5;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The copy.
    #[arg(long, value_name = "FILE")]
    from: PathBuf,

    #[command(flatten)]
    database: DatabaseArgs,

    /// Put it in the place of a database that exists, which is kept under another name.
    #[arg(long)]
    replace: bool,
}

/// Restores, and says what is older now; not to be interrupted between the two files.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let Args { from, database, replace } = args;
    let database = database.file("`palpate migrate --from copy.db --to ADDRESS` brings a copy there")?;
    writable::check("--database", &database)?;
    if database.exists() && !replace {
        let text = format!(
            "--database {}: is there already. Restore to another name, or add --replace, which keeps it aside.",
            database.display()
        );
        return Err(text.into());
    }
    let progress = CopyProgress::new()?;
    let restored = restore(&from, &database, replace, &|step| progress.show(step)).await?;
    progress.finish();
    let proof = &restored.proof;
    say(format_args!("{}: {}; {}", database.display(), contents(proof), newest(proof)))?;
    for (session_id, reason) in &proof.quarantined {
        warn(format_args!("session {session_id} is quarantined in it: {reason}"));
    }
    for line in lines(&restored.older) {
        say(line)?;
    }
    match &restored.kept {
        Some(kept) => say(format_args!("What was here is kept as {}", kept.display())),
        None => Ok(()),
    }
}

/// In what it is older than what was here.
fn lines(older: &Older) -> Vec<String> {
    let Older { missing, shorter, events } = older;
    let mut lines = Vec::new();
    let named = |all: Vec<String>| {
        let more = all.len().saturating_sub(TOLD);
        let named = all.into_iter().take(TOLD).collect::<Vec<_>>().join(", ");
        if more == 0 { named } else { format!("{named} and {more} more") }
    };
    if let Some(events) = events.filter(|events| *events > 0) {
        let events = counted(usize::try_from(events).unwrap_or(0), "event that was", "events that were");
        lines.push(format!("It is older than what was here: {events} acknowledged after it was taken."));
    }
    if !missing.is_empty() {
        let sessions = counted(missing.len(), "session is", "sessions are");
        lines.push(format!("{sessions} not in it: {}.", named(missing.clone())));
    }
    if !shorter.is_empty() {
        let sessions = counted(shorter.len(), "session has", "sessions have");
        let each = shorter.iter().map(|(id, is, was)| format!("{id} {is} of {was}")).collect();
        lines.push(format!("{sessions} fewer events: {}.", named(each)));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_older_is_told_in_a_few_lines() {
        assert!(lines(&Older::default()).is_empty());
        let older = Older {
            missing: (0..7).map(|n| format!("mug-{n}")).collect(),
            shorter: vec![("pot".to_owned(), 17, 25)],
            events: Some(9),
        };
        assert_eq!(
            lines(&older),
            [
                "It is older than what was here: 9 events that were acknowledged after it was taken.",
                "7 sessions are not in it: mug-0, mug-1, mug-2, mug-3, mug-4 and 2 more.",
                "1 session has fewer events: pot 17 of 25.",
            ]
        );
    }
}
