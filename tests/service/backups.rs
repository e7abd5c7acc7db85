//! Copies of the database are taken while robots work, and put back: the same states, bit for bit.

use std::path::Path;

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Connection};

use crate::harness::{Process, Ran, Robots, Transport, accepted, patient_client, run};

const ROBOTS: usize = 8;

async fn robots(url: &str) -> Robots {
    let mut clients = Vec::new();
    for _ in 0..ROBOTS {
        clients.push(patient_client(url).await);
    }
    Robots::begin(clients)
}

/// Each event of a session by its seq, request and the hash of the state after it.
async fn hashes(server: &Process, session_id: &str) -> Vec<(i64, String, String)> {
    let log = server.caller(Transport::Grpc).log(session_id).await;
    log.into_iter().map(|event| (event.seq, event.request_id, event.state_hash)).collect()
}

async fn back_up(folder: &Path, to: &str) -> Ran {
    run(folder, &["backup", "--database", "palpate.db", "--to", to]).await
}

async fn restore(folder: &Path, from: &str, more: &[&str]) -> Ran {
    run(folder, &[&["restore", "--from", from, "--database", "palpate.db"], more].concat()).await
}

async fn readiness(server: &Process) -> String {
    accepted(server.http().get("/readyz")).await.unwrap().text().await.unwrap()
}

#[tokio::test]
async fn a_backup_under_eight_robots_is_restored_and_replayed_to_identical_states() {
    let folder = tempfile::tempdir().unwrap();
    let server = Process::serve(&folder.path().join("palpate.db")).await;
    let robots = robots(&server.url()).await;
    robots.go_on(5 * ROBOTS as u64).await;
    let copied = back_up(folder.path(), "first.db").await;
    assert_eq!(copied.code, Some(0), "{}", copied.err);
    assert!(copied.out.starts_with("first.db: 8 sessions with ") && copied.err.is_empty(), "{copied:?}");
    robots.go_on(2 * ROBOTS as u64).await;
    let again = back_up(folder.path(), "first.db").await;
    assert!(again.code == Some(1) && again.err.contains("exists already"), "{again:?}");
    let told = robots.stop().await.unwrap();
    let mut live = Vec::new();
    for session_id in told.keys() {
        live.push((session_id, hashes(&server, session_id).await));
    }
    server.terminate().await;

    let other = tempfile::tempdir().unwrap();
    let from = folder.path().join("first.db");
    let restored = restore(other.path(), from.to_str().unwrap(), &[]).await;
    assert_eq!(restored.code, Some(0), "{}", restored.err);
    assert_eq!(restored.out.lines().count(), 1, "nothing was here before: {}", restored.out);
    let server = Process::serve(&other.path().join("palpate.db")).await;
    assert_eq!(readiness(&server).await, "ready\n");
    let mut events = 0;
    for (session_id, live) in live {
        let copied = hashes(&server, session_id).await;
        assert!(copied.len() < live.len() && live.starts_with(&copied), "{session_id}");
        assert!(copied.iter().all(|(.., hash)| !hash.is_empty()), "{session_id}");
        events += copied.len();
        let replayed =
            run(other.path(), &["replay", session_id, "--verify", "--server", &server.url()]).await;
        let all = format!("all {} states are those that were recorded\n", copied.len());
        assert!(replayed.out.ends_with(&all), "{session_id}: {replayed:?}");
    }
    assert!(events >= 7 * ROBOTS, "{events}");
}

#[tokio::test]
async fn a_restored_older_copy_is_told_and_what_it_replaces_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let server = Process::serve(&database).await;
    let caller = server.caller(Transport::Grpc);
    let next = caller.begin("mug").await;
    let next = caller.go_on("mug", next, 2).await;
    assert_eq!(back_up(folder.path(), "older.db").await.code, Some(0));
    caller.go_on("mug", next, 1).await;
    caller.begin("pot").await;

    let held = restore(folder.path(), "older.db", &["--replace"]).await;
    assert!(held.code == Some(1) && held.err.contains("another server holds the database"), "{held:?}");
    server.terminate().await;
    let refused = restore(folder.path(), "older.db", &[]).await;
    assert!(refused.code == Some(1) && refused.err.contains("add --replace"), "{refused:?}");
    let restored = restore(folder.path(), "older.db", &["--replace"]).await;
    assert_eq!(restored.code, Some(0), "{}", restored.err);
    for line in [
        "palpate.db: 1 session with 4 events; the newest of 2",
        "3 events that were acknowledged after it was taken",
        "1 session is not in it: pot.",
        "1 session has fewer events: mug 4 of 5.",
    ] {
        assert!(restored.out.contains(line), "{line}: {}", restored.out);
    }
    let server = Process::serve(&database).await;
    assert_eq!(readiness(&server).await, "ready\n", "nothing is told as lost that was given up");
    assert_eq!(hashes(&server, "mug").await.len(), 4);
    server.terminate().await;

    let kept = restored.out.rsplit_once("kept as ").unwrap().1.trim();
    let server = Process::serve(&folder.path().join(kept)).await;
    assert_eq!(readiness(&server).await, "ready\n");
    assert_eq!(hashes(&server, "mug").await.len(), 5);
    server.caller(Transport::Grpc).get("pot").await.unwrap();
}

#[tokio::test]
async fn a_lost_database_is_restored_beside_its_witness_which_says_what_is_older() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let server = Process::serve(&database).await;
    let caller = server.caller(Transport::Grpc);
    let next = caller.begin("mug").await;
    assert_eq!(back_up(folder.path(), "older.db").await.code, Some(0));
    caller.go_on("mug", next, 2).await;
    server.kill().await;
    for name in ["palpate.db", "palpate.db-wal"] {
        std::fs::remove_file(folder.path().join(name)).unwrap();
    }
    let restored = restore(folder.path(), "older.db", &[]).await;
    assert_eq!(restored.code, Some(0), "{}", restored.err);
    assert!(restored.out.contains("2 events that were acknowledged after it was taken"), "{}", restored.out);
    let server = Process::serve(&database).await;
    assert_eq!(readiness(&server).await, "ready\n");
}

#[tokio::test]
async fn a_copy_that_does_not_prove_itself_is_not_put_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let server = Process::serve(&folder.path().join("palpate.db")).await;
    server.caller(Transport::Grpc).begin("mug").await;
    assert_eq!(back_up(folder.path(), "copy.db").await.code, Some(0));
    server.terminate().await;
    let before = std::fs::read(folder.path().join("palpate.db")).unwrap();
    let copy = folder.path().join("copy.db");
    let mut file = SqliteConnectOptions::new().filename(&copy).connect().await.unwrap();
    // The link of the event is gone for a moment, as the triggers protect linked events only.
    for statement in [
        "create temp table kept as select sql from sqlite_schema where name = 'events_are_never_changed'",
        "drop trigger events_are_never_changed",
        "update events set actor = 'somebody else' where seq = 2",
    ] {
        sqlx::query(statement).execute(&mut file).await.unwrap();
    }
    let trigger: String = sqlx::query_scalar("select sql from kept").fetch_one(&mut file).await.unwrap();
    sqlx::query(sqlx::AssertSqlSafe(trigger)).execute(&mut file).await.unwrap();
    file.close().await.unwrap();
    let refused = restore(folder.path(), "copy.db", &["--replace"]).await;
    assert_eq!(refused.code, Some(1), "{refused:?}");
    assert!(refused.err.contains("\"mug\" does not prove itself (event 2 is not as it was"), "{refused:?}");
    std::fs::write(&copy, "no database, but long enough to look at twice: ".repeat(100)).unwrap();
    let refused = restore(folder.path(), "copy.db", &["--replace"]).await;
    assert!(refused.code == Some(1) && refused.err.contains("copy.db"), "{refused:?}");
    assert_eq!(std::fs::read(folder.path().join("palpate.db")).unwrap(), before, "it is untouched");
    let mut left: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|file| file.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["copy.db", "palpate.db", "palpate.db-checkpoints", "palpate.db-witness"]);
}
