//! A server of PostgreSQL of the test's own, which can be killed and followed by a standby.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tempfile::TempDir;
use tokio::net::TcpListener;

use super::soon;

/// What PostgreSQL runs as where the tests run as root, which it refuses.
const USER: &str = "postgres";
/// Its settings in tests: little memory, and many servers of Palpate at once.
const SETTINGS: [&str; 4] =
    ["max_connections=200", "shared_buffers=32MB", "listen_addresses=127.0.0.1", "logging_collector=off"];

const PROGRAMS: [&str; 5] = ["initdb", "pg_basebackup", "pg_ctl", "pg_isready", "postgres"];

/// A running server of PostgreSQL; killed when it is dropped.
#[derive(Debug)]
pub(crate) struct Postgres {
    data: PathBuf,
    pub(crate) port: u16,
    postmaster: std::process::Child,
}

/// Where servers of PostgreSQL keep their data, and their programs.
#[derive(Debug)]
pub(crate) struct Installation {
    folder: TempDir,
    programs: PathBuf,
}

impl Installation {
    /// PostgreSQL on this machine; where there is none the test that asks says so and has nothing to show.
    pub(crate) fn find() -> Option<Self> {
        let mut found: Vec<PathBuf> = std::fs::read_dir("/usr/lib/postgresql")
            .into_iter()
            .flatten()
            .filter_map(|entry| Some(entry.ok()?.path().join("bin")))
            .collect();
        found.sort();
        found.reverse();
        found.extend(std::env::var_os("PATH").iter().flat_map(std::env::split_paths));
        let has_all = |programs: &PathBuf| PROGRAMS.iter().all(|program| programs.join(program).is_file());
        let programs = found.into_iter().find(has_all);
        let Some(programs) = programs else {
            println!("SKIPPED: there is no PostgreSQL on this machine: apt-get install postgresql");
            return None;
        };
        let folder = tempfile::tempdir().unwrap();
        give(folder.path());
        Some(Self { folder, programs })
    }

    /// A new server with these settings more.
    pub(crate) async fn start(&self, settings: &[&str]) -> Postgres {
        let port = free_port().await;
        let data = self.folder.path().join(port.to_string());
        let auth = ["--auth=trust", "--encoding=UTF8", "--locale=C", "--username=postgres", "-D"];
        self.run("initdb", |command| command.args(auth).arg(&data)).await;
        self.begin(&data, port, settings).await
    }

    /// A standby of another server, at a port to choose, which is then what the other one waits for.
    pub(crate) async fn follow(&self, primary: &Postgres, port: u16, settings: &[&str]) -> Postgres {
        // Ports come back as the two take turns; folders do not.
        let number = std::fs::read_dir(self.folder.path()).unwrap().count();
        let data = self.folder.path().join(format!("{port}-{number}"));
        let from = format!("host=127.0.0.1 port={} user=postgres", primary.port);
        let copy = ["--checkpoint=fast", "--wal-method=stream", "--write-recovery-conf", "-d", &from, "-D"];
        self.run("pg_basebackup", |command| command.args(copy).arg(&data)).await;
        self.begin(&data, port, settings).await
    }

    /// Makes a standby the one that takes writes.
    pub(crate) async fn promote(&self, standby: &Postgres) {
        let data = standby.data.clone();
        self.run("pg_ctl", |command| command.args(["promote", "-w", "-D"]).arg(&data)).await;
    }

    /// The server whose data these are, again.
    pub(crate) async fn begin(&self, data: &Path, port: u16, settings: &[&str]) -> Postgres {
        let mut command = self.command("postgres");
        command.arg("-D").arg(data).arg("-p").arg(port.to_string()).arg("-k").arg(self.folder.path());
        for setting in SETTINGS.iter().chain(settings) {
            command.args(["-c", setting]);
        }
        let log = std::fs::File::options().create(true).append(true).open(self.log(port)).unwrap();
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        let postgres = Postgres { data: data.into(), port, postmaster: command.spawn().unwrap() };
        let port = port.to_string();
        let ready = async {
            let ask = ["-q", "-h", "127.0.0.1", "-p", &port, "-U", "postgres"];
            while !self.command("pg_isready").args(ask).status().unwrap().success() {
                tokio::time::sleep(std::time::Duration::from_millis(50)).await;
            }
        };
        soon("PostgreSQL", ready).await;
        postgres
    }

    /// What the server at this port has logged.
    pub(crate) fn logged(&self, port: u16) -> String {
        std::fs::read_to_string(self.log(port)).unwrap()
    }

    /// A copy of a file that PostgreSQL alone may read.
    pub(crate) fn take(&self, file: &Path) -> PathBuf {
        use std::os::unix::fs::PermissionsExt;
        let copy = self.folder.path().join(file.file_name().unwrap());
        std::fs::copy(file, &copy).unwrap();
        std::fs::set_permissions(&copy, std::fs::Permissions::from_mode(0o600)).unwrap();
        give(&copy);
        copy
    }

    fn log(&self, port: u16) -> PathBuf {
        self.folder.path().join(format!("{port}.log"))
    }

    async fn run(&self, program: &str, arguments: impl FnOnce(&mut Command) -> &mut Command) {
        let mut command = self.command(program);
        arguments(&mut command).stdin(Stdio::null());
        let ran = tokio::task::spawn_blocking(move || command.output().unwrap());
        let ran = soon(program, ran).await.unwrap();
        assert!(ran.status.success(), "{program}: {}", String::from_utf8_lossy(&ran.stderr));
    }

    fn command(&self, program: &str) -> Command {
        let path = self.programs.join(program);
        if !is_root() {
            return Command::new(path);
        }
        let mut command = Command::new("setpriv");
        command.args(["--reuid", USER, "--regid", USER, "--clear-groups"]).arg(path);
        command.current_dir("/");
        command
    }
}

impl Postgres {
    /// The address of the server, for an administrator.
    pub(crate) fn url(&self) -> String {
        format!("postgres://postgres@127.0.0.1:{}", self.port)
    }

    /// Kills all of it as a loss of power does: it has no chance to write anything.
    pub(crate) fn kill(mut self) -> PathBuf {
        self.end();
        self.data.clone()
    }

    fn end(&mut self) {
        // Those that it began end when it is gone, but perhaps not at once.
        let id = self.postmaster.id().to_string();
        let _ = Command::new("pkill").args(["-KILL", "-P", &id]).status();
        let _ = self.postmaster.kill();
        let _ = self.postmaster.wait();
    }
}

impl Drop for Postgres {
    fn drop(&mut self) {
        self.end();
    }
}

/// Gives a file or folder to the user that PostgreSQL runs as.
fn give(path: &Path) {
    if is_root() {
        let given = Command::new("chown").arg(format!("{USER}:")).arg(path).status().unwrap();
        assert!(given.success());
    }
}

fn is_root() -> bool {
    let id = Command::new("id").arg("-u").output().unwrap();
    id.stdout == b"0\n"
}

async fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").await.unwrap().local_addr().unwrap().port()
}
