//! A server is stopped and started again, as for an upgrade: robots that ask again notice nothing.

use crate::harness::{Process, Robots, Transport, accepted, patient_client};

const ROBOTS: usize = 8;
const RESTARTS: usize = 4;

#[tokio::test]
async fn eight_robots_see_no_error_while_the_server_is_restarted_again_and_again() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let mut server = Process::serve(&database).await;
    let address = server.address.to_string();
    let mut clients = Vec::new();
    for _ in 0..ROBOTS {
        clients.push(patient_client(&server.url()).await);
    }
    let robots = Robots::begin(clients);
    for _ in 0..RESTARTS {
        robots.go_on(2 * ROBOTS as u64).await;
        assert!(server.terminate().await.success());
        server = Process::serve_at(&address, &database, |_| {}).await;
    }
    robots.go_on(ROBOTS as u64).await;
    let told = robots.stop().await.unwrap();
    assert_eq!(told.len(), ROBOTS);
    let caller = server.caller(Transport::Grpc);
    for (session_id, acknowledged) in told {
        let log = caller.log(&session_id).await;
        // The creation and the view come before the results, each of which is there once.
        assert_eq!(log.len() as u64, acknowledged + 2, "{session_id}");
    }
    let ready = accepted(server.http().get("/readyz")).await.unwrap().text().await.unwrap();
    assert_eq!(ready, "ready\n");
}
