//! A disk that fails or is slow under the server: nothing is acknowledged that it did not take, nothing is called
//! damaged that it only does not read, and all is well again with it.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use palpate_proto::v1;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection, SqliteConnection};
use tempfile::TempDir;

use crate::harness::ball::{contact_at, directions, plausible};
use crate::harness::{Caller, Outcome, Process, Transport, accepted, cloud, creation, prior, report, soon};

/// Error numbers of Linux.
const EIO: i32 = 5;
const ENOSPC: i32 = 28;
const EROFS: i32 = 30;

/// Compiles a library of `disk/` that stands between a server and its disk.
pub(crate) fn between(folder: &Path, name: &str) -> PathBuf {
    let library = folder.join(name).with_extension("so");
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("service/disk");
    let source = sources.join(name).with_extension("c");
    let compiled = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .arg(&library)
        .arg(source)
        .arg("-ldl")
        .status()
        .unwrap();
    assert!(compiled.success());
    library
}

/// A folder with a database, on a disk that does as it is told.
struct Disk {
    folder: TempDir,
    library: PathBuf,
}

impl Disk {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let library = between(folder.path(), "faults");
        Self { folder, library }
    }

    fn database(&self) -> PathBuf {
        self.folder.path().join("palpate.db")
    }

    fn orders(&self) -> PathBuf {
        self.folder.path().join("faults")
    }

    /// From now on the disk does as these lines say; see `faults.c`.
    fn becomes(&self, orders: &str) {
        // At once: a call sees all of the lines or none.
        let new = self.folder.path().join("orders");
        std::fs::write(&new, orders).unwrap();
        std::fs::rename(&new, self.orders()).unwrap();
    }

    fn is_well(&self) {
        std::fs::remove_file(self.orders()).unwrap();
    }

    /// Waits until something is held.
    async fn holds(&self) {
        while !self.folder.path().join("faults.held").exists() {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    fn beneath(&self, command: &mut tokio::process::Command) {
        command.env("LD_PRELOAD", &self.library).env("PALPATE_FAULTS", self.orders());
    }

    async fn serve(&self) -> Process {
        Process::serve_with(&self.database(), |command| self.beneath(command)).await
    }
}

/// What `/readyz` says, or the reason why not.
async fn ready(server: &Process) -> Result<String, String> {
    match accepted(server.http().get("/readyz")).await {
        Ok(answer) => Ok(answer.text().await.unwrap()),
        Err(refused) => Err(refused.reason),
    }
}

fn touch(session_id: &str, number: usize, request_id: &str) -> v1::ReportContactRequest {
    report(session_id, contact_at([0.0, 0.0, 1.0], 0.0, plausible(number)), request_id)
}

#[tokio::test]
async fn what_the_disk_did_not_take_is_not_acknowledged_and_all_is_well_again_with_it() {
    let disk = Disk::new();
    let server = disk.serve().await;
    server.caller(Transport::Grpc).begin("ball").await;
    let mut seq = 2;
    for (number, (operation, error, reason)) in [
        ("write", EIO, "STORE_DOWN"),
        ("sync", EIO, "STORE_DOWN"),
        ("write", ENOSPC, "STORE_FULL"),
        ("write", EROFS, "STORE_DOWN"),
    ]
    .into_iter()
    .enumerate()
    {
        for transport in Transport::BOTH {
            let caller = server.caller(transport);
            let id = format!("touch-{number}-{}", transport.name());
            let said = || touch("ball", number, &id);
            let what = format!("fail {operation} {error}");
            disk.becomes(&what);
            assert_eq!(caller.report(said()).await.unwrap_err().reason, reason, "{what}");
            assert_eq!(caller.create(creation("new")).await.unwrap_err().reason, reason, "{what}");
            assert_eq!(ready(&server).await.unwrap_err(), reason, "{what}");
            assert_eq!(caller.get("ball").await.unwrap().revision, seq, "{what}: readers go on");
            disk.is_well();
            seq += 1;
            assert_eq!(caller.report(said()).await.unwrap().seq, seq, "{what}");
            assert_eq!(ready(&server).await.unwrap(), "ready\n", "{what}");
        }
    }
    let log = server.caller(Transport::Grpc).log("ball").await;
    server.kill().await;
    let server = Process::serve(&disk.database()).await;
    let caller = server.caller(Transport::Grpc);
    assert_eq!(caller.log("ball").await, log);
    assert_eq!(log.len() as i64, seq);
    assert!(caller.get("new").await.is_err(), "what was refused is not there");
}

/// Everything that has to read the session's log, and fails as it does where the disk does not read.
async fn readings(caller: &Caller, session_id: &str) -> Vec<(&'static str, Outcome<()>)> {
    let events = v1::ListEventsRequest { session_id: session_id.into(), ..Default::default() };
    let mesh = v1::GetMeshRequest { session_id: session_id.into(), ..Default::default() };
    vec![
        ("get", caller.get(session_id).await.map(drop)),
        ("list", caller.list(v1::ListSessionsRequest::default()).await.map(drop)),
        ("events", caller.events(events).await.map(drop)),
        ("mesh", caller.mesh(mesh).await.map(drop)),
        ("report", caller.report(touch(session_id, 1, "while-unread")).await.map(drop)),
    ]
}

#[tokio::test]
async fn what_the_disk_does_not_read_is_not_damaged_and_is_served_again_with_it() {
    let disk = Disk::new();
    let server = disk.serve().await;
    let caller = server.caller(Transport::Grpc);
    for name in ["ball", "other", "third"] {
        caller.begin(name).await;
        caller.report(touch(name, 0, "first")).await.unwrap();
    }
    let (log, surface) = (caller.log("other").await, caller.vertices("other").await.1);
    server.kill().await;

    // Slow enough that all logs are still being proved when the disk reads nothing any more.
    disk.becomes("slow read 20");
    let server = disk.serve().await;
    let caller = server.caller(Transport::Grpc);
    disk.becomes(&format!("fail read {EIO}"));
    assert_eq!(ready(&server).await.unwrap_err(), "STORE_DOWN");
    disk.is_well();
    assert_eq!(ready(&server).await.unwrap(), "ready\n");

    // A write makes what the readers hold in memory stale; "ball" is in memory, the others are not.
    for (number, transport) in Transport::BOTH.into_iter().enumerate() {
        let calling = server.caller(transport);
        caller.report(touch("ball", 1, &format!("fresh-{number}"))).await.unwrap();
        disk.becomes(&format!("fail read {EIO}"));
        for (what, outcome) in readings(&calling, "other").await {
            assert_eq!(outcome.unwrap_err().reason, "STORE_DOWN", "{what}");
        }
        assert_eq!(ready(&server).await.unwrap_err(), "STORE_DOWN");
        assert_eq!(calling.get("ball").await.unwrap().state(), v1::SessionState::Active);
        disk.is_well();
        assert_eq!(ready(&server).await.unwrap(), "ready\n", "nothing is quarantined");
    }
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let sessions = caller.list(v1::ListSessionsRequest::default()).await.unwrap().sessions;
        assert!(sessions.iter().all(|session| session.state() == v1::SessionState::Active), "{sessions:?}");
        assert_eq!(sessions.len(), 3);
    }
    assert_eq!(caller.log("other").await, log);
    assert!(caller.vertices("other").await.1 == surface);
    assert_eq!(caller.report(touch("other", 1, "while-unread")).await.unwrap().seq, 4);
    server.kill().await;

    disk.becomes(&format!("fail read {EIO}"));
    let refusal = Process::refusal_with(&disk.database(), |command| disk.beneath(command)).await;
    assert!(refusal.contains("the disk does not read the database"), "{refusal}");
    disk.is_well();
    let server = disk.serve().await;
    assert_eq!(server.caller(Transport::Grpc).get("other").await.unwrap().revision, 4);
}

/// Points that need pages of their own.
fn large_view() -> Vec<[f32; 3]> {
    directions(2000)
        .into_iter()
        .map(|[x, y, z]| [0.05 * x, 0.05 * y, 0.3 + 0.05 * z].map(|x| x as f32))
        .collect()
}

/// Writes all that is in the log of changes into the database, and gives a place in it where nothing but the content
/// of the largest event is.
async fn place_of_an_event(database: &Path) -> i64 {
    let options = SqliteConnectOptions::new().filename(database);
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    sqlx::query("pragma wal_checkpoint(truncate)").execute(&mut connection).await.unwrap();
    // The path of a page that continues a row is that of the row, a plus sign and a number.
    let query = "select min(pgoffset) from dbstat where name = 'events' and pagetype = 'overflow'
        group by substr(path, 1, instr(path, '+')) order by count(*) desc limit 1";
    let place = sqlx::query_scalar(query).fetch_one(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    place
}

#[tokio::test]
async fn an_event_that_the_disk_does_not_read_is_not_damaged_and_the_other_sessions_are_served() {
    let disk = Disk::new();
    let server = disk.serve().await;
    let caller = server.caller(Transport::Grpc);
    caller.begin("ball").await;
    caller.create(creation("other")).await.unwrap();
    let view = v1::AddVisualPriorRequest { prior: Some(cloud(&large_view())), ..prior("other") };
    caller.add_prior(view).await.unwrap();
    let (log, surface) = (caller.log("other").await, caller.vertices("other").await.1);
    server.kill().await;
    let bad = place_of_an_event(&disk.database()).await;

    for (number, transport) in Transport::BOTH.into_iter().enumerate() {
        // Nothing is in memory.
        let server = disk.serve().await;
        let caller = server.caller(transport);
        disk.becomes(&format!("fail read {EIO} {bad}"));
        // A write makes what the readers hold in memory stale.
        caller.report(touch("ball", number, &format!("fresh-{number}"))).await.unwrap();
        for (what, outcome) in readings(&caller, "other").await {
            // Where its log was proved before, its row is enough for the others, and the creation can be read.
            if ["mesh", "report"].contains(&what) {
                assert_eq!(outcome.unwrap_err().reason, "STORE_DOWN", "{what}");
            }
        }
        assert_eq!(ready(&server).await.unwrap_err(), "STORE_DOWN");
        assert_eq!(caller.log("ball").await.len(), 3 + number);
        disk.is_well();
        assert_eq!(ready(&server).await.unwrap(), "ready\n", "nothing is quarantined");
        assert_eq!(caller.log("other").await, log);
        assert!(caller.vertices("other").await.1 == surface);
        server.kill().await;
    }
    disk.becomes(&format!("fail read {EIO} {bad}"));
    let refusal = Process::refusal_with(&disk.database(), |command| disk.beneath(command)).await;
    assert!(refusal.contains("the disk does not read the database"), "{refusal}");
}

/// All that a reader of a session with two events asks for.
async fn check_readers(caller: &Caller, session_id: &str) {
    assert_eq!(caller.get(session_id).await.unwrap().revision, 2);
    assert_eq!(caller.log(session_id).await.len(), 2);
    assert_eq!(caller.vertices(session_id).await.0.revision, 2);
    assert_eq!(caller.list(v1::ListSessionsRequest::default()).await.unwrap().sessions.len(), 2);
}

#[tokio::test]
async fn a_slow_disk_is_waited_for_by_those_who_write_and_by_nobody_else() {
    let disk = Disk::new();
    let server = disk.serve().await;
    for transport in Transport::BOTH {
        server.caller(Transport::Grpc).begin(transport.name()).await;
    }
    disk.becomes("hold sync 0");
    let writing = Transport::BOTH.map(|transport| {
        let caller = server.caller(transport);
        tokio::spawn(async move { caller.report(touch(transport.name(), 0, "slow")).await.unwrap() })
    });
    soon("a write waits for the disk", disk.holds()).await;
    for transport in Transport::BOTH {
        soon("readers are served meanwhile", check_readers(&server.caller(transport), transport.name()))
            .await;
    }
    // Whoever has no time is told so in time, and finds out by a retry what became of it.
    let caller = server.caller(Transport::Grpc);
    let mut hurried = tonic::Request::new(touch("grpc", 0, "slow"));
    hurried.set_timeout(Duration::from_millis(500));
    let late = soon("an answer", caller.exploration().report_contact(hurried)).await.unwrap_err();
    assert!(matches!(late.code(), tonic::Code::DeadlineExceeded | tonic::Code::Cancelled), "{late:?}");
    assert!(
        !writing.iter().any(tokio::task::JoinHandle::is_finished),
        "nothing is acknowledged before its sync"
    );
    disk.becomes("slow sync 200");
    for written in writing {
        assert_eq!(soon("an acknowledgement", written).await.unwrap().seq, 3);
    }
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let retry = caller.report(touch(transport.name(), 0, "slow")).await.unwrap();
        assert!(retry.duplicate && retry.seq == 3, "{retry:?}");
        for number in 1..4 {
            let asked = Instant::now();
            let told =
                caller.report(touch(transport.name(), number, &format!("slow-{number}"))).await.unwrap();
            assert_eq!(told.seq, 3 + number as i64);
            assert!(asked.elapsed() >= Duration::from_millis(200), "it is acknowledged after its sync");
        }
    }
    server.kill().await;
    disk.is_well();
    let server = disk.serve().await;
    for transport in Transport::BOTH {
        assert_eq!(server.caller(Transport::Http).log(transport.name()).await.len(), 6);
    }
}
