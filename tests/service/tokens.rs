//! The life of a token: made and revoked while the server runs, its limits, its tickets, and its name in each event.

use std::time::Duration;

use palpate_client::Error;
use palpate_proto::v1;
use palpate_server::access::{NewToken, Scope};
use palpate_server::{Limits, ServeOptions};
use serde_json::{Value, json};

use crate::harness::{
    EventStream, Guarded, Process, Server, accepted, cap, creation, header, issue, new_token, send, soon,
};

#[tokio::test]
async fn a_server_that_asks_and_whom_nobody_could_answer_does_not_start() {
    let folder = tempfile::tempdir().unwrap();
    let options = ServeOptions {
        database: folder.path().join("palpate.db").into(),
        require_tokens: true,
        ..ServeOptions::default()
    };
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let refused = palpate_server::serve(listener, options, tokio_util::sync::CancellationToken::new()).await;
    let text = refused.unwrap_err().to_string();
    assert!(text.contains("palpate token create") && text.contains("--insecure-open"), "{text}");
}

#[tokio::test]
async fn every_event_says_who_sent_it() {
    let server = Guarded::start(&[new_token("arm-1", Scope::Robot), new_token("arm-2", Scope::Robot)]).await;
    let first = server.client("arm-1").await;
    first.create_session(creation("ball")).await.unwrap();
    let view =
        v1::AddVisualPriorRequest { session_id: "ball".to_owned(), prior: Some(cap()), ..Default::default() };
    server.client("arm-2").await.add_visual_prior(view).await.unwrap();
    let request = v1::ListEventsRequest { session_id: "ball".to_owned(), ..Default::default() };
    let events = first.list_events(request).await.unwrap().events;
    let id = |name: &str| server.tokens[name].split('_').nth(1).unwrap().to_owned();
    let actors: Vec<&str> = events.iter().map(|event| event.actor.as_str()).collect();
    assert_eq!(actors, [format!("arm-1/{}", id("arm-1")), format!("arm-2/{}", id("arm-2"))]);
}

#[tokio::test]
async fn what_a_token_has_open_ends_when_it_is_revoked() {
    let server = Guarded::start(&[new_token("arm", Scope::Robot), new_token("wall", Scope::Read)]).await;
    server.client("arm").await.create_session(creation("ball")).await.unwrap();
    let wall = server.client("wall").await;
    let request = v1::WatchSessionRequest { session_id: "ball".to_owned(), ..Default::default() };
    let mut watch = wall.watch_session(request).await.unwrap();
    assert!(soon("the creation", watch.next()).await.unwrap().is_some());
    let mut events = server.http("wall").events("ball", None).await;
    assert!(events.next().await.is_some());
    server.revoke("wall").await;
    let ended = loop {
        match soon("the end of the watch", watch.next()).await {
            Ok(Some(_)) => {}
            other => break other,
        }
    };
    assert!(matches!(&ended, Err(error) if error.reason() == "TOKEN_INVALID"), "{ended:?}");
    soon("the end of the events", events.ended()).await;
    let refused = wall.get_session("ball").await.unwrap_err();
    assert_eq!(refused.reason(), "TOKEN_INVALID");
    server.client("arm").await.get_session("ball").await.unwrap();
}

#[tokio::test]
async fn a_token_made_while_the_server_runs_counts_at_once() {
    let server = Guarded::start(&[new_token("first", Scope::Robot)]).await;
    let mut tokens = palpate_server::access::Tokens::open(
        &crate::harness::database::location(&server.server.folder().join("palpate.db")).await,
    )
    .await
    .unwrap();
    let second = tokens.create(&new_token("second", Scope::Read)).await.unwrap().token;
    tokio::time::sleep(Duration::from_millis(150)).await;
    accepted(server.anonymous().with_token(&second).get("/v1/sessions")).await.unwrap();
}

#[tokio::test]
async fn a_ticket_opens_one_request_for_reading_and_is_nothing_to_a_call_that_changes() {
    let server = Guarded::start(&[new_token("arm", Scope::Robot)]).await;
    let http = server.http("arm");
    server.client("arm").await.create_session(creation("ball")).await.unwrap();
    let ticket = async || -> String {
        let response = accepted(http.post("/v1/tickets", &json!({}))).await.unwrap();
        assert_eq!(response.status(), 201);
        let body: Value = response.json().await.unwrap();
        assert_eq!(body["expires_in_s"], 60);
        body["ticket"].as_str().unwrap().to_owned()
    };
    let path = format!("/v1/sessions/ball/events?after_revision=0&ticket={}", ticket().await);
    let request = server.anonymous().get(&path).header("accept", "text/event-stream");
    let mut stream = EventStream::from(accepted(request).await.unwrap());
    assert_eq!(stream.next().await.unwrap().name, "created");
    let again = accepted(server.anonymous().get(&path)).await.unwrap_err();
    assert_eq!(again.reason, "TOKEN_INVALID");
    assert!(again.message.contains("POST /v1/tickets"), "{}", again.message);
    let path = format!("/v1/sessions?ticket={}", ticket().await);
    let refused = accepted(server.anonymous().post(&path, &json!({}))).await.unwrap_err();
    assert_eq!(refused.reason, "TOKEN_MISSING", "a ticket is for GET");
    // A server that asks nobody takes them as well, so that a page need not know.
    let open = Server::start().await;
    accepted(open.http().post("/v1/tickets", &json!({}))).await.unwrap();
    accepted(open.http().get("/v1/sessions?ticket=anything")).await.unwrap();
}

#[tokio::test]
async fn a_token_has_no_more_sessions_and_bytes_than_it_may_and_gets_them_back_by_deleting() {
    let few = NewToken { most_sessions: Some(2), ..new_token("few", Scope::Operate) };
    let small = NewToken { most_bytes: Some(20_000), ..new_token("small", Scope::Robot) };
    let server = Guarded::start(&[few, small, new_token("any", Scope::Robot)]).await;
    let client = server.client("few").await;
    for name in ["aaa", "bbb"] {
        client.create_session(creation(name)).await.unwrap();
    }
    let refused = client.create_session(creation("ccc")).await.unwrap_err();
    assert_eq!(refused.reason(), "QUOTA");
    assert!(refused.to_string().contains("2 sessions of this token"), "{refused}");
    let fork = v1::ForkSessionRequest { session_id: "aaa".to_owned(), ..Default::default() };
    assert_eq!(client.fork_session(fork).await.unwrap_err().reason(), "QUOTA");
    let delete = v1::DeleteSessionRequest { session_id: "aaa".to_owned(), ..Default::default() };
    client.delete_session(delete).await.unwrap();
    client
        .create_session(v1::CreateSessionRequest { request_id: "again".to_owned(), ..creation("ccc") })
        .await
        .unwrap();
    server.client("any").await.create_session(creation("ddd")).await.unwrap();

    let client = server.client("small").await;
    client.create_session(creation("sss")).await.unwrap();
    let mut added = 0;
    let refused = loop {
        let view = v1::AddVisualPriorRequest {
            session_id: "sss".to_owned(),
            prior: Some(cap()),
            ..Default::default()
        };
        match client.add_visual_prior(view).await {
            Ok(_) => added += 1,
            Err(error) => break error,
        }
        assert!(added < 100, "20 kB hold no hundred views");
    };
    assert_eq!(refused.reason(), "QUOTA", "{refused}");
    assert!(refused.to_string().contains("20000 bytes"), "{refused}");
    assert_eq!(client.get_session("sss").await.unwrap().revision, 1 + added, "nothing was changed");
}

#[tokio::test]
async fn a_caller_makes_sessions_only_where_it_may() {
    let kept = NewToken { experiments: Some("mugs".to_owned()), ..new_token("kept", Scope::Operate) };
    let server = Guarded::start(&[kept, new_token("any", Scope::Operate)]).await;
    let client = server.client("kept").await;
    let of = |id: &str, experiment: &str| v1::CreateSessionRequest {
        experiment: experiment.to_owned(),
        ..creation(id)
    };
    for experiment in ["", "cups", "MUGS"] {
        let refused = client.create_session(of("xxx", experiment)).await.unwrap_err();
        assert_eq!(refused.reason(), "SCOPE_DENIED", "{experiment}");
        assert!(refused.to_string().contains("\"mugs\""), "{refused}");
    }
    client.create_session(of("mine", "mugs-2026")).await.unwrap();
    let fork = |experiment: &str| v1::ForkSessionRequest {
        session_id: "mine".to_owned(),
        experiment: experiment.to_owned(),
        ..Default::default()
    };
    assert_eq!(client.fork_session(fork("cups")).await.unwrap_err().reason(), "SCOPE_DENIED");
    client.fork_session(fork("")).await.unwrap();
    let any = server.client("any").await;
    any.create_session(of("theirs", "cups")).await.unwrap();
    let export = accepted(server.http("any").get("/v1/sessions/theirs/export?format=bundle")).await.unwrap();
    let bundle = export.bytes().await.unwrap();
    let delete = v1::DeleteSessionRequest { session_id: "theirs".to_owned(), ..Default::default() };
    any.delete_session(delete).await.unwrap();
    let import = server.http("kept").request(reqwest::Method::POST, "/v1/imports");
    let refused =
        accepted(import.header("content-type", "application/x-tar").body(bundle)).await.unwrap_err();
    assert_eq!(refused.reason, "SCOPE_DENIED");
    let all = client.list_sessions(v1::ListSessionsRequest::default()).await.unwrap().sessions;
    assert!(all.len() == 2 && all.iter().all(|session| session.experiment == "mugs-2026"), "{all:?}");
}

#[tokio::test]
async fn a_reader_may_look_for_candidates_and_not_hold_them() {
    let server = Guarded::start(&[new_token("arm", Scope::Robot), new_token("wall", Scope::Read)]).await;
    let arm = server.client("arm").await;
    arm.create_session(creation("ball")).await.unwrap();
    let view =
        v1::AddVisualPriorRequest { session_id: "ball".to_owned(), prior: Some(cap()), ..Default::default() };
    arm.add_visual_prior(view).await.unwrap();
    let question =
        v1::ProposeContactsRequest { session_id: "ball".to_owned(), top_k: 1, ..Default::default() };
    let wall = server.client("wall").await;
    assert_eq!(wall.propose_contacts(question.clone()).await.unwrap().candidates.len(), 1);
    let lease = Some(prost_types::Duration { seconds: 10, nanos: 0 });
    let refused = wall.propose_contacts(v1::ProposeContactsRequest { lease, ..question }).await.unwrap_err();
    assert_eq!(refused.reason(), "SCOPE_DENIED");
}

#[tokio::test]
async fn failed_attempts_are_answered_later_and_later_and_a_valid_token_is_not() {
    let limits = Limits { refused_wait: Duration::from_millis(400), ..Limits::default() };
    let options = ServeOptions { limits, ..ServeOptions::default() };
    let server = Guarded::with_options(&[new_token("arm", Scope::Robot)], options).await;
    let began = std::time::Instant::now();
    for _ in 0..8 {
        let refused = accepted(server.anonymous().get("/v1/sessions")).await.unwrap_err();
        assert_eq!(refused.reason, "TOKEN_MISSING");
    }
    // 0, 0, 0, 50, 100, 200, 400, 400: no load makes a wait shorter.
    assert!(began.elapsed() >= Duration::from_millis(1150), "{:?}", began.elapsed());
    let waiting = tokio::spawn(send(server.anonymous().get("/v1/sessions")));
    accepted(server.http("arm").get("/v1/sessions")).await.unwrap();
    assert!(!waiting.is_finished(), "who has a token is answered before");
    let refused = waiting.await.unwrap();
    let metrics = accepted(server.http("arm").get("/metrics")).await.unwrap().text().await.unwrap();
    assert!(
        metrics.contains("palpate_unknown_callers_total{reason=\"TOKEN_MISSING\"} 9"),
        "they are counted"
    );
    assert_eq!(header(&refused, "www-authenticate"), "Bearer realm=\"palpate\"");
}

#[tokio::test]
async fn a_page_of_an_allowed_origin_may_ask_before_it_has_a_token() {
    let options = ServeOptions {
        allowed_origins: vec!["https://lab.example".parse().unwrap()],
        ..ServeOptions::default()
    };
    let server = Guarded::with_options(&[new_token("wall", Scope::Read)], options).await;
    let preflight = server.anonymous().request(reqwest::Method::OPTIONS, "/v1/sessions");
    let preflight = preflight.header("origin", "https://lab.example");
    let preflight = preflight.header("access-control-request-method", "GET");
    let answer = send(preflight.header("access-control-request-headers", "authorization")).await;
    assert_eq!(header(&answer, "access-control-allow-origin"), "https://lab.example");
    assert_eq!(header(&answer, "access-control-allow-headers"), "authorization");
    let refused = send(server.anonymous().get("/v1/sessions").header("origin", "https://lab.example")).await;
    assert_eq!(refused.status(), 401);
    assert_eq!(
        header(&refused, "access-control-allow-origin"),
        "https://lab.example",
        "so that it can read why"
    );
    // Its body is not read, so that a caller is told to send nothing more on that connection.
    let unread = send(server.anonymous().post("/v1/sessions", &json!({"session_id": "mug"}))).await;
    assert_eq!((unread.status().as_u16(), header(&unread, "connection")), (401, "close"));
    assert!(refused.headers().get("connection").is_none(), "nothing was sent beside its head");
    for open in ["/", "/healthz", "/livez", "/readyz", "/openapi.json", "/docs/"] {
        assert_eq!(send(server.anonymous().get(open)).await.status(), 200, "{open}");
    }
    let mut health = tonic_health::pb::health_client::HealthClient::new(server.server.channel());
    soon("an answer", health.check(tonic_health::pb::HealthCheckRequest::default())).await.unwrap();
}

#[tokio::test]
async fn secrets_are_neither_in_the_log_nor_in_the_database() {
    let folder = tempfile::tempdir().unwrap();
    let tokens = issue(&folder, &[new_token("arm", Scope::Robot)]).await;
    let secret = tokens["arm"].rsplit('_').next().unwrap().to_owned();
    let database = folder.path().join("palpate.db");
    let process = Process::serve_logging(&database, "trace", |command| {
        command.arg("--require-tokens");
    })
    .await;
    let http = process.http().with_token(&tokens["arm"]);
    accepted(http.post("/v1/sessions", &json!({ "session_id": "ball" }))).await.unwrap();
    let ticket: Value = accepted(http.post("/v1/tickets", &json!({}))).await.unwrap().json().await.unwrap();
    let ticket = ticket["ticket"].as_str().unwrap().to_owned();
    accepted(process.http().get(&format!("/v1/sessions?ticket={ticket}"))).await.unwrap();
    let wrong = process.http().with_token(&format!("palpate_0123456789ab_{}", "5ec4e7".repeat(11)));
    accepted(wrong.get("/v1/sessions")).await.unwrap_err();
    let client =
        palpate_client::Client::builder(&process.url()).token(&tokens["arm"]).connect().await.unwrap();
    client.get_session("ball").await.unwrap();
    // The last line is written before the last answer is sent, and read a little later.
    let log = soon("the log", async {
        while !process.log().contains("GetSession") {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        process.log()
    })
    .await;
    assert!(log.contains("ball"), "the log says what happens: {log}");
    for secret in [&secret, &ticket, &"5ec4e7".repeat(11)] {
        assert!(!log.contains(secret.as_str()), "a secret is in the log");
    }
    for entry in std::fs::read_dir(folder.path()).unwrap() {
        let bytes = std::fs::read(entry.unwrap().path()).unwrap();
        assert!(!bytes.windows(secret.len()).any(|window| window == secret.as_bytes()));
    }
}

#[tokio::test]
async fn a_client_without_a_token_is_told_what_to_do_and_does_not_try_again() {
    let server = Guarded::start(&[new_token("arm", Scope::Robot)]).await;
    let client = palpate_client::Client::connect(&server.server.url()).await.unwrap();
    let Err(Error::Refused(refusal)) = client.create_session(creation("ball")).await else { panic!() };
    assert_eq!((refusal.reason.as_str(), refusal.attempts), ("TOKEN_MISSING", 1));
    assert!(refusal.message.contains("palpate token create"), "{}", refusal.message);
}
