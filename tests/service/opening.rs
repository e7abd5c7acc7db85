//! A session that is not in memory opens for whoever asks, however short the deadlines are.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use palpate_proto::v1;
use sqlx::{Connection, SqliteConnection};
use tonic::{Code, Request, Status};

use crate::harness::{Caller, Server, question, soon, without_timing};

/// A question with a deadline.
async fn ask(caller: &Caller, deadline: Duration) -> Result<(), Status> {
    let mut request = Request::new(question("ball", 1));
    request.set_timeout(deadline);
    soon("an answer", caller.exploration().propose_contacts(request)).await.map(drop)
}

/// A mesh of an earlier revision, with a deadline.
async fn look(caller: &Caller, revision: i64, deadline: Duration) -> Result<(), Status> {
    let mesh = v1::GetMeshRequest { session_id: "ball".into(), revision, ..Default::default() };
    let mut request = Request::new(mesh);
    request.set_timeout(deadline);
    soon("an answer", caller.reconstruction().get_mesh(request)).await.map(drop)
}

/// How often a call ran out of time before it was answered; it must be in the end.
async fn tries(what: &str, mut call: impl AsyncFnMut() -> Result<(), Status>) -> usize {
    let started = Instant::now();
    let mut late = 0;
    while let Err(status) = call().await {
        match status.code() {
            // Whoever notices first: the server, or the client.
            Code::DeadlineExceeded | Code::Cancelled => {}
            // Those who were late wait still, in their way.
            Code::ResourceExhausted => tokio::time::sleep(Duration::from_millis(200)).await,
            _ => panic!("{status:?}"),
        }
        assert!(started.elapsed() < Duration::from_secs(90), "{what} was never answered");
        late += 1;
    }
    late
}

/// The file that sessions open from quickly.
fn checkpoints(database: &Path) -> PathBuf {
    database.with_file_name("palpate.db-checkpoints")
}

#[tokio::test]
async fn a_session_opens_in_the_end_for_robots_and_readers_whose_deadlines_are_shorter_than_its_replay() {
    let server = Server::start().await;
    let next = server.grpc().begin("ball").await;
    server.grpc().go_on("ball", next, 24).await;
    let server =
        server.restart_after(async |database| drop(std::fs::remove_file(checkpoints(database)))).await;
    let (caller, deadline) = (server.grpc(), Duration::from_millis(60));
    let late = tries("the robot", async || ask(&caller, deadline).await).await;
    println!("the robot was late {late} times");
    assert!(late > 0, "the replay takes longer than the deadline, or this shows nothing");
    let late = tries("the reader", async || look(&caller, 22, deadline).await).await;
    println!("the reader was late {late} times");
}

/// The surface of each revision, in no order in which one would be computed from the other.
async fn surfaces(caller: &Caller, head: i64) -> Vec<v1::Mesh> {
    let mut surfaces = vec![None; head as usize + 1];
    for step in 0..head {
        let revision = 2 + (step * 7) % (head - 1);
        let formats = [v1::MeshFormat::Raw, v1::MeshFormat::Ply, v1::MeshFormat::Stl, v1::MeshFormat::Glb];
        let format = formats[revision as usize % formats.len()].into();
        let mesh = v1::GetMeshRequest { session_id: "ball".into(), revision, format, ..Default::default() };
        surfaces[revision as usize] = Some(caller.mesh(mesh).await.unwrap());
    }
    surfaces.into_iter().flatten().collect()
}

/// Drops the surfaces that readers are shown: they are computed from the checkpoints.
async fn drop_shown(database: &Path) {
    let path = format!("sqlite:{}", checkpoints(database).display());
    let mut file = SqliteConnection::connect(&path).await.unwrap();
    assert!(sqlx::query("delete from shown").execute(&mut file).await.unwrap().rows_affected() > 5);
    file.close().await.unwrap();
}

/// Puts the checkpoint of one event in the place of others.
async fn exchange(database: &Path) {
    let path = format!("sqlite:{}", checkpoints(database).display());
    let mut file = SqliteConnection::connect(&path).await.unwrap();
    let exchanged = sqlx::query(
        "update checkpoints set bytes = (select bytes from checkpoints where seq = 5) where seq > 5",
    );
    assert!(exchanged.execute(&mut file).await.unwrap().rows_affected() > 5);
    file.close().await.unwrap();
}

/// Bytes of something else in the middle of the file.
fn overwrite(database: &Path) {
    let mut bytes = std::fs::read(checkpoints(database)).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle / 2..middle].fill(0x5a);
    std::fs::write(checkpoints(database), bytes).unwrap();
}

#[tokio::test]
async fn every_revision_is_the_same_with_checkpoints_without_them_and_with_wrong_ones() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("ball").await;
    caller.go_on("ball", next, 8).await;
    let retraction = v1::RetractEventRequest {
        session_id: "ball".into(),
        seq: 6,
        reason: "the arm was pushed".into(),
        ..Default::default()
    };
    caller.retract(retraction).await.unwrap();
    let next = caller.propose(question("ball", 1)).await.unwrap().candidates.remove(0);
    caller.go_on("ball", next, 4).await;
    let head = caller.get("ball").await.unwrap().revision;
    let expected = surfaces(&caller, head).await;
    let session = without_timing(caller.get("ball").await.unwrap());

    let server = server.restart().await;
    assert_eq!(surfaces(&server.grpc(), head).await, expected, "with checkpoints");
    let server = server.restart_after(drop_shown).await;
    assert_eq!(surfaces(&server.grpc(), head).await, expected, "computed from checkpoints");
    let server = server.restart_after(exchange).await;
    assert_eq!(surfaces(&server.grpc(), head).await, expected, "with those of other events");
    let server = server.restart_after(async |database| overwrite(database)).await;
    assert_eq!(surfaces(&server.grpc(), head).await, expected, "with a damaged file");
    let server =
        server.restart_after(async |database| std::fs::remove_file(checkpoints(database)).unwrap()).await;
    assert_eq!(surfaces(&server.grpc(), head).await, expected, "without checkpoints");
    assert_eq!(without_timing(server.grpc().get("ball").await.unwrap()), session);
    // What was folded is kept again.
    let server = server.restart().await;
    assert_eq!(surfaces(&server.grpc(), head).await, expected);
    assert!(checkpoints(&server.stop().await.path().join("palpate.db")).exists());
}
