//! The database: its pages, tables and chains, what its witness says, and who may read its files.

use std::path::{Path, PathBuf};

use bytesize::ByteSize;
use palpate_server::{Inspection, Proof, Witnessed};

use super::finding::Findings;
use crate::commands::backup::{contents, newest};
use crate::terminal::counted;

const RESTORE: &str =
    "restore a copy with `palpate restore`, or save what can be read with `sqlite3 FILE .recover`";

/// What an inspection of `path` says.
pub(super) fn report(path: &Path, found: &Inspection, findings: &mut Findings) {
    let size = found.files.first().map_or(0, |(_, bytes)| *bytes);
    let held = if found.is_held { "a server holds it" } else { "no server holds it" };
    if let Some(why) = &found.unreadable {
        findings.problem("database", format!("{} cannot be read: {why}", path.display()), RESTORE);
        return;
    }
    findings.ok(
        "database",
        format!("{}, {}, SQLite {}; {held}", path.display(), ByteSize::b(size), found.sqlite),
    );
    migrations(found, findings);
    if let Some(damage) = &found.damage {
        findings.problem("pages", damage.clone(), RESTORE);
    } else if found.proof.is_some() {
        findings.ok("pages", "pages, indices and tables are as they should be");
    }
    if let Some(proof) = &found.proof {
        chain(proof, findings);
    }
    witness(found, findings);
    match &found.checkpoints {
        Some(Ok(())) => findings.ok("checkpoints", "the file that sessions open from quickly can be read"),
        Some(Err(why)) => findings.warn(
            "checkpoints",
            format!("the file that sessions open from quickly cannot be read: {why}"),
            "delete it while no server runs: it is made again",
        ),
        None => findings.ok("checkpoints", "there are none yet: sessions are folded when they are opened"),
    }
}

fn migrations(found: &Inspection, findings: &mut Findings) {
    if !found.unknown_migrations.is_empty() {
        findings.problem(
            "tables",
            "they are of a newer version of palpate than this program",
            "use the program that wrote them, or a newer one; what follows from the tables was not looked at",
        );
    } else if !found.pending_migrations.is_empty() {
        let pending = found.pending_migrations.join(", ");
        findings.warn(
            "tables",
            format!("they are of an earlier version; {pending} will be added"),
            "make a copy with the earlier program, then start this one, which brings them up to date",
        );
    }
}

/// What the links of the sessions say.
pub(super) fn chain(proof: &Proof, findings: &mut Findings) {
    for (session_id, reason) in &proof.broken {
        findings.problem(
            "chain",
            format!("the log of session {session_id} does not prove itself: {reason}"),
            "keep all copies; a running server quarantines the session and serves what is sound of it",
        );
    }
    for (session_id, reason) in &proof.quarantined {
        findings.warn(
            "chain",
            format!("session {session_id} is quarantined: {reason}"),
            "export what is sound of it, restore a copy, or delete it",
        );
    }
    if proof.broken.is_empty() {
        findings.ok("chain", format!("{}, all links followed; {}", contents(proof), newest(proof)));
    }
}

fn witness(found: &Inspection, findings: &mut Findings) {
    match found.witness {
        Witnessed::Missing(0) => findings.ok("witness", "no acknowledged event is missing"),
        Witnessed::Missing(events) => {
            let events = counted(usize::try_from(events).unwrap_or(0), "event", "events");
            findings.problem(
                "witness",
                format!("{events} that robots were told to be stored are not in the database"),
                "the database or the -wal beside it was cut or put back: look for the original before a server starts",
            );
        }
        Witnessed::Another => findings.warn(
            "witness",
            "it is of another database, so what is missing cannot be told",
            "put databases back with `palpate restore`, which takes care of the witness",
        ),
        Witnessed::Nothing => findings.warn(
            "witness",
            "there is none, so what is missing cannot be told",
            "a server makes one when it starts",
        ),
    }
    if found.missing > 0 {
        findings.warn(
            "witness",
            format!("{} acknowledged events were missing at an earlier start", found.missing),
            "compare with a copy from before; the number stays as a reminder",
        );
    }
}

/// Who owns the files of a database and may read them.
#[cfg(unix)]
pub(super) fn permissions(files: &[(PathBuf, u64)], findings: &mut Findings) {
    use std::os::unix::fs::MetadataExt;
    let seen: Vec<_> = files
        .iter()
        .filter_map(|(path, _)| {
            std::fs::metadata(path).ok().map(|metadata| (path, metadata.uid(), metadata.mode()))
        })
        .collect();
    let Some((_, owner, _)) = seen.first() else { return };
    let mut is_well = true;
    for (path, uid, mode) in &seen {
        if uid != owner {
            is_well = false;
            findings.problem(
                "permissions",
                format!("{} belongs to user {uid}, the database to user {owner}", path.display()),
                "chown it to the user that the server runs as",
            );
        }
        if mode & 0o077 != 0 {
            is_well = false;
            findings.warn(
                "permissions",
                format!("{} can be used by others (mode {:03o})", path.display(), mode & 0o777),
                "chmod 600 it, unless that is meant",
            );
        }
    }
    let me = rustix::process::geteuid();
    if !me.is_root() && me.as_raw() != *owner {
        is_well = false;
        findings.warn(
            "permissions",
            format!("the database belongs to user {owner}, and this command runs as {}", me.as_raw()),
            "run it as the user that the server runs as, so that it sees what the server sees",
        );
    }
    if is_well {
        findings.ok("permissions", format!("all files belong to user {owner} alone"));
    }
}

#[cfg(not(unix))]
pub(super) fn permissions(_: &[(PathBuf, u64)], _: &mut Findings) {}
