//! A session that is not in memory opens for whoever asks, however short the deadlines are.

use std::time::{Duration, Instant};

use palpate_proto::v1;
use tonic::{Code, Request, Status};

use crate::harness::{Caller, Server, question, soon};

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

#[tokio::test]
async fn a_session_opens_in_the_end_for_robots_and_readers_whose_deadlines_are_shorter_than_its_replay() {
    let server = Server::start().await;
    let next = server.grpc().begin("ball").await;
    server.grpc().go_on("ball", next, 24).await;
    let server = server.restart().await;
    let (caller, deadline) = (server.grpc(), Duration::from_millis(60));
    let late = tries("the robot", async || ask(&caller, deadline).await).await;
    println!("the robot was late {late} times");
    assert!(late > 0, "the replay takes longer than the deadline, or this shows nothing");
    let late = tries("the reader", async || look(&caller, 22, deadline).await).await;
    println!("the reader was late {late} times");
}
