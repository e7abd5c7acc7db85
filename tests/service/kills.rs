//! A server that is killed at any moment under load: what was acknowledged is there, once, in order and sound.
//!
//! `PALPATE_TEST_KILLS=1000 cargo test -p palpate-tests --test service -- kills --nocapture` kills it as often as that
//! and prints the figures; `PALPATE_TEST_SEED` chooses the moments.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use palpate_client::{Client, RetryPolicy};
use palpate_proto::v1;
use tokio::sync::watch;

use crate::harness::ball::{contact_at, directions, plausible};
use crate::harness::{Process, Proxy, Random, Transport, accepted, creation, given, prior, report, soon};

const ROBOTS: u64 = 6;
/// Contacts of a session, after which its robot begins another one.
const CONTACTS: usize = 30;
/// Contacts that are acknowledged between two kills, at least.
const SOME: u64 = 3;
/// Between those and the next kill, in milliseconds: much more is acknowledged in between.
const LEAST_MS: u64 = 60;
const SPREAD_MS: usize = 300;

/// Robots come back at once.
const IMPATIENT: RetryPolicy = RetryPolicy {
    max_attempts: 100_000,
    first_wait: Duration::from_millis(2),
    longest_wait: Duration::from_millis(20),
};
const PATIENCE: Duration = Duration::from_secs(60);

/// What a robot was told: by session and request id the seq of the event.
type Told = BTreeMap<(String, String), i64>;

/// Lets a robot report contacts, session after session, until it is told to stop.
async fn explore(client: Client, robot: u64, stop: watch::Receiver<bool>, count: Arc<AtomicU64>) -> Told {
    let places = directions(CONTACTS);
    let mut told = Told::new();
    for number in 0.. {
        let session_id = format!("robot-{robot}-{number}");
        // The cheapest method: after each kill its sessions are replayed before anything is acknowledged.
        let method = v1::Method::Paper.into();
        let config = v1::SessionConfig { method, icosphere_subdivisions: Some(2), ..Default::default() };
        let request = v1::CreateSessionRequest {
            config: Some(config),
            request_id: format!("create-{session_id}"),
            ..creation(&session_id)
        };
        client.create_session(request).await.unwrap();
        client.add_visual_prior(prior(&session_id)).await.unwrap();
        for (touch, place) in places.iter().enumerate() {
            if *stop.borrow() {
                return told;
            }
            let request_id = format!("touch-{touch}");
            let said = contact_at(*place, 0.0, plausible(touch));
            let reply = client.report_contact(report(&session_id, said, &request_id)).await.unwrap();
            told.insert((session_id.clone(), request_id), reply.seq);
            count.fetch_add(1, Ordering::Relaxed);
        }
    }
    told
}

#[tokio::test]
async fn what_was_acknowledged_survives_kills_at_any_moment_under_load() {
    let (kills, seed) = (given("PALPATE_TEST_KILLS", 50), given("PALPATE_TEST_SEED", 1));
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let mut server = Process::serve(&database).await;
    let proxy = Proxy::to(server.address).await;
    let (stop, stopped) = watch::channel(false);
    let count = Arc::new(AtomicU64::new(0));
    let mut robots = Vec::new();
    for robot in 0..ROBOTS {
        let client =
            Client::builder(&proxy.url()).retry(IMPATIENT).deadline(PATIENCE).connect().await.unwrap();
        robots.push(tokio::spawn(explore(client, robot, stopped.clone(), count.clone())));
    }
    let mut random = Random::new(seed);
    for _ in 0..kills {
        // However slow the machine is, something is acknowledged before the next kill.
        let before = count.load(Ordering::Relaxed);
        let some = async {
            while count.load(Ordering::Relaxed) < before + SOME {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        };
        soon("acknowledged contacts", some).await;
        tokio::time::sleep(Duration::from_millis(LEAST_MS + random.below(SPREAD_MS) as u64)).await;
        server.kill().await;
        server = Process::serve(&database).await;
        proxy.switch(server.address);
    }
    stop.send_replace(true);
    let mut told = Told::new();
    for robot in robots {
        told.extend(robot.await.unwrap());
    }

    let caller = server.caller(Transport::Grpc);
    let mut logs: BTreeMap<String, BTreeMap<String, i64>> = BTreeMap::new();
    for ((session_id, request_id), seq) in &told {
        if !logs.contains_key(session_id) {
            let log = caller.log(session_id).await;
            let seqs: Vec<i64> = log.iter().map(|event| event.seq).collect();
            assert_eq!(seqs, (1..=log.len() as i64).collect::<Vec<_>>(), "{session_id}: no gap");
            let count = log.len();
            let known: BTreeMap<String, i64> =
                log.into_iter().map(|event| (event.request_id, event.seq)).collect();
            assert_eq!(known.len(), count, "{session_id}: no request was carried out twice");
            logs.insert(session_id.clone(), known);
        }
        assert_eq!(logs[session_id].get(request_id), Some(seq), "{session_id}: {request_id}");
    }
    for session_id in logs.keys() {
        let session = caller.get(session_id).await.unwrap();
        assert_eq!(session.state(), v1::SessionState::Active, "{session_id}: {:?}", session.quarantine);
    }
    let ready = accepted(server.http().get("/readyz")).await.unwrap().text().await.unwrap();
    assert_eq!(ready, "ready\n", "nothing is missing or damaged");
    println!("seed {seed}: {kills} kills, {} acknowledged contacts in {} sessions", told.len(), logs.len());
    assert!(told.len() as u64 >= SOME * kills, "much was acknowledged in between: {}", told.len());
}
