//! A server that is killed goes on where the last acknowledged event left it.

use std::collections::BTreeSet;
use std::path::Path;

use palpate_client::Client;
use palpate_proto::v1;
use palpate_proto::v1::mesh::Body;
use palpate_simulator::body::Body as Object;
use palpate_simulator::robot::{Plan, Robot};
use palpate_simulator::shapes;
use tokio::sync::watch;
use tokio_stream::StreamExt;

use crate::harness::{Process, Proxy, Refused, Server, Transport, creation, patient_client, reply, soon};

const ATTEMPTS: u32 = 14;
/// After how many acknowledged attempts, and how much later, the server is killed. The delays only vary where in a
/// call it happens; what must hold does not depend on it.
const KILLS: [(u32, u64); 5] = [(0, 0), (2, 3), (4, 8), (7, 14), (10, 5)];

/// What a robot was told, by attempt.
#[derive(Debug, PartialEq)]
struct Story {
    revisions: Vec<i64>,
    /// Positions, uncertainties and tag of the mesh of each revision.
    meshes: Vec<v1::Mesh>,
    mean_uncertainties: Vec<f64>,
}

/// Lets the simulated robot explore; `progress` hears of each acknowledged attempt.
async fn explore(client: Client, object: &Object, progress: watch::Sender<u32>) -> Story {
    let config = v1::SessionConfig { seed: Some(3), ..Default::default() };
    let session = v1::CreateSessionRequest { config: Some(config), ..creation("pear") };
    let plan = Plan { session, seed: 3, attempts: ATTEMPTS, ..Plan::default() };
    let mut robot = Robot::begin(client.clone(), object, plan).await.unwrap();
    let mut story = Story { revisions: Vec::new(), meshes: Vec::new(), mean_uncertainties: Vec::new() };
    progress.send_replace(0);
    while let Some(attempt) = robot.step().await.unwrap() {
        progress.send_replace(attempt.number);
        let request = v1::GetMeshRequest {
            session_id: "pear".into(),
            revision: attempt.revision,
            ..Default::default()
        };
        story.revisions.push(attempt.revision);
        story.meshes.push(client.get_mesh(request).await.unwrap());
        story.mean_uncertainties.push(attempt.mean_uncertainty);
    }
    story
}

/// Kills the server again and again, each time starting another one over the same database.
async fn kill_repeatedly(
    database: &Path,
    mut server: Process,
    proxy: &Proxy,
    mut progress: watch::Receiver<u32>,
) -> Process {
    for (acknowledged, delay_ms) in KILLS {
        let reached = progress.wait_for(|attempts| *attempts >= acknowledged);
        soon("the robot's progress", reached).await.unwrap();
        tokio::time::sleep(std::time::Duration::from_millis(delay_ms)).await;
        server.kill().await;
        server = Process::serve(database).await;
        proxy.switch(server.address);
    }
    server
}

#[tokio::test]
async fn a_run_through_many_kills_is_the_run_that_nobody_disturbed() {
    let object = shapes::generate("pear").unwrap();
    let calm = Server::start().await;
    let undisturbed = explore(calm.client().await, &object, watch::channel(0).0).await;
    assert_eq!(undisturbed.revisions, (3..3 + i64::from(ATTEMPTS)).collect::<Vec<_>>());

    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let server = Process::serve(&database).await;
    let proxy = Proxy::to(server.address).await;
    let client = patient_client(&proxy.url()).await;
    let (progress, heard) = watch::channel(0);
    let (disturbed, server) = soon("the robot and the killer", async {
        tokio::join!(
            explore(client.clone(), &object, progress),
            kill_repeatedly(&database, server, &proxy, heard)
        )
    })
    .await;
    assert_eq!(disturbed, undisturbed, "the robot was told the same, revision by revision");

    // Every acknowledged event is there once, and the states are the same, bit for bit.
    let before = log(&client).await;
    check_log(&before, &log(&calm.client().await).await);
    // Once more from the disk alone: the log, and every mesh that was acknowledged.
    server.kill().await;
    let server = Process::serve(&database).await;
    proxy.switch(server.address);
    assert_eq!(log(&client).await, before);
    for mesh in &undisturbed.meshes {
        let request =
            v1::GetMeshRequest { session_id: "pear".into(), revision: mesh.revision, ..Default::default() };
        let folded = client.get_mesh(request).await.unwrap();
        assert!(matches!(folded.body, Some(Body::Raw(_))) && folded == *mesh, "revision {}", mesh.revision);
    }
    assert!(server.terminate().await.success());
}

async fn log(client: &Client) -> Vec<v1::Event> {
    let request = v1::ListEventsRequest {
        session_id: "pear".into(),
        include_points: true,
        page_size: 100,
        ..Default::default()
    };
    client.list_events(request).await.unwrap().events
}

fn check_log(disturbed: &[v1::Event], undisturbed: &[v1::Event]) {
    let seqs: Vec<i64> = disturbed.iter().map(|event| event.seq).collect();
    assert_eq!(seqs, (1..=2 + i64::from(ATTEMPTS)).collect::<Vec<_>>(), "no gap, nothing more");
    let ids: BTreeSet<&str> = disturbed.iter().map(|event| event.request_id.as_str()).collect();
    assert_eq!(ids.len(), disturbed.len(), "no request was carried out twice");
    for (one, other) in disturbed.iter().zip(undisturbed) {
        assert_eq!((one.seq, &one.state_hash), (other.seq, &other.state_hash));
        assert_eq!(one.kind, other.kind, "event {}", one.seq);
    }
}

#[tokio::test]
async fn a_service_manager_can_stop_the_program_while_somebody_watches() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let server = Process::serve(&database).await;
    let caller = server.caller(Transport::Grpc);
    caller.begin("ball").await;
    let before = caller.get("ball").await.unwrap();
    let request =
        v1::WatchSessionRequest { session_id: "ball".into(), after_revision: 2, ..Default::default() };
    let mut updates = reply(caller.reconstruction().watch_session(request)).await.unwrap();

    assert!(server.terminate().await.success());
    let end = soon("the end", updates.next()).await.unwrap().unwrap_err();
    assert_eq!(Refused::from_status(&end).reason, "DRAINING");
    let server = Process::serve(&database).await;
    assert_eq!(server.caller(Transport::Grpc).get("ball").await.unwrap(), before);
}

#[tokio::test]
async fn a_second_program_over_one_database_is_refused_until_the_first_is_gone_however_it_ended() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let first = Process::serve(&database).await;
    let next = first.caller(Transport::Grpc).begin("ball").await;
    let refusal = Process::refusal(&database).await;
    assert!(refusal.contains("another server holds the database"), "{refusal}");
    assert!(!refusal.contains("panicked"), "{refusal}");
    first.caller(Transport::Grpc).go_on("ball", next, 1).await;
    first.kill().await;
    let second = Process::serve(&database).await;
    assert_eq!(second.caller(Transport::Grpc).log("ball").await.len(), 3);
}
