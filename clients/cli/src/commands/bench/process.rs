//! A server in a process of its own, so that what it takes can be told from what the robots take.

use std::ffi::{OsStr, OsString};
use std::net::{Ipv4Addr, TcpListener};
use std::process::Stdio;
use std::time::Duration;

use palpate_client::Client;
use tempfile::TempDir;
use tokio::process::{Child, Command};
use tokio::time::{Instant, sleep};

use crate::failure::Failure;

/// How long a server may take to begin.
const BEGIN: Duration = Duration::from_secs(20);
const LOOK_AGAIN: Duration = Duration::from_millis(50);
/// Linux counts a process's time in these, whatever the kernel's own.
const TICKS_PER_S: f64 = 100.0;

/// A server that ends with this.
#[derive(Debug)]
pub(super) struct ServerProcess {
    /// Where it is reached.
    pub(super) url: String,
    child: Child,
    /// Of its database, unless that was there before.
    _folder: Option<TempDir>,
}

impl ServerProcess {
    /// Starts this program's own server, over a database of its own or the one at an address.
    ///
    /// # Errors
    /// It does not begin.
    pub(super) async fn start(address: Option<&OsStr>) -> Result<Self, Failure> {
        let folder = if address.is_none() { Some(tempfile::tempdir()?) } else { None };
        let file = folder.as_ref().map(|folder| folder.path().join("palpate.db").into());
        let database: OsString = file.or(address.map(OsStr::to_owned)).unwrap_or_default();
        let address = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()?;
        let mut child = Command::new(std::env::current_exe()?)
            .args(["serve", "--log", "error", "--listen", &address.to_string()])
            // An argument would show a password to whoever lists processes.
            .env("PALPATE_DATABASE", database)
            .env_remove("PALPATE_DATABASE_FILE")
            .stdin(Stdio::null())
            .kill_on_drop(true)
            .spawn()?;
        let url = format!("http://{address}");
        let end = Instant::now() + BEGIN;
        while let Err(error) = Client::connect(&url).await {
            if let Some(status) = child.try_wait()? {
                return Err(format!("the server ended before it was measured: {status}").into());
            }
            if Instant::now() >= end {
                return Err(error.into());
            }
            sleep(LOOK_AGAIN).await;
        }
        Ok(Self { url, child, _folder: folder })
    }

    /// How long it has computed, on all cores together; nothing where the system does not tell.
    pub(super) fn cpu(&self) -> Option<Duration> {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id()?)).ok()?;
        cpu_of(&stat)
    }

    /// The most memory that it had at once, in bytes; nothing where the system does not tell.
    pub(super) fn peak_memory_bytes(&self) -> Option<u64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id()?)).ok()?;
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        Some(1024 * peak.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
    }
}

/// How long all processes of this name on this machine have computed, with those that they began and that have ended;
/// nothing where there are none, or the system does not tell.
pub(super) fn cpu_of_all(name: &str) -> Option<Duration> {
    let mut used = None;
    for process in std::fs::read_dir("/proc").ok()?.flatten() {
        let read = |file| std::fs::read_to_string(process.path().join(file));
        if read("comm").is_ok_and(|comm| comm.trim() == name)
            && let Some(cpu) = read("stat").ok().and_then(|stat| time(&stat, 4))
        {
            used = Some(used.unwrap_or_default() + cpu);
        }
    }
    used
}

/// The time in user and system mode of a line of `/proc/PID/stat`.
fn cpu_of(stat: &str) -> Option<Duration> {
    time(stat, 2)
}

/// The sum of the first of the four times in a line of `/proc/PID/stat`.
fn time(stat: &str, count: usize) -> Option<Duration> {
    // The program's name is in brackets and may have anything in it. The 12th and 13th field after it are its time in
    // user and system mode, the 14th and 15th that of the processes that it began and that have ended.
    let (_, fields) = stat.rsplit_once(") ")?;
    let ticks =
        fields.split(' ').skip(11).take(count).map(|field| field.parse::<f64>().ok()).sum::<Option<f64>>()?;
    Some(Duration::from_secs_f64(ticks / TICKS_PER_S))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_a_process_is_read_whatever_its_name() {
        let stat = "42 (a b) c) S 1 42 42 0 -1 4194304 900 0 0 0 150 50 7 8 20 0 9 0 100 1000 200";
        assert_eq!(cpu_of(stat), Some(Duration::from_secs(2)));
        assert_eq!(time(stat, 4), Some(Duration::from_millis(2150)), "and of its children");
    }
}
