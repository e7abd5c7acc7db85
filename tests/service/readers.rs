//! Readers beside robots: who looks at the past keeps no robot waiting, and a list always ends.

use std::time::{Duration, Instant};

use palpate_proto::v1;
use palpate_server::Limits;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::harness::{Outcome, Server, Transport, question, report, soon, touch};

fn past(session_id: &str, revision: i64) -> v1::GetMeshRequest {
    v1::GetMeshRequest { session_id: session_id.into(), revision, ..Default::default() }
}

/// Every earlier revision is computed again, and hardly anything may wait.
fn forgetful() -> Limits {
    Limits { past_states: 1, mesh_bytes: 0, compute_queue: 2, reader_queue: 2, ..Limits::default() }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn a_robot_beside_thirty_two_readers_of_the_past_is_never_refused() {
    let server = Server::with_limits(forgetful()).await;
    let first = server.grpc().begin("noisy").await;
    server.grpc().go_on("noisy", first, 12).await;
    let mut next = server.grpc().begin("quiet").await;
    let quiet = server.grpc();

    let done = CancellationToken::new();
    let mut readers = JoinSet::new();
    for reader in 0..32 {
        let (caller, done) = (server.grpc(), done.clone());
        readers.spawn(async move {
            let mut outcomes: Vec<Outcome<()>> = Vec::new();
            while !done.is_cancelled() {
                let revision = 2 + (reader + outcomes.len() as i64) % 12;
                outcomes.push(caller.mesh(past("noisy", revision)).await.map(drop));
                tokio::time::sleep(Duration::from_millis(2)).await;
            }
            outcomes
        });
    }
    let mut slowest = Duration::ZERO;
    for step in 0..12 {
        let asked = Instant::now();
        quiet.propose(question("quiet", 1)).await.expect("a question beside readers");
        let request = report("quiet", touch(&next, 0.001), &format!("touch-{step}"));
        next = quiet.report(request).await.expect("a contact beside readers").candidates.remove(0);
        slowest = slowest.max(asked.elapsed());
    }
    done.cancel();
    let outcomes: Vec<Outcome<()>> = soon("all readers", readers.join_all()).await.concat();
    let answered = outcomes.iter().filter(|outcome| outcome.is_ok()).count();
    println!("slowest question and contact: {slowest:?}; {answered} of {} readers answered", outcomes.len());
    assert!(answered > 0, "readers have a thread, too");
    for refused in outcomes.into_iter().filter_map(Result::err) {
        assert_eq!(refused.reason, "QUEUE_FULL");
        assert!(refused.message.contains("reader queue"), "{}", refused.message);
    }
}

#[tokio::test]
async fn all_who_ask_for_one_mesh_at_once_share_it() {
    let limits = Limits { reader_queue: 0, ..forgetful() };
    let server = Server::with_limits(limits).await;
    let first = server.grpc().begin("ball").await;
    server.grpc().go_on("ball", first, 6).await;
    let mut readers = JoinSet::new();
    for _ in 0..32 {
        let caller = server.grpc();
        readers.spawn(async move { caller.mesh(past("ball", 5)).await.unwrap() });
    }
    let meshes = soon("all meshes", readers.join_all()).await;
    assert!(meshes.iter().all(|mesh| mesh.revision == 5 && *mesh == meshes[0]));
}

#[tokio::test]
async fn a_list_beside_the_deletion_of_its_session_ends() {
    let server = Server::with_limits(Limits { read_bytes: 1, ..Limits::default() }).await;
    let deletion = v1::DeleteSessionRequest { session_id: "ball".into(), ..Default::default() };
    for round in 0..12 {
        let caller = server.grpc();
        // A request id makes one session, so each round has its own.
        let creation = v1::CreateSessionRequest {
            session_id: "ball".into(),
            request_id: format!("create-{round}"),
            ..Default::default()
        };
        caller.create(creation).await.unwrap();
        let next = caller.add_prior(crate::harness::prior("ball")).await.unwrap().candidates.remove(0);
        caller.go_on("ball", next, 8).await;
        let mut lists = JoinSet::new();
        for transport in Transport::BOTH.into_iter().cycle().take(8) {
            let caller = server.caller(transport);
            let whole =
                v1::ListEventsRequest { session_id: "ball".into(), page_size: 100, ..Default::default() };
            lists.spawn(async move { caller.events(whole).await });
        }
        tokio::time::sleep(Duration::from_micros(300 * round)).await;
        caller.delete(deletion.clone()).await.unwrap();
        for outcome in soon("all lists", lists.join_all()).await {
            match outcome {
                Ok(page) => {
                    let seqs: Vec<i64> = page.events.iter().map(|event| event.seq).collect();
                    assert_eq!(seqs, (1..=10).collect::<Vec<_>>(), "all of it, or nothing");
                }
                Err(refused) => assert_eq!(refused.reason, "SESSION_NOT_FOUND"),
            }
        }
    }
}
