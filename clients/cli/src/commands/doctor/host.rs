//! The program and the machine: versions, room on the disk, the clock, limits and open files.

use std::path::PathBuf;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use bytesize::ByteSize;
use palpate_server::{Limits, Proof};

use super::finding::Findings;
use crate::failure::Failure;
use crate::limits::written;
use crate::version::VERSION;

/// With less room than this a busy server is soon out of it, in bytes.
const LITTLE_ROOM: u64 = 256 << 20;
const SOME_ROOM: u64 = 2 << 30;
/// A log of changes that is larger is not being taken over into the database, in bytes.
const LARGE_WAL: u64 = 256 << 20;
/// Before this moment no clock has ever stood right when this was written: 2025-01-01.
const EARLIEST: Duration = Duration::from_secs(1_735_689_600);
/// Clocks may differ by this much.
const SKEW: Duration = Duration::from_secs(2);
/// Files that a server keeps for itself, beside one for each connection.
const OWN_FILES: u64 = 64;

/// Which program this is.
pub(super) fn program(findings: &mut Findings) {
    let built = if cfg!(debug_assertions) { ", a debug build" } else { "" };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    findings.ok("program", format!("palpate {}{built}, on {cores} cores", *VERSION));
}

/// Whether there is room for what is to come, a copy among it.
pub(super) fn disk(free: Option<u64>, files: &[(PathBuf, u64)], limits: &Limits, findings: &mut Findings) {
    let size = |ending: &str| {
        let is_it = |path: &&(PathBuf, u64)| path.0.as_os_str().to_string_lossy().ends_with(ending);
        files.iter().find(is_it).map_or(0, |(_, bytes)| *bytes)
    };
    let (database, wal) = (files.first().map_or(0, |(_, bytes)| *bytes), size("-wal"));
    if wal > LARGE_WAL {
        findings.warn(
            "wal",
            format!("the log of changes beside the database has {}", ByteSize::b(wal)),
            "something reads the database for very long, such as a copy that hangs: end it",
        );
    }
    if database >= limits.database_bytes {
        findings.problem(
            "disk",
            format!("the database has {}, all that the limit database_bytes allows", ByteSize::b(database)),
            "delete sessions that are exported, or raise the limit",
        );
    }
    let Some(free) = free else { return };
    let left = format!("{} are free where the database is", ByteSize::b(free));
    if free < LITTLE_ROOM {
        findings.problem("disk", left, "make room now: a full disk refuses robots, and loses nothing");
    } else if free < SOME_ROOM {
        findings.warn("disk", left, "make room soon");
    } else if free < database {
        findings.warn("disk", left, "a copy of the database would not fit there: back up to another disk");
    } else {
        findings.ok("disk", left);
    }
}

/// Whether the clock can be right, by what is in the log.
pub(super) fn clock(proof: Option<&Proof>, findings: &mut Findings) {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let newest = proof.map_or(0, |proof| u64::try_from(proof.newest_us).unwrap_or(0));
    let newest = Duration::from_micros(newest);
    let shown = humantime::format_rfc3339_seconds(UNIX_EPOCH + now);
    if now < EARLIEST {
        findings.problem("clock", format!("it says {shown}"), "set it, and keep it right with NTP");
    } else if newest > now + SKEW {
        let ahead = humantime::format_duration(Duration::from_secs((newest - now).as_secs()));
        findings.problem(
            "clock",
            format!("it says {shown}, but the newest event is {ahead} later"),
            "set it, and keep it right with NTP: new events go on from the newest one meanwhile",
        );
    } else {
        findings.ok("clock", format!("it says {shown}, not before the newest event"));
    }
}

/// Which limits are not the defaults.
pub(super) fn limits(limits: &Limits, findings: &mut Findings) -> Result<(), Failure> {
    let (ours, defaults) = (written(limits)?, written(&Limits::default())?);
    let differ = ours.iter().zip(&defaults).filter(|(ours, default)| ours != default);
    let named: Vec<String> = differ.map(|((name, value), _)| format!("{name} = {value}")).collect();
    findings.ok(
        "limits",
        if named.is_empty() {
            "all are the defaults".to_owned()
        } else {
            format!("set: {}", named.join(", "))
        },
    );
    Ok(())
}

/// Whether as many connections can be open as are allowed.
#[cfg(unix)]
pub(super) fn open_files(limits: &Limits, findings: &mut Findings) {
    let Some(files) = rustix::process::getrlimit(rustix::process::Resource::Nofile).current else {
        findings.ok("open files", "as many as one likes");
        return;
    };
    let wanted = limits.connections as u64 + OWN_FILES;
    if files < wanted {
        findings.warn(
            "open files",
            format!("{files} from this shell, for {} connections", limits.connections),
            "raise it for the server (ulimit -n, LimitNOFILE), or it takes fewer connections",
        );
    } else {
        findings.ok(
            "open files",
            format!("{files} from this shell, enough for {} connections", limits.connections),
        );
    }
}

#[cfg(not(unix))]
pub(super) fn open_files(_: &Limits, _: &mut Findings) {}
