//! A database on PostgreSQL: whether it can be reached, keeps what is acknowledged, and what its sessions are.

use bytesize::ByteSize;
use palpate_server::{Address, Limits, SharedInspection};

use super::database::chain;
use super::finding::Findings;
use crate::terminal::counted;

/// What an inspection of the database at `address` says.
pub(super) fn report(address: &Address, found: &SharedInspection, limits: &Limits, findings: &mut Findings) {
    if let Some(why) = &found.unreadable {
        let advice =
            "does PostgreSQL run there, and may this user come in? psql with the same address tells more";
        findings.problem("database", format!("{address} cannot be read: {why}"), advice);
        return;
    }
    let bytes = found.bytes.and_then(|bytes| u64::try_from(bytes).ok());
    let size = bytes.map(|bytes| format!(", {}", ByteSize::b(bytes))).unwrap_or_default();
    findings.ok("database", format!("{address}{size}, PostgreSQL {}", found.version));
    if bytes.is_some_and(|bytes| bytes >= limits.database_bytes) {
        findings.problem(
            "disk",
            "the database has all that the limit database_bytes allows",
            "delete sessions that are exported, or raise the limit",
        );
    }
    durability(found, findings);
    if !found.is_encrypted {
        findings.warn(
            "encryption",
            "what goes to the database can be read on its way",
            "add ?sslmode=verify-full&sslrootcert=FILE to the address, unless it is on this machine",
        );
    }
    tables(found, findings);
    if let Some(proof) = &found.proof {
        chain(proof, findings);
    }
}

fn durability(found: &SharedInspection, findings: &mut Findings) {
    let setting = |name: &str| {
        found.settings.iter().find(|(known, _)| *known == name).map_or("", |(_, value)| value.as_str())
    };
    let mut is_well = true;
    for name in ["fsync", "full_page_writes"] {
        if setting(name) == "off" {
            is_well = false;
            let advice = "set it to on in postgresql.conf: a server does not start on this database";
            findings.problem("durability", format!("{name} is off"), advice);
        }
    }
    let mode = setting("synchronous_commit");
    if !matches!(mode, "on" | "remote_apply" | "") {
        is_well = false;
        let advice = "servers set it to on for themselves; set it for the role, so that others see the same";
        findings.warn("durability", format!("synchronous_commit is {mode}"), advice);
    }
    if found.standbys > 0 && found.waited_for == 0 {
        is_well = false;
        findings.warn(
            "durability",
            "no commit waits for a standby: a failover may lose touches that were acknowledged",
            "set synchronous_standby_names",
        );
    }
    if is_well {
        let standbys = usize::try_from(found.waited_for).unwrap_or(0);
        let standbys = counted(standbys, "standby", "standbys");
        findings.ok(
            "durability",
            format!("a commit is on disk when it is acknowledged, and waits for {standbys}"),
        );
    }
}

fn tables(found: &SharedInspection, findings: &mut Findings) {
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
            format!("they are of an earlier version, or not there; {pending} will be added"),
            "a server adds them when it starts",
        );
    } else {
        findings.ok("tables", "they are those of this version");
    }
}
