//! Logs that move from SQLite to PostgreSQL and back: the same links, however often it is interrupted.

use palpate_proto::v1;
use palpate_server::{Location, MigrateError, Progress, migrate};

use crate::harness::database::address;
use crate::harness::postgres::Installation;
use crate::harness::truth::keep_ball;
use crate::harness::{Caller, Server, Transport, creation, miss, question, report, run};

/// Everything that a caller can read of all sessions.
async fn everything(caller: &Caller) -> Vec<(v1::Session, Vec<v1::Event>, Option<v1::Reference>, v1::Mesh)> {
    let listed = caller.list(v1::ListSessionsRequest::default()).await.unwrap();
    let mut all = Vec::new();
    for session in listed.sessions {
        let id = session.session_id.clone();
        let request = v1::GetMeshRequest { session_id: id.clone(), revision: 3, ..Default::default() };
        let mesh = caller.mesh(request).await.unwrap();
        all.push((session, caller.log(&id).await, caller.reference(&id).await.ok(), mesh));
    }
    all
}

/// A log with sessions of all kinds, in this folder.
async fn filled() -> (Server, Vec<(v1::Session, Vec<v1::Event>, Option<v1::Reference>, v1::Mesh)>) {
    let server = Server::on(Location::File("palpate.db".into())).await;
    let caller = server.caller(Transport::Grpc);
    for name in ["mug", "pot", "can"] {
        let next = caller.begin(name).await;
        caller.go_on(name, next, 4).await;
    }
    caller.set_reference(keep_ball("pot")).await.unwrap();
    let labels = [("colour".to_owned(), "red".to_owned())].into();
    let fork = v1::ForkSessionRequest {
        session_id: "pot".into(),
        new_session_id: "copy".into(),
        request_id: "fork".into(),
        labels,
        ..Default::default()
    };
    caller.fork(fork).await.unwrap();
    let all = everything(&caller).await;
    (server, all)
}

#[tokio::test]
async fn a_log_comes_to_postgresql_and_back_with_the_same_links() {
    let Some(installation) = Installation::find() else { return };
    let postgres = installation.start(&[]).await;
    let there = address(&postgres.url(), "palpate").await;
    let (server, before) = filled().await;
    let folder = server.stop().await;
    let tokens = issue_in_a_file(&folder).await;

    // Interrupted after the second session, and given again.
    let from = Location::File(folder.path().join("palpate.db"));
    let to: Location = there.parse().unwrap();
    let interrupted = {
        let (from, to) = (from.clone(), to.clone());
        let (reached, hears) = tokio::sync::watch::channel(0);
        let moving = tokio::spawn(async move {
            let hear = move |step: Progress| {
                if let Progress::Copied(events, _) = step {
                    reached.send_replace(events);
                }
            };
            migrate(&from, &to, &hear).await
        });
        let mut hears = hears;
        let _ = hears.wait_for(|events| *events > 6).await;
        moving.abort();
        moving.await
    };
    let is_whole = interrupted.is_ok();
    let moved = run(folder.path(), &["migrate", "--from", "palpate.db", "--to", &there]).await;
    assert_eq!(moved.code, Some(0), "{}", moved.err);
    assert!(moved.out.contains("of 4 sessions") && moved.out.contains("all links followed"), "{}", moved.out);
    assert!(is_whole || !moved.out.contains(" 0 of which were there already"), "{}", moved.out);

    let server = Server::on(to.clone()).await;
    assert_eq!(everything(&server.caller(Transport::Grpc)).await, before);
    let client = palpate_client::Client::builder(&server.url()).connect().await.unwrap();
    let retried = client.create_session(creation("mug")).await.unwrap();
    assert_eq!(retried.session_id, "mug", "the retry of a creation is known there, too");
    // It goes on there, and what is new is brought back.
    let candidates = server.grpc().propose(question("can", 1)).await.unwrap().candidates;
    server.grpc().report(report("can", miss(&candidates[0]), "later")).await.unwrap();
    let expected = everything(&server.grpc()).await;
    server.stop().await;
    let back = run(folder.path(), &["migrate", "--from", &there, "--to", "palpate.db"]).await;
    assert_eq!(back.code, Some(0), "{}", back.err);
    assert!(
        back.out.starts_with("1 event written of 4 sessions, 3 of which were there already"),
        "{}",
        back.out
    );
    let elsewhere = run(folder.path(), &["migrate", "--from", &there, "--to", "new.db"]).await;
    assert_eq!(elsewhere.code, Some(0), "{}", elsewhere.err);
    for file in ["palpate.db", "new.db"] {
        let server = Server::on(Location::File(folder.path().join(file))).await;
        assert_eq!(everything(&server.grpc()).await, expected, "{file}");
        server.stop().await;
    }
    let listed = run(folder.path(), &["token", "list", "--database", &there]).await;
    assert!(listed.out.contains("arm-1"), "{}", listed.out);
    drop(tokens);

    // Another session of the same id is left alone.
    let other = Server::on(Location::File(folder.path().join("other.db"))).await;
    other.grpc().begin("mug").await;
    other.stop().await;
    let refused = migrate(&Location::File(folder.path().join("other.db")), &to, &|_| ()).await.unwrap_err();
    assert!(matches!(&refused, MigrateError::Another(session) if session == "mug"), "{refused}");
}

async fn issue_in_a_file(folder: &tempfile::TempDir) -> String {
    let made = run(folder.path(), &["token", "create", "--database", "palpate.db", "--name", "arm-1"]).await;
    assert_eq!(made.code, Some(0), "{}", made.err);
    made.out
}
