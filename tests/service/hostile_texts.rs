//! Texts that are meant for whoever reads them later: ids of megabytes, names that forge lines of a log, bodies that
//! swell when they are parsed. They are refused by name before anything else is done with them.

use std::time::Duration;

use palpate_proto::v1;
use palpate_proto::v1::explore_request::Message as RequestMessage;
use palpate_proto::v1::explore_response::Message as ReplyMessage;
use reqwest::Method;
use tokio::process::Command;
use tokio_stream::StreamExt;
use tonic::Code;

use crate::harness::{
    Refused, Server, Transport, accepted, creation, miss, prior, question, reply, report, send, soon,
};

/// Insists that a refusal names this field and is short, whatever was sent.
#[track_caller]
fn check(refused: &Refused, field: &str) {
    assert_eq!((refused.reason.as_str(), &refused.fields[..]), ("FIELD_INVALID", &[field.to_owned()][..]));
    assert!(refused.message.len() < 500, "{} bytes", refused.message.len());
}

#[tokio::test]
async fn an_id_of_megabytes_is_refused_by_every_call_and_not_sent_back() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("ball").await;
    for id in ["x".repeat(15 << 20), "x".repeat(5000), "x".repeat(64), "\u{202e}\u{1b}[31m".to_owned()] {
        check(&caller.get(&id).await.unwrap_err(), "session_id");
        let named = v1::CreateSessionRequest { session_id: id.clone(), ..Default::default() };
        check(&caller.create(named).await.unwrap_err(), "session_id");
        check(&caller.propose(question(&id, 1)).await.unwrap_err(), "session_id");
        check(&caller.add_prior(prior(&id)).await.unwrap_err(), "session_id");
        check(&caller.report(report(&id, miss(&next), "long")).await.unwrap_err(), "session_id");
        let deletion = v1::DeleteSessionRequest { session_id: id.clone(), ..Default::default() };
        check(&caller.delete(deletion).await.unwrap_err(), "session_id");
        let events = v1::ListEventsRequest { session_id: id.clone(), ..Default::default() };
        check(&caller.events(events).await.unwrap_err(), "session_id");
        let mesh = v1::GetMeshRequest { session_id: id.clone(), ..Default::default() };
        check(&caller.mesh(mesh).await.unwrap_err(), "session_id");
        let watch = v1::WatchSessionRequest { session_id: id.clone(), ..Default::default() };
        let watched = caller.reconstruction().watch_session(watch).await.map(|_| ());
        check(&Refused::from_status(&watched.unwrap_err()), "session_id");

        let open = v1::ExploreOpen { session_id: id.clone(), ..Default::default() };
        let said =
            v1::ExploreRequest { id: 1, message: Some(RequestMessage::Open(open)), ..Default::default() };
        let mut heard = reply(caller.exploration().explore(tokio_stream::once(said))).await.unwrap();
        let heard = soon("an answer", heard.next()).await.unwrap().unwrap();
        let Some(ReplyMessage::Problem(problem)) = heard.message else { panic!("a problem") };
        assert_eq!(problem.fields[0].field, "open.session_id");
        assert!(problem.message.len() < 500);
    }
    let over_http = server.caller(Transport::Http);
    check(&over_http.get(&"x".repeat(5000)).await.unwrap_err(), "session_id");
    assert_eq!(over_http.get("Nobody_1.x").await.unwrap_err().reason, "SESSION_NOT_FOUND");
}

#[tokio::test]
async fn other_ids_and_tokens_of_megabytes_are_refused_by_name() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("ball").await;
    let long = || "x".repeat(15 << 20);
    let named = v1::CreateSessionRequest { request_id: long(), ..creation("mug") };
    check(&caller.create(named).await.unwrap_err(), "request_id");
    let deletion = v1::DeleteSessionRequest { session_id: "ball".into(), etag: long(), ..Default::default() };
    check(&caller.delete(deletion).await.unwrap_err(), "etag");
    for page in [
        (v1::ListSessionsRequest { page_token: long(), ..Default::default() }, "page_token"),
        (v1::ListSessionsRequest { experiment: long(), ..Default::default() }, "experiment"),
    ] {
        check(&caller.list(page.0).await.unwrap_err(), page.1);
    }
    let events =
        v1::ListEventsRequest { session_id: "ball".into(), page_token: long(), ..Default::default() };
    check(&caller.events(events).await.unwrap_err(), "page_token");
    let aimed = v1::ContactResult { candidate_id: long(), ..miss(&next) };
    check(&caller.report(report("ball", aimed, "aimed")).await.unwrap_err(), "result.candidate_id");
    let contact = v1::Contact { sensor_id: long(), ..Default::default() };
    let outcome = v1::contact_result::Outcome::Contact(contact);
    let felt = v1::ContactResult { outcome: Some(outcome), ..miss(&next) };
    check(&caller.report(report("ball", felt, "felt")).await.unwrap_err(), "result.contact.sensor_id");
    let sensors = vec![v1::Sensor { id: long(), ..Default::default() }; 1];
    let config = Some(v1::SessionConfig { sensors, ..Default::default() });
    let padded = v1::CreateSessionRequest { config, ..creation("mug") };
    check(&caller.create(padded).await.unwrap_err(), "config.sensors[0].id");
}

#[tokio::test]
async fn characters_that_nobody_sees_are_refused_by_name_over_both_transports() {
    let server = Server::start().await;
    let next = server.grpc().begin("ball").await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        for hidden in
            ["a\nb", "a\u{1b}[2Jb", "a\0b", "a\u{7f}", "a\u{9b}", "a\u{202e}b", "\u{2066}a", "a\u{200f}"]
        {
            let bad = || hidden.to_owned();
            let mug = || v1::CreateSessionRequest { request_id: String::new(), ..creation("mug") };
            let labelled = |name: &str, value: &str| v1::CreateSessionRequest {
                labels: [(name.to_owned(), value.to_owned())].into(),
                ..mug()
            };
            for (request, field) in [
                (v1::CreateSessionRequest { display_name: bad(), ..mug() }, "display_name"),
                (v1::CreateSessionRequest { experiment: bad(), ..mug() }, "experiment"),
                (v1::CreateSessionRequest { frame_id: bad(), ..mug() }, "frame_id"),
                (v1::CreateSessionRequest { request_id: bad(), ..mug() }, "request_id"),
                (v1::CreateSessionRequest { session_id: bad(), ..mug() }, "session_id"),
                (labelled(hidden, "value"), "labels"),
                (labelled("name", hidden), "labels[name]"),
            ] {
                let refused = caller.create(request).await.unwrap_err();
                check(&refused, field);
                assert!(!refused.message.chars().any(char::is_control), "{:?}", refused.message);
            }
            let robot = v1::ContactResult { robot_id: bad(), ..miss(&next) };
            check(&caller.report(report("ball", robot, "robot")).await.unwrap_err(), "result.robot_id");
            let robot = Some(v1::RobotContext { robot_id: bad(), ..Default::default() });
            let asked = v1::ProposeContactsRequest { robot, ..question("ball", 1) };
            check(&caller.propose(asked).await.unwrap_err(), "robot.robot_id");
        }
        let plain = v1::CreateSessionRequest {
            display_name: "Süße Tasse 杯子 🫖".into(),
            ..creation(&format!("mug-{}", transport.name()))
        };
        caller.create(plain).await.unwrap();
    }
}

#[tokio::test]
async fn no_caller_can_forge_a_line_of_the_log_or_fill_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log");
    let log = std::fs::File::create(&path).unwrap();
    let mut server = Command::new(env!("CARGO_BIN_EXE_palpate-under-test"))
        .args(["--log", "info", "serve", "--listen", "127.0.0.1:0", "--database"])
        .arg(folder.path().join("palpate.db"))
        .stderr(log)
        .kill_on_drop(true)
        .spawn()
        .unwrap();
    let read = || std::fs::read_to_string(&path).unwrap();
    let address = soon("the server's log", async {
        loop {
            let log = read();
            let rest =
                log.split_once("http://127.0.0.1:").map(|(_, rest)| rest.to_owned()).unwrap_or_default();
            let port: String = rest.chars().take_while(char::is_ascii_digit).collect();
            if port.len() < rest.len() && !port.is_empty() {
                return format!("http://127.0.0.1:{port}");
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    })
    .await;
    let forged = "mug\nFORGED \u{1b}[31m\u{202e}".to_owned();
    let channel = tonic::transport::Channel::from_shared(address).unwrap().connect().await.unwrap();
    let mut sessions = v1::session_service_client::SessionServiceClient::new(channel);
    for session_id in [forged.clone(), "x".repeat(15 << 20), "x".repeat(5000)] {
        let code = async |call: Result<tonic::Response<v1::Session>, tonic::Status>| call.unwrap_err().code();
        let get = v1::GetSessionRequest { session_id: session_id.clone() };
        assert_eq!(code(sessions.get_session(get).await).await, Code::InvalidArgument);
        let create = v1::CreateSessionRequest { session_id: session_id.clone(), ..Default::default() };
        assert_eq!(code(sessions.create_session(create).await).await, Code::InvalidArgument);
        let labels = [(session_id, forged.clone())].into();
        let create = v1::CreateSessionRequest { labels, ..Default::default() };
        assert_eq!(code(sessions.create_session(create).await).await, Code::InvalidArgument);
    }
    server.kill().await.unwrap();
    let log = read();
    assert!(log.contains("FIELD_INVALID") && log.contains("FORGED"), "{log}");
    assert!(log.lines().all(|line| !line.starts_with("FORGED")), "{log}");
    assert!(!log.contains("[31m\u{202e}") && !log.contains("\u{1b}[31mFORGED"), "{log}");
    assert!(log.len() < 20_000, "{} bytes of log", log.len());
}

#[tokio::test]
async fn a_json_name_of_megabytes_is_not_sent_back() {
    let server = Server::start().await;
    server.grpc().create(creation("ball")).await.unwrap();
    let long = "k".repeat(4 << 20 >> 1);
    for (path, body) in [
        ("/v1/sessions", format!("{{\"{long}\":1}}")),
        ("/v1/sessions", format!("{{\"config\":{{\"method\":\"{long}\"}}}}")),
        ("/v1/sessions", format!("{{\"labels\":{{\"{long}\":1}}}}")),
        ("/v1/sessions/ball/priors", format!("{{\"prior\":{{\"{long}\":1}}}}")),
        ("/v1/sessions/ball/contacts", format!("{{\"session_id\":\"{long}\"}}")),
    ] {
        let sent = server.http().request(Method::POST, path).header("content-type", "application/json");
        let answer = send(sent.body(body)).await;
        assert_eq!(answer.status(), 422, "{path}");
        let text = answer.text().await.unwrap();
        assert!(text.len() < 4096 && text.contains("FIELD_INVALID"), "{path}: {} bytes", text.len());
    }
}

#[tokio::test]
async fn json_that_swells_when_it_is_parsed_is_refused_with_the_limit_and_a_large_cloud_is_not() {
    let server = Server::start().await;
    server.grpc().create(creation("ball")).await.unwrap();
    for part in ["{\"\":0},", "{},", "[0],"] {
        let parts = part.repeat((4 << 20) / part.len() - 4);
        let sent = server.http().request(Method::POST, "/v1/sessions/ball/priors");
        let sent = sent.header("content-type", "application/json").body(format!("{{\"prior\":[{parts}0]}}"));
        let refused = accepted(sent).await.unwrap_err();
        assert_eq!(refused.reason, "TOO_LARGE");
        assert!(refused.message.contains("over the limit of"), "{}", refused.message);
    }
    // 100,000 points of a ball's cap as a script writes them.
    let points = (0..100_000_u32).map(|i| {
        let (around, up) = (2.4 * f64::from(i), 1.0 - 0.35 * f64::from(i) / 1e5);
        let across = (1.0 - up * up).sqrt();
        [0.05 * up, 0.05 * across * around.cos(), 0.3 + 0.05 * across * around.sin()]
    });
    let points: Vec<String> = points.map(|[x, y, z]| format!("[{x:.6},{y:.6},{z:.6}]")).collect();
    let body = format!("{{\"prior\":{{\"points\":[{}]}}}}", points.join(","));
    let sent = server.http().request(Method::POST, "/v1/sessions/ball/priors");
    accepted(sent.header("content-type", "application/json").body(body)).await.unwrap();
    assert_eq!(server.grpc().get("ball").await.unwrap().revision, 2);
}

#[tokio::test]
async fn bytes_that_are_no_message_are_an_invalid_argument() {
    let server = Server::start().await;
    for (method, bytes) in [
        ("SessionService/GetSession", &b"\xff\xff\xff"[..]),
        ("SessionService/CreateSession", &b"\x0a\x7fshort"[..]),
        ("ExplorationService/ReportContact", &b"\x0a\x02\xff\xfe"[..]),
        ("ReconstructionService/GetMesh", &b"\x08\x01"[..]),
    ] {
        let length = u32::try_from(bytes.len()).unwrap().to_be_bytes();
        let frame = [&[0][..], &length, bytes].concat();
        let sent = server
            .http()
            .request(Method::POST, &format!("/palpate.v1.{method}"))
            .header("content-type", "application/grpc-web+proto")
            .body(frame);
        let answer = send(sent).await;
        let status = tonic::Status::from_header_map(answer.headers()).unwrap();
        let refused = Refused::from_status(&status);
        check(&refused, "message");
        assert!(refused.message.contains("failed to decode"), "{method}: {}", refused.message);
    }
}
