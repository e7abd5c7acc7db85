//! A log that does not say what was written: found before anything of it is served, and told to whoever asks.

use std::path::Path;
use std::time::Duration;

use palpate_proto::v1;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, Connection, SqliteConnection};

use crate::harness::ball::{CENTRE, contact_at, met, plausible};
use crate::harness::{Caller, Server, Transport, accepted, creation, report, soon, without_timing};

/// The sessions' logs: the creation, a view, and contacts up to this event.
const HEAD: i64 = 5;

async fn open(database: &Path) -> SqliteConnection {
    SqliteConnection::connect_with(&SqliteConnectOptions::new().filename(database)).await.unwrap()
}

/// Runs statements that the log's triggers forbid, and puts the triggers back.
async fn tamper(database: &Path, statements: &[String]) {
    let mut connection = open(database).await;
    let query = "select name, sql from sqlite_schema where type = 'trigger'";
    let triggers: Vec<(String, String)> = sqlx::query_as(query).fetch_all(&mut connection).await.unwrap();
    let dropped = triggers.iter().map(|(name, _)| format!("drop trigger {name}"));
    let restored = triggers.iter().map(|(_, sql)| sql.clone());
    for statement in dropped.chain(statements.iter().cloned()).chain(restored) {
        sqlx::query(AssertSqlSafe(statement)).execute(&mut connection).await.unwrap();
    }
    connection.close().await.unwrap();
}

/// A session with a view and three contacts.
async fn explored(caller: &Caller, session_id: &str) {
    let mut next = caller.begin_coarse(session_id, v1::SessionConfig::default()).await;
    for number in 0..HEAD as usize - 2 {
        let said = met(&next, CENTRE, plausible(number));
        next = caller.tell(session_id, said, &format!("touch-{number}")).await.candidates.remove(0);
    }
}

/// One more contact, at the top of the ball.
fn contact() -> v1::ContactResult {
    contact_at([0.0, 0.0, 1.0], 0.0, plausible(7))
}

/// What is done to the log of the session `$`, and how much of it is sound then.
fn damages() -> Vec<(&'static str, Vec<&'static str>, i64)> {
    vec![
        (
            "a bit of a payload",
            vec![
                "update events set payload = cast(payload || x'00' as blob) where session_id = $ and seq = 4",
            ],
            3,
        ),
        (
            "a reply of another event",
            vec![
                "update events set reply = (select reply from events where session_id = $ and seq = 3) where session_id = $ and seq = 4",
            ],
            3,
        ),
        ("an empty reply", vec!["update events set reply = x'' where session_id = $ and seq = 5"], 4),
        ("a state hash", vec!["update events set state_hash = 'ab' where session_id = $ and seq = 4"], 3),
        (
            "what lists of events show",
            vec!["update events set stats_after = x'' where session_id = $ and seq = 4"],
            3,
        ),
        ("a kind", vec!["update events set kind = 'lease' where session_id = $ and seq = 4"], 3),
        ("a request id", vec!["update events set request_id = 'other' where session_id = $ and seq = 4"], 3),
        ("no request id", vec!["update events set request_id = null where session_id = $ and seq = 4"], 3),
        (
            "a request digest",
            vec!["update events set request_digest = x'00' where session_id = $ and seq = 4"],
            3,
        ),
        ("a version", vec!["update events set algorithm_version = '0' where session_id = $ and seq = 4"], 3),
        ("a time", vec!["update events set append_us = append_us + 1 where session_id = $ and seq = 4"], 3),
        ("an actor", vec!["update events set actor = 'nobody' where session_id = $ and seq = 4"], 3),
        ("a link", vec!["update events set link = x'00' where session_id = $ and seq = 4"], 3),
        ("no link", vec!["update events set link = null where session_id = $ and seq = 4"], 3),
        ("a gap", vec!["delete from events where session_id = $ and seq = 4"], 3),
        ("a log cut short", vec!["delete from events where session_id = $ and seq = 5"], 4),
        (
            "a log put back",
            vec![
                "delete from events where session_id = $ and seq >= 4",
                "update sessions set head = 3 where session_id = $",
            ],
            3,
        ),
        (
            "two events swapped",
            vec![
                "update events set seq = 99 where session_id = $ and seq = 4",
                "update events set seq = 4 where session_id = $ and seq = 5",
                "update events set seq = 5 where session_id = $ and seq = 99",
            ],
            3,
        ),
        ("a head too high", vec!["update sessions set head = 9 where session_id = $"], 5),
        ("a head too low", vec!["update sessions set head = 4 where session_id = $"], 4),
        ("another link at the head", vec!["update sessions set link = x'00' where session_id = $"], 5),
        (
            "another time of creation",
            vec!["update sessions set created_us = created_us - 1 where session_id = $"],
            5,
        ),
        (
            "a creation that says nothing",
            vec!["update events set payload = x'ff' where session_id = $ and seq = 1"],
            0,
        ),
        ("no creation", vec!["delete from events where session_id = $ and seq = 1"], 0),
        (
            "bytes where text should be",
            vec!["update events set actor = cast(x'ff' as text) where session_id = $ and seq = 4"],
            3,
        ),
    ]
}

#[tokio::test]
async fn whatever_disagrees_quarantines_its_session_before_anything_of_it_is_served_and_no_other() {
    let server = Server::start().await;
    let caller = server.grpc();
    explored(&caller, "whole").await;
    let damages = damages();
    let id = |number: usize| format!("damaged-{number}");
    for number in 0..damages.len() {
        explored(&caller, &id(number)).await;
    }
    let whole = without_timing(caller.get("whole").await.unwrap());
    let surface = caller.vertices("whole").await.0;
    let at = |number: usize, revision: i64| v1::GetMeshRequest {
        session_id: id(number),
        revision,
        ..Default::default()
    };
    let third = caller.mesh(at(0, 3)).await.unwrap().etag;

    let server = server
        .restart_after(async |database| {
            for (number, (_, statements, _)) in damages.iter().enumerate() {
                let named = |statement: &&str| statement.replace('$', &format!("'{}'", id(number)));
                tamper(database, &statements.iter().map(named).collect::<Vec<_>>()).await;
            }
        })
        .await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        for (number, (what, _, sound)) in damages.iter().enumerate() {
            let session = caller.get(&id(number)).await.unwrap();
            assert_eq!(session.state(), v1::SessionState::Quarantined, "{what}");
            let quarantine = session.quarantine.unwrap_or_else(|| panic!("{what}: no reason"));
            assert_eq!(
                (session.revision, quarantine.sound_revision),
                (*sound, *sound),
                "{what}: {quarantine:?}"
            );
            assert!(quarantine.reason.len() > 10, "{what}: {quarantine:?}");
        }
        // Each is in the list, under the filter too, and the others are as they were.
        let listed = v1::ListSessionsRequest { page_size: 100, ..Default::default() };
        let sessions = caller.list(listed.clone()).await.unwrap().sessions;
        assert_eq!(sessions.len(), damages.len() + 1);
        let quarantined = v1::ListSessionsRequest { state: v1::SessionState::Quarantined.into(), ..listed };
        let quarantined = caller.list(quarantined).await.unwrap().sessions;
        assert_eq!(quarantined.len(), damages.len());
        assert!(quarantined.iter().all(|session| session.state() == v1::SessionState::Quarantined));
        assert_eq!(without_timing(caller.get("whole").await.unwrap()), whole);
        assert!(caller.vertices("whole").await.0 == surface, "another session is as it was");

        for (number, (what, _, sound)) in damages.iter().enumerate() {
            // Nothing is added to a log that cannot be trusted, and no retry is answered from what is damaged in it.
            let new = caller.report(report(&id(number), contact(), "new")).await;
            assert_eq!(new.unwrap_err().reason, "SESSION_QUARANTINED", "{what}");
            if what.contains("reply") {
                let damaged = format!("touch-{}", sound - 2);
                let retry = caller.report(report(&id(number), contact(), &damaged)).await;
                assert_eq!(retry.unwrap_err().reason, "SESSION_QUARANTINED", "{what}");
            }
            let beyond = caller.mesh(at(number, sound + 1)).await;
            assert_eq!(beyond.unwrap_err().reason, "SESSION_QUARANTINED", "{what}");
            if *sound < 2 {
                continue;
            }
            // What is sound is read under its own revision.
            assert_eq!(caller.mesh(at(number, 0)).await.unwrap().revision, *sound, "{what}");
            let events =
                caller.events(v1::ListEventsRequest { session_id: id(number), ..Default::default() });
            assert_eq!(events.await.unwrap().events.len() as i64, *sound, "{what}");
        }
        assert_eq!(caller.mesh(at(0, 3)).await.unwrap().etag, third, "a sound revision is what it was");
    }
    let ready = accepted(server.http().get("/readyz")).await.unwrap().text().await.unwrap();
    assert_eq!(ready, format!("ready\nquarantined sessions: {}\n", damages.len()));

    // A damaged session may be deleted, by the etag that it shows.
    let caller = server.grpc();
    let etag = caller.get(&id(0)).await.unwrap().etag;
    caller.delete(v1::DeleteSessionRequest { session_id: id(0), etag, ..Default::default() }).await.unwrap();
    assert_eq!(caller.get(&id(0)).await.unwrap_err().reason, "SESSION_NOT_FOUND");
}

#[tokio::test]
async fn a_summary_is_a_cache_that_is_made_anew_where_it_is_not_as_it_was_written() {
    let server = Server::start().await;
    let caller = server.grpc();
    for name in ["one", "other", "garbage", "unsealed"] {
        explored(&caller, name).await;
    }
    let listed = v1::ListSessionsRequest { page_size: 100, ..Default::default() };
    let list = async |caller: &Caller| -> Vec<v1::Session> {
        let sessions = caller.list(listed.clone()).await.unwrap().sessions;
        sessions.into_iter().map(without_timing).collect()
    };
    let before = list(&caller).await;
    let server = server
        .restart_after(async |database| {
            let statements = [
                "update sessions set summary = (select summary from sessions where session_id = 'other') where session_id = 'one'",
                "update sessions set summary = x'00ff00ff' where session_id = 'garbage'",
                "update sessions set seal = null where session_id = 'unsealed'",
            ];
            tamper(database, &statements.map(str::to_owned)).await;
        })
        .await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        assert_eq!(list(&caller).await, before);
        for session in &before {
            assert_eq!(&without_timing(caller.get(&session.session_id).await.unwrap()), session);
        }
    }
    // The next event writes it anew.
    let caller = server.grpc();
    caller.tell("one", contact(), "next").await;
    let newest = without_timing(caller.get("one").await.unwrap());
    let server = server.restart().await;
    assert_eq!(without_timing(server.grpc().get("one").await.unwrap()), newest);
}

#[tokio::test]
async fn a_session_that_was_put_right_is_served_again() {
    let server = Server::start().await;
    explored(&server.grpc(), "ball").await;
    let before = server.grpc().vertices("ball").await.0;
    let damage = "update events set append_us = append_us + 1 where seq = 4";
    let server = server.restart_after(async |database| tamper(database, &[damage.to_owned()]).await).await;
    assert_eq!(server.grpc().get("ball").await.unwrap().state(), v1::SessionState::Quarantined);
    let repair = "update events set append_us = append_us - 1 where seq = 4";
    let server = server.restart_after(async |database| tamper(database, &[repair.to_owned()]).await).await;
    let caller = server.grpc();
    assert!(caller.vertices("ball").await.0 == before);
    assert_eq!(caller.get("ball").await.unwrap().state(), v1::SessionState::Active);
    caller.tell("ball", contact(), "next").await;
}

#[tokio::test]
async fn events_that_a_cut_log_of_changes_lost_are_counted_at_the_start() {
    let server = Server::start().await;
    explored(&server.grpc(), "ball").await;
    let ready = async |server: &Server| -> String {
        accepted(server.http().get("/readyz")).await.unwrap().text().await.unwrap()
    };
    let whole = server.after_a_crash(|_| {}).await;
    assert_eq!(ready(&whole).await, "ready\n");
    assert_eq!(whole.grpc().get("ball").await.unwrap().revision, HEAD);
    let cut = server
        .after_a_crash(|folder| {
            let wal = folder.join("palpate.db-wal");
            let bytes = std::fs::read(&wal).unwrap();
            // The last pages, each with a head of 24 bytes: some of the last events.
            std::fs::write(&wal, &bytes[..bytes.len() - 12 * (4096 + 24)]).unwrap();
        })
        .await;
    let revision = cut.grpc().get("ball").await.unwrap().revision;
    assert!(revision < HEAD, "the cut took something: {revision}");
    assert_eq!(ready(&cut).await, format!("ready\nmissing events: {}\n", HEAD - revision));
}

#[tokio::test]
async fn what_is_written_into_a_deleted_file_is_not_acknowledged() {
    for name in ["palpate.db", "palpate.db-wal"] {
        let server = Server::start().await;
        explored(&server.grpc(), "ball").await;
        let (file, away) = (server.folder().join(name), server.folder().join("away"));
        std::fs::rename(&file, &away).unwrap();
        for transport in Transport::BOTH {
            let caller = server.caller(transport);
            let contact = report("ball", contact(), "lost");
            assert_eq!(caller.report(contact).await.unwrap_err().reason, "STORE_DOWN", "{name}");
            let new = caller.create(creation("new")).await;
            assert_eq!(new.unwrap_err().reason, "STORE_DOWN", "{name}");
        }
        let ready = accepted(server.http().get("/readyz")).await;
        assert_eq!(ready.unwrap_err().reason, "STORE_DOWN", "{name}");
        // Put back in time, nothing has happened.
        std::fs::rename(&away, &file).unwrap();
        let caller = server.grpc();
        // The log is opened anew meanwhile, so the first tries may still be told to come again.
        let told = soon("the log is back", async {
            loop {
                match caller.report(report("ball", contact(), "lost")).await {
                    Err(refused) if refused.reason == "STORE_DOWN" => {
                        tokio::time::sleep(Duration::from_millis(100)).await;
                    }
                    told => break told.unwrap(),
                }
            }
        });
        assert_eq!(told.await.seq, HEAD + 1, "{name}");
        accepted(server.http().get("/readyz")).await.unwrap();
    }
}

#[tokio::test]
async fn a_database_of_an_earlier_version_opens_is_linked_and_goes_on() {
    // Made by the version before the links, and by the one before forks and retractions: two sessions, each with a view
    // and six attempts, one with a lease.
    for version in ["log_v1", "log_v2"] {
        let old = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("data/{version}.sqlite"));
        let server = Server::over_copy_of(&old).await;
        for transport in Transport::BOTH {
            let caller = server.caller(transport);
            for (name, revision) in [("ball", 9), ("paper-ball", 8)] {
                let session = caller.get(name).await.unwrap();
                assert_eq!((session.state(), session.revision), (v1::SessionState::Active, revision));
                assert_eq!(session.stats.unwrap().attempts, 6);
                assert_eq!(caller.log(name).await.len() as i64, revision);
                let retry = v1::CreateSessionRequest { session_id: name.into(), ..Default::default() };
                assert_eq!(caller.create(retry).await.unwrap_err().reason, "SESSION_EXISTS");
            }
        }
        let caller = server.grpc();
        assert_eq!(caller.tell("ball", contact(), "after").await.seq, 10);
        let fork = v1::ForkSessionRequest {
            session_id: "ball".into(),
            new_session_id: "ball-2".into(),
            revision: 9,
            ..Default::default()
        };
        assert_eq!(caller.fork(fork).await.unwrap().revision, 9);
        let retraction = v1::RetractEventRequest { session_id: "ball".into(), seq: 3, ..Default::default() };
        assert_eq!(caller.retract(retraction).await.unwrap().stats.unwrap().attempts, 6);
        let server = server.restart().await;
        let session = server.grpc().get("ball").await.unwrap();
        assert_eq!((session.revision, session.state()), (11, v1::SessionState::Active));
    }
}
