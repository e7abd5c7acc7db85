//! A disk that loses its power under load: what was acknowledged is there, once, in order, and nothing is damaged.
//!
//! A server's writes and syncs are recorded, and from the record the disk is made as it is after a loss at any moment:
//! what was synced, and of the rest nothing, all, or some of the sectors. The same record with the syncs that SQLite
//! leaves out under `synchronous = normal` is the control: acknowledged contacts are lost then, and are counted as
//! missing.
//!
//! `PALPATE_TEST_POWER_LOSSES=1000 cargo test -p palpate-tests --test service -- power_loss --nocapture` makes as many
//! images as that and prints the figures; `PALPATE_TEST_SEED` chooses the moments.

mod journal;

use std::collections::BTreeSet;
use std::path::Path;

use palpate_proto::v1;
use tempfile::TempDir;

use crate::disk::between;
use crate::harness::ball::{contact_at, directions, plausible};
use crate::harness::{Caller, Process, Random, Server, Transport, accepted, creation, given, prior, report};
use journal::{Files, Journal, Syncs, Unsynced};

const ROBOTS: usize = 4;
/// Sessions that a robot explores, one after the other.
const SESSIONS: usize = 3;
/// Contacts of a session: with all others enough for several checkpoints.
const CONTACTS: usize = 40;
/// Servers, one after the other; each begins with what a loss has left of the one before.
const SERVERS: usize = 2;

/// An acknowledgement.
#[derive(Clone)]
struct Told {
    /// When it was there, as a moment of the journal.
    by: usize,
    session_id: String,
    request_id: String,
    seq: i64,
}

/// Lets a robot report contacts to a few sessions, and gives what it was told.
async fn explore(caller: Caller, robot: String, journal: std::path::PathBuf) -> Vec<Told> {
    let now = || std::fs::metadata(&journal).unwrap().len() as usize;
    let mut told = Vec::new();
    for number in 0..SESSIONS {
        let session_id = format!("{robot}-{number}");
        let mut note = |request_id: String, seq: i64| {
            told.push(Told { by: now(), session_id: session_id.clone(), request_id, seq });
        };
        let method = v1::Method::Paper.into();
        let config = v1::SessionConfig { method, icosphere_subdivisions: Some(2), ..Default::default() };
        let request = v1::CreateSessionRequest { config: Some(config), ..creation(&session_id) };
        let request_id = request.request_id.clone();
        note(request_id, caller.create(request).await.unwrap().revision);
        let seen = caller.add_prior(prior(&session_id)).await.unwrap();
        note("prior".into(), seen.session.unwrap().revision);
        for (touch, place) in directions(CONTACTS).into_iter().enumerate() {
            let request_id = format!("touch-{touch}");
            let said = contact_at(place, 0.0, plausible(touch));
            let reply = caller.report(report(&session_id, said, &request_id)).await.unwrap();
            note(request_id, reply.seq);
        }
    }
    told
}

/// A folder with these files in it.
fn folder_of(files: &Files) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).unwrap();
    }
    folder
}

/// What robots do to a server that begins with these files, until it is killed: its journal, and what they were told.
async fn recorded(before: &Files, server: usize, library: &Path) -> (Journal, Vec<Told>) {
    let folder = folder_of(before);
    let journal = folder.path().join("journal");
    let process = Process::serve_with(&folder.path().join("palpate.db"), |command| {
        command.env("LD_PRELOAD", library).env("PALPATE_JOURNAL", &journal);
    })
    .await;
    let robots: Vec<_> = (0..ROBOTS)
        .map(|robot| {
            let caller = process.caller(Transport::Grpc);
            tokio::spawn(explore(caller, format!("robot-{server}-{robot}"), journal.clone()))
        })
        .collect();
    let mut told = Vec::new();
    for robot in robots {
        told.extend(robot.await.unwrap());
    }
    process.kill().await;
    (Journal::read(&journal), told)
}

/// What a new server makes of the files.
#[derive(Debug)]
struct Found {
    /// Acknowledged events that are not there.
    lost: usize,
    /// Acknowledged events that the server says are missing.
    missing: usize,
}

/// Starts a server over the files; whatever is there is sound, without a gap and without a repeat.
async fn found(files: &Files, told: &[Told]) -> Found {
    let server = Server::over_folder(folder_of(files)).await.unwrap();
    let ready = accepted(server.http().get("/readyz")).await.unwrap().text().await.unwrap();
    let missing = match ready.strip_prefix("ready\n").unwrap() {
        "" => 0,
        rest => rest.strip_prefix("missing events: ").expect(rest).trim_end().parse().unwrap(),
    };
    let caller = server.grpc();
    let request = v1::ListSessionsRequest { page_size: 1000, ..Default::default() };
    let mut there = BTreeSet::new();
    for session in caller.list(request).await.unwrap().sessions {
        let id = session.session_id.clone();
        assert_ne!(session.state(), v1::SessionState::Quarantined, "{id}: {:?}", session.quarantine);
        let log = caller.log(&id).await;
        let seqs: Vec<i64> = log.iter().map(|event| event.seq).collect();
        assert_eq!(seqs, (1..=session.revision).collect::<Vec<_>>(), "{id}: no gap");
        let count = log.len() + there.len();
        there.extend(log.into_iter().map(|event| (id.clone(), event.request_id, event.seq)));
        assert_eq!(there.len(), count, "{id}: no request was carried out twice");
    }
    let is_there =
        |told: &Told| there.contains(&(told.session_id.clone(), told.request_id.clone(), told.seq));
    server.stop().await;
    Found { lost: told.iter().filter(|told| !is_there(told)).count(), missing }
}

/// What was acknowledged by a moment.
fn by(told: &[Told], moment: usize) -> Vec<Told> {
    told.iter().filter(|told| told.by <= moment).cloned().collect()
}

#[tokio::test]
async fn what_was_acknowledged_survives_a_loss_of_power_at_any_moment() {
    let (losses, seed) = (given("PALPATE_TEST_POWER_LOSSES", 12), given("PALPATE_TEST_SEED", 1));
    let mut random = Random::new(seed);
    let libraries = tempfile::tempdir().unwrap();
    let library = between(libraries.path(), "journal");
    let (mut before, mut kept) = (Files::new(), Vec::new());
    let (mut acknowledged, mut normal, mut anew) = (0, Found { lost: 0, missing: 0 }, 0);
    for server in 0..SERVERS {
        let (journal, new) = recorded(&before, server, &library).await;
        let told = [kept.clone(), new].concat();
        let mut after = Files::new();
        for loss in 0..losses as usize / SERVERS {
            let moment = random.below(journal.len());
            let told = by(&told, moment);
            let unsynced = [Unsynced::Torn, Unsynced::Lost, Unsynced::Torn, Unsynced::Kept][loss % 4];
            let what = format!("seed {seed}, server {server}, loss {loss} at {moment}, {unsynced:?}");
            let image = journal.image(&before, moment, Syncs::Full, unsynced, &mut random);
            let full = found(&image, &told).await;
            assert_eq!((full.lost, full.missing), (0, 0), "{what}");
            acknowledged += told.len();
            (after, kept) = (image, told.into_iter().map(|told| Told { by: 0, ..told }).collect());

            // The control: what was not synced is lost, and nothing else can have been lost.
            let image = journal.image(&before, moment, Syncs::Normal, Unsynced::Lost, &mut random);
            let control = found(&image, &kept).await;
            // Where the log's identity is lost with all the rest, a new log begins, which its witness does not know.
            let begins_anew = control.lost == kept.len();
            let is_counted = (control.lost..=control.lost + ROBOTS).contains(&control.missing);
            assert!(is_counted || begins_anew, "{what}: {control:?} of {}", kept.len());
            if is_counted {
                normal.lost += control.lost;
                normal.missing += control.missing;
            }
            anew += usize::from(!is_counted);
        }
        before = after;
    }
    println!(
        "seed {seed}: {losses} losses of power, {acknowledged} acknowledged events in the images, none lost; \
         with the syncs of synchronous = normal {} lost, {} said to be missing, and {anew} times the whole log lost",
        normal.lost, normal.missing
    );
    assert!(normal.lost > 0, "a commit that is not synced is lost, and counted");
}
