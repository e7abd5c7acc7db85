//! Several servers over one log on PostgreSQL: what one of them acknowledged all of them know, whoever is killed.
//!
//! `PALPATE_TEST_KILLS=50 PALPATE_TEST_FAILOVERS=5 cargo test -p palpate-tests --test service -- replicas --nocapture`
//! kills servers and databases as often as that and prints the figures; `PALPATE_TEST_SEED` chooses the moments.
//! With `PALPATE_TEST_OTHER_PROGRAM`, a `palpate` of another version, every other server is one of that: an upgrade on
//! the way, and back.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use palpate_client::{Client, RetryPolicy};
use palpate_proto::v1;
use serde_json::Value;
use tokio::sync::watch;

use crate::harness::ball::{contact_at, directions, plausible};
use crate::harness::database::address;
use crate::harness::postgres::Installation;
use crate::harness::{
    Caller, EventStream, Process, Proxy, Random, Server, Transport, accepted, creation, given, miss, prior,
    question, report, run, soon, touch,
};

const ROBOTS: u64 = 8;
const REPLICAS: usize = 3;
/// Contacts of a session, after which its robot begins another one.
const CONTACTS: usize = 30;
/// Contacts that are acknowledged between two kills, at least.
const SOME: u64 = 3;
const LEAST_MS: u64 = 60;
const SPREAD_MS: usize = 300;

/// Robots come back at once, and wait as long as a server asks.
const IMPATIENT: RetryPolicy = RetryPolicy {
    max_attempts: 100_000,
    first_wait: Duration::from_millis(2),
    longest_wait: Duration::from_secs(5),
};
const PATIENCE: Duration = Duration::from_secs(120);

/// What a robot was told: by session and request id the seq of the event.
type Told = BTreeMap<(String, String), i64>;

/// Lets a robot report contacts, each at another server than the one before.
async fn explore(
    clients: Vec<Client>,
    robot: u64,
    stop: watch::Receiver<bool>,
    count: Arc<AtomicU64>,
) -> Told {
    let places = directions(CONTACTS);
    let mut told = Told::new();
    let mut turn = robot as usize;
    let mut next = || {
        turn += 1;
        &clients[turn % clients.len()]
    };
    for number in 0.. {
        let session_id = format!("robot-{robot}-{number}");
        let method = v1::Method::Paper.into();
        let config = v1::SessionConfig { method, icosphere_subdivisions: Some(2), ..Default::default() };
        let request = v1::CreateSessionRequest {
            config: Some(config),
            request_id: format!("create-{session_id}"),
            ..creation(&session_id)
        };
        next().create_session(request).await.unwrap();
        next().add_visual_prior(prior(&session_id)).await.unwrap();
        for (touch, place) in places.iter().enumerate() {
            if *stop.borrow() {
                return told;
            }
            let request_id = format!("touch-{touch}");
            let said = contact_at(*place, 0.0, plausible(touch));
            let reply = next().report_contact(report(&session_id, said, &request_id)).await.unwrap();
            told.insert((session_id.clone(), request_id), reply.seq);
            count.fetch_add(1, Ordering::Relaxed);
        }
    }
    told
}

/// Waits until some more contacts are acknowledged, and then a little longer.
async fn some_more(count: &AtomicU64, random: &mut Random) {
    let before = count.load(Ordering::Relaxed);
    let some = async {
        while count.load(Ordering::Relaxed) < before + SOME {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    soon("acknowledged contacts", some).await;
    tokio::time::sleep(Duration::from_millis(LEAST_MS + random.below(SPREAD_MS) as u64)).await;
}

/// A server, which may be of the other version.
async fn started(database: &str, number: usize) -> Process {
    match std::env::var_os("PALPATE_TEST_OTHER_PROGRAM") {
        Some(other) if number % 2 == 1 => Process::serve_of(other.as_ref(), database.as_ref()).await,
        _ => Process::serve(database.as_ref()).await,
    }
}

#[tokio::test]
async fn what_was_acknowledged_survives_kills_of_servers_and_of_the_database_that_they_share() {
    let Some(installation) = Installation::find() else { return };
    let kills = given("PALPATE_TEST_KILLS", 9).max(1);
    let (failovers, seed) = (given("PALPATE_TEST_FAILOVERS", 1), given("PALPATE_TEST_SEED", 1));
    let waits = ["synchronous_standby_names=*"];
    let mut primary = installation.start(&waits).await;
    let other = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap().local_addr().unwrap().port();
    let mut standby = installation.follow(&primary, other, &waits).await;
    address(&primary.url(), "palpate").await;
    let database = format!("postgres://postgres@127.0.0.1:{},127.0.0.1:{other}/palpate", primary.port);

    let mut replicas = Vec::new();
    for _ in 0..REPLICAS {
        let server = started(&database, replicas.len()).await;
        let proxy = Proxy::to(server.address).await;
        replicas.push((server, proxy));
    }
    let (stop, stopped) = watch::channel(false);
    let count = Arc::new(AtomicU64::new(0));
    let mut robots = Vec::new();
    for robot in 0..ROBOTS {
        let mut clients = Vec::new();
        for (_, proxy) in &replicas {
            let client = Client::builder(&proxy.url()).retry(IMPATIENT).deadline(PATIENCE);
            clients.push(client.connect().await.unwrap());
        }
        robots.push(tokio::spawn(explore(clients, robot, stopped.clone(), count.clone())));
    }
    let mut random = Random::new(seed);
    let mut outages = Vec::new();
    for kill in 0..kills {
        some_more(&count, &mut random).await;
        let (server, proxy) = replicas.remove(random.below(REPLICAS));
        server.kill().await;
        let server = started(&database, kill as usize).await;
        proxy.switch(server.address);
        replicas.push((server, proxy));
        // The failovers lie among the kills, at equal distances.
        if (kill + 1) * failovers / kills > kill * failovers / kills {
            some_more(&count, &mut random).await;
            let killed_at = std::time::Instant::now();
            let (old, before) = (primary.port, count.load(Ordering::Relaxed));
            primary.kill();
            installation.promote(&standby).await;
            primary = standby;
            standby = installation.follow(&primary, old, &waits).await;
            let acknowledged = async {
                while count.load(Ordering::Relaxed) == before {
                    tokio::time::sleep(Duration::from_millis(5)).await;
                }
            };
            soon("a contact after the failover", acknowledged).await;
            outages.push(killed_at.elapsed());
        }
    }
    some_more(&count, &mut random).await;
    stop.send_replace(true);
    let mut told = Told::new();
    for robot in robots {
        told.extend(robot.await.unwrap());
    }

    for (server, _) in &replicas {
        let sessions = check(&server.caller(Transport::Grpc), &told).await;
        println!(
            "seed {seed}: {kills} kills of servers, {failovers} of the database ({outages:.1?} until the next \
             contact), {} acknowledged contacts in {sessions} sessions",
            told.len(),
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let doctor = run(folder.path(), &["doctor", "--database", &database]).await;
    assert!(
        doctor.out.contains("all links followed") && doctor.code == Some(0),
        "{}{}",
        doctor.out,
        doctor.err
    );
    assert!(doctor.out.contains("waits for 1 standby"), "{}", doctor.out);
}

/// What was told is in the logs, once and in order, as this server reads them.
async fn check(caller: &Caller, told: &Told) -> usize {
    let mut logs: BTreeMap<String, BTreeMap<String, i64>> = BTreeMap::new();
    for ((session_id, request_id), seq) in told {
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
    logs.len()
}

/// Two servers over one log.
async fn two(database: &str) -> [Server; 2] {
    let location = || database.parse().unwrap();
    [Server::on(location()).await, Server::on(location()).await]
}

#[tokio::test]
async fn a_watcher_at_one_server_sees_what_another_appends_and_a_removal_ends_it() {
    let Some(installation) = Installation::find() else { return };
    let postgres = installation.start(&[]).await;
    let [here, there] = two(&address(&postgres.url(), "palpate").await).await;
    let next = here.grpc().begin("mug").await;
    let mut seen = there.http().events("mug", None).await;
    let revision = async |seen: &mut EventStream| loop {
        let event = seen.next().await.expect("the stream goes on");
        if let Some(revision) = event.id {
            break revision;
        }
    };
    while revision(&mut seen).await < 2 {}
    here.grpc().report(report("mug", touch(&next, 0.001), "one")).await.unwrap();
    assert_eq!(revision(&mut seen).await, 3);
    // Both write in turn, and each knows what the other wrote.
    let next = there.grpc().propose(question("mug", 1)).await.unwrap().candidates.remove(0);
    there.grpc().report(report("mug", miss(&next), "two")).await.unwrap();
    assert_eq!(revision(&mut seen).await, 4);
    let retried = here.grpc().report(report("mug", miss(&next), "two")).await.unwrap();
    assert!(retried.duplicate && retried.seq == 4, "{retried:?}");
    let deletion = v1::DeleteSessionRequest { session_id: "mug".into(), ..Default::default() };
    here.grpc().delete(deletion).await.unwrap();
    let ended = async { while seen.next().await.is_some() {} };
    soon("the stream ends with its session", ended).await;
    assert_eq!(there.grpc().get("mug").await.unwrap_err().reason, "SESSION_NOT_FOUND");
}

#[tokio::test]
async fn who_says_which_revision_he_saw_reads_it_at_any_server() {
    let Some(installation) = Installation::find() else { return };
    let postgres = installation.start(&[]).await;
    let [here, there] = two(&address(&postgres.url(), "palpate").await).await;
    let mut next = here.grpc().begin("mug").await;
    let mesh = |server: &Server, least: i64| {
        let request = server.http().get("/v1/sessions/mug/mesh?format=json");
        request.header("x-min-revision", least.to_string())
    };
    for revision in 3..8 {
        let reply = here.grpc().report(report("mug", miss(&next), &format!("r{revision}"))).await.unwrap();
        assert_eq!(reply.seq, revision);
        next = reply.candidates.into_iter().next().unwrap_or(next);
        let seen = accepted(mesh(&there, revision)).await.unwrap().text().await.unwrap();
        let seen: Value = serde_json::from_str(&seen).unwrap();
        assert_eq!(seen["revision"], revision);
    }
    let refused = accepted(mesh(&there, 9)).await.unwrap_err();
    assert_eq!(refused.reason, "REVISION_MISMATCH", "{}", refused.message);
    let refused = accepted(there.http().get("/v1/sessions/mug").header("x-min-revision", "last")).await;
    assert_eq!(refused.unwrap_err().fields, ["x-min-revision"]);
    // A guard that rests on what the caller saw elsewhere holds here, too.
    let request = v1::ReportContactRequest { expected_revision: Some(7), ..report("mug", miss(&next), "r8") };
    assert_eq!(there.grpc().report(request).await.unwrap().seq, 8);
    let earlier = v1::GetMeshRequest { session_id: "mug".into(), revision: 5, ..Default::default() };
    assert_eq!(there.grpc().mesh(earlier.clone()).await, here.grpc().mesh(earlier).await);
}
