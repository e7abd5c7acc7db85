//! A session leaves one server as a file and comes to another one as it was, or under another name.

use std::path::Path;
use std::process::Command;

use palpate_proto::FieldMask;
use palpate_proto::v1;
use palpate_proto::v1::ArchiveFormat::{Bundle, Csv, Mcap};
use reqwest::Method;

use crate::harness::bundle::Members;
use crate::harness::{
    Caller, Process, Server, Transport, accepted, creation, header, miss, report, send, touch, without_timing,
};

/// A session with one of each: a view, touches, a miss, a retraction, a lease, other names.
async fn eventful(caller: &Caller, name: &str) -> v1::Session {
    let next = caller.begin(name).await;
    let next = caller.go_on(name, next, 2).await;
    let next = caller.report(report(name, miss(&next), "miss")).await.unwrap().candidates.remove(0);
    caller.report(report(name, touch(&next, 0.02), "wrong")).await.unwrap();
    let retraction = v1::RetractEventRequest {
        session_id: name.into(),
        seq: 6,
        reason: "the cable".into(),
        request_id: "retract".into(),
    };
    caller.retract(retraction).await.unwrap();
    let lease = v1::ProposeContactsRequest {
        session_id: name.into(),
        top_k: 1,
        robot: Some(v1::RobotContext { robot_id: "left".into(), ..Default::default() }),
        lease: Some(palpate_proto::Duration { seconds: 60, nanos: 0 }),
        request_id: "lease".into(),
        ..Default::default()
    };
    let next = caller.propose(lease).await.unwrap().candidates.remove(0);
    let mut session = caller.get(name).await.unwrap();
    session.display_name = "A mug".into();
    session.labels = [("object".to_owned(), "mug".to_owned())].into();
    let paths = vec!["display_name".to_owned(), "labels".to_owned()];
    let update = v1::UpdateSessionRequest {
        session: Some(session),
        update_mask: Some(FieldMask { paths }),
        request_id: "names".into(),
    };
    caller.update(update).await.unwrap();
    caller.go_on(name, next, 1).await;
    caller.get(name).await.unwrap()
}

/// The log with all that is kept of each event, points included.
async fn log(caller: &Caller, name: &str) -> Vec<v1::Event> {
    let request = v1::ListEventsRequest {
        session_id: name.into(),
        page_size: 100,
        include_points: true,
        ..Default::default()
    };
    caller.events(request).await.unwrap().events
}

async fn replays(caller: &Caller, name: &str) -> usize {
    let request = v1::ReplaySessionRequest { session_id: name.into(), verify: true, ..Default::default() };
    let steps = caller.replay(request).await.unwrap();
    assert!(steps.iter().all(|step| step.hash_matches), "{name}");
    steps.len()
}

fn named(session_id: &str) -> v1::CreateSessionRequest {
    v1::CreateSessionRequest { session_id: session_id.into(), ..Default::default() }
}

#[tokio::test]
async fn a_bundle_of_a_server_that_was_killed_is_the_same_session_on_another_one() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let first = Process::serve(&database).await;
    let session = eventful(&first.caller(Transport::Grpc), "mug").await;
    first.kill().await;
    let again = Process::serve(&database).await;
    for transport in Transport::BOTH {
        let caller = again.caller(transport);
        let bundle = caller.export("mug", Bundle, 0).await.unwrap();
        assert_eq!(bundle, caller.export("mug", Bundle, 0).await.unwrap(), "it is the same file each time");
        let server = Server::start().await;
        let other = server.caller(transport);
        let imported = other.import(named(""), &bundle).await.unwrap();
        assert_eq!(without_timing(imported.clone()), without_timing(session.clone()));
        assert_eq!(log(&other, "mug").await, log(&caller, "mug").await);
        assert_eq!(replays(&other, "mug").await, session.revision as usize);
        assert_eq!(other.export("mug", Bundle, 0).await.unwrap(), bundle, "byte for byte");
        // What was asked before is still known, and the session goes on.
        let (server, retried) = (server.restart().await, report("mug", v1::ContactResult::default(), "miss"));
        let other = server.caller(transport);
        assert_eq!(other.report(retried).await.unwrap_err().reason, "REQUEST_ID_REUSED");
        let question = v1::ProposeContactsRequest { session_id: "mug".into(), ..Default::default() };
        let next = other.propose(question).await.unwrap().candidates.remove(0);
        other.go_on("mug", next, 1).await;
        assert_eq!(replays(&other, "mug").await, session.revision as usize + 1);
        let label = [("object".to_owned(), "mug".to_owned())].into();
        let found =
            other.list(v1::ListSessionsRequest { labels: label, ..Default::default() }).await.unwrap();
        assert_eq!(found.sessions.len(), 1, "lists know its labels");
    }
}

#[tokio::test]
async fn ordinary_tools_open_a_bundle_and_find_it_whole() {
    let server = Server::start().await;
    let caller = server.grpc();
    let session = eventful(&caller, "mug").await;
    let bundle = caller.export("mug", Bundle, 0).await.unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mug.palpate.tar");
    std::fs::write(&file, &bundle).unwrap();
    let list = run(folder.path(), "tar", &["tf", "mug.palpate.tar"]);
    let names: Vec<&str> = list.lines().collect();
    assert_eq!(names[..3], ["manifest.json", "session.json", "log/000001.pb"]);
    assert_eq!(names[names.len() - 3..], ["attempts.csv", "mesh.ply", "SHA256SUMS"]);
    assert_eq!(names.len() as i64, 5 + session.revision);
    run(folder.path(), "tar", &["xf", "mug.palpate.tar"]);
    let checked = run(folder.path(), "sha256sum", &["-c", "SHA256SUMS"]);
    assert_eq!(checked.lines().filter(|line| line.ends_with(": OK")).count(), names.len() - 1);
    let manifest: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("manifest.json")).unwrap()).unwrap();
    assert_eq!((&manifest["format"], &manifest["version"]), (&"palpate-bundle".into(), &1.into()));
    assert_eq!((&manifest["session_id"], &manifest["revision"]), (&"mug".into(), &session.revision.into()));
    let mesh = caller.mesh(v1::GetMeshRequest {
        session_id: "mug".into(),
        format: v1::MeshFormat::Ply.into(),
        ..Default::default()
    });
    let Some(v1::mesh::Body::File(mesh)) = mesh.await.unwrap().body else { panic!("a file") };
    assert_eq!(std::fs::read(folder.path().join("mesh.ply")).unwrap(), mesh);
}

fn run(folder: &Path, program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{program}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[tokio::test]
async fn an_earlier_revision_is_the_session_as_it_was_then() {
    let server = Server::start().await;
    eventful(&server.grpc(), "mug").await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let other = Server::start().await;
        let other = other.caller(transport);
        // The event that is retracted later counts here.
        let bundle = caller.export("mug", Bundle, 6).await.unwrap();
        let imported = other.import(named(""), &bundle).await.unwrap();
        assert_eq!((imported.revision, imported.stats.unwrap().attempts), (6, 4));
        assert_eq!(replays(&other, "mug").await, 6);
        // There is no surface yet.
        let first = caller.export("mug", Bundle, 1).await.unwrap();
        let names = ["manifest.json", "session.json", "log/000001.pb", "attempts.csv"];
        assert_eq!(Members::of(&first).names(), names);
        for (revision, field) in [(-1, "revision"), (99, "revision")] {
            assert_eq!(caller.export("mug", Bundle, revision).await.unwrap_err().fields, [field]);
        }
        assert_eq!(caller.export("nobody", Csv, 0).await.unwrap_err().reason, "SESSION_NOT_FOUND");
    }
}

#[tokio::test]
async fn under_another_name_it_is_a_fork_of_the_one_in_the_bundle() {
    let server = Server::start().await;
    let session = eventful(&server.grpc(), "mug").await;
    let finish = v1::FinishSessionRequest { session_id: "mug".into(), ..Default::default() };
    let finished = server.grpc().finish(finish).await.unwrap();
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let bundle = caller.export("mug", Bundle, 0).await.unwrap();
        let taken = caller.import(named(""), &bundle).await.unwrap_err();
        assert_eq!(taken.reason, "SESSION_EXISTS");
        assert!(taken.message.contains("give another session_id"), "{}", taken.message);

        let name = format!("copy-{}", transport.name());
        let header = v1::CreateSessionRequest {
            experiment: "again".into(),
            request_id: format!("import-{name}"),
            ..named(&name)
        };
        let fork = caller.import(header.clone(), &bundle).await.unwrap();
        assert_eq!((fork.session_id.as_str(), fork.experiment.as_str()), (name.as_str(), "again"));
        assert_eq!((fork.display_name.as_str(), &fork.labels), ("A mug", &session.labels));
        assert_eq!((fork.forked_from.as_str(), fork.forked_at_revision), ("mug", session.revision));
        assert_eq!(fork.state(), v1::SessionState::Active, "that it was finished is no part of a fork");
        assert_eq!(fork.retracted_seqs, finished.retracted_seqs);
        let hashes = |log: Vec<v1::Event>| log.into_iter().map(|event| event.state_hash).collect::<Vec<_>>();
        let parent = hashes(log(&caller, "mug").await);
        assert_eq!(hashes(log(&caller, &name).await), parent[..parent.len() - 1]);
        assert_eq!(replays(&caller, &name).await, session.revision as usize);

        assert_eq!(
            caller.import(header.clone(), &bundle).await.unwrap(),
            fork,
            "a retry is answered as before"
        );
        let shorter = caller.export("mug", Bundle, 4).await.unwrap();
        let reused = caller.import(header, &shorter).await.unwrap_err();
        assert_eq!(reused.reason, "REQUEST_ID_REUSED", "other bytes are another request");
        // Its ancestors are known to forks of it, too.
        let own = caller.export(&name, Bundle, 0).await.unwrap();
        let (id, name) = (format!("grandchild-{}", transport.name()), name);
        let grandchild = caller.import(named(&id), &own).await.unwrap();
        assert_eq!(grandchild.forked_from, name);
        assert_eq!(replays(&caller, &id).await, session.revision as usize);
    }
}

#[tokio::test]
async fn a_retried_import_is_answered_as_the_first_time_also_after_the_session_went_on() {
    let origin = Server::start().await;
    eventful(&origin.grpc(), "mug").await;
    let bundle = origin.grpc().export("mug", Bundle, 0).await.unwrap();
    for transport in Transport::BOTH {
        let server = Server::start().await;
        let caller = server.caller(transport);
        let header = v1::CreateSessionRequest { request_id: "import".into(), ..Default::default() };
        let first = caller.import(header.clone(), &bundle).await.unwrap();
        let question = v1::ProposeContactsRequest { session_id: "mug".into(), ..Default::default() };
        let next = caller.propose(question).await.unwrap().candidates.remove(0);
        caller.go_on("mug", next, 1).await;
        assert_eq!(caller.import(header.clone(), &bundle).await.unwrap(), first);
        let server = server.restart().await;
        let caller = server.caller(transport);
        assert_eq!(caller.import(header, &bundle).await.unwrap(), first);
        let another = v1::CreateSessionRequest { request_id: "import-2".into(), ..Default::default() };
        assert_eq!(caller.import(another, &bundle).await.unwrap_err().reason, "SESSION_EXISTS");
    }
}

#[tokio::test]
async fn the_table_has_a_row_for_each_attempt_with_what_the_api_says() {
    let server = Server::start().await;
    eventful(&server.grpc(), "mug").await;
    let named = v1::ContactResult { robot_id: "=2+5".into(), ..touch(&question(&server.grpc()).await, 0.0) };
    server.grpc().report(report("mug", named, "formula")).await.unwrap();
    let log = log(&server.grpc(), "mug").await;
    for transport in Transport::BOTH {
        let file = server.caller(transport).export("mug", Csv, 0).await.unwrap();
        let mut reader = csv::Reader::from_reader(file.as_slice());
        let heads = reader.headers().unwrap().clone();
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        let cell = |row: usize, head: &str| {
            rows[row][heads.iter().position(|name| name == head).unwrap()].to_owned()
        };
        let column = |head: &str| (0..rows.len()).map(|row| cell(row, head)).collect::<Vec<_>>();
        assert_eq!(column("seq"), ["3", "4", "5", "6", "10", "11"]);
        assert_eq!(column("attempt"), ["1", "2", "3", "4", "5", "6"]);
        let outcomes = ["contact", "contact", "no_contact", "early_contact", "contact", "contact"];
        assert_eq!(column("outcome"), outcomes);
        assert_eq!(column("retracted_by_seq"), ["", "", "", "7", "", ""]);
        assert_eq!(cell(5, "robot_id"), "'=2+5", "no formula");
        assert_eq!((cell(0, "force_n").as_str(), cell(2, "force_n").as_str()), ("2", ""));
        assert_eq!(cell(2, "x_m"), "");
        for row in 0..rows.len() {
            let event = &log[cell(row, "seq").parse::<usize>().unwrap() - 1];
            let stats = event.stats_after.as_ref().unwrap();
            assert_eq!(cell(row, "time"), event.append_time.unwrap().to_string());
            assert_eq!(cell(row, "mean_uncertainty").parse::<f64>().unwrap(), stats.mean_uncertainty);
            assert_eq!(cell(row, "mean_std_m").parse::<f64>().ok(), stats.mean_std_m);
            assert_eq!(cell(row, "failures"), stats.failures.to_string());
        }
    }
}

async fn question(caller: &Caller) -> v1::Candidate {
    let question = v1::ProposeContactsRequest { session_id: "mug".into(), ..Default::default() };
    caller.propose(question).await.unwrap().candidates.remove(0)
}

#[tokio::test]
async fn downloads_have_names_that_sort_and_tags() {
    let server = Server::start().await;
    server.grpc().begin("mug").await;
    let get = |path: &str| server.http().get(&format!("/v1/sessions/mug/{path}"));
    for (query, media_type, name) in [
        ("export", "application/x-tar", "mug-r0002.palpate.tar"),
        ("export?format=mcap&revision=1", "application/octet-stream", "mug-r0001.mcap"),
        ("export?format=csv", "text/csv; charset=utf-8", "mug-r0002.csv"),
    ] {
        let response = accepted(get(query)).await.unwrap();
        assert_eq!(header(&response, "content-type"), media_type);
        assert_eq!(header(&response, "content-disposition"), format!("attachment; filename=\"{name}\""));
        let etag = header(&response, "etag").to_owned();
        let known = send(get(query).header("if-none-match", &etag)).await;
        assert_eq!(known.status(), 304, "{query}");
    }
    let mesh = accepted(get("mesh?format=ply")).await.unwrap();
    assert_eq!(header(&mesh, "content-disposition"), "inline; filename=\"mug-r0002.ply\"");
    assert_eq!(accepted(get("export?format=zip")).await.unwrap_err().fields, ["format"]);
    let first = server.grpc().export("mug", Mcap, 1).await.unwrap();
    assert!(first.starts_with(b"\x89MCAP0\r\n") && first.ends_with(b"\x89MCAP0\r\n"));
}

#[tokio::test]
async fn what_comes_from_the_bundle_cannot_be_said_twice() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.begin("mug").await;
    let bundle = caller.export("mug", Bundle, 0).await.unwrap();
    for (request, field) in [
        (v1::CreateSessionRequest { frame_id: "table".into(), ..named("cup") }, "frame_id"),
        (v1::CreateSessionRequest { config: Some(v1::SessionConfig::default()), ..named("cup") }, "config"),
        (named("No Id"), "session_id"),
        (v1::CreateSessionRequest { display_name: "a\nb".into(), ..named("cup") }, "display_name"),
    ] {
        assert_eq!(caller.import(request, &bundle).await.unwrap_err().fields, [field]);
    }
    let data = v1::import_session_request::Part::Data(bundle.clone().into());
    let headless = tokio_stream::iter([v1::ImportSessionRequest { part: Some(data) }]);
    let refused = crate::harness::reply(caller.sessions().import_session(headless)).await;
    assert_eq!(refused.unwrap_err().fields, ["header"]);
    let form = server.http().request(Method::POST, "/v1/imports").body(bundle);
    let refused = accepted(form.header("content-type", "text/plain")).await.unwrap_err();
    assert_eq!(refused.reason, "UNSUPPORTED_MEDIA_TYPE");
    assert_eq!(caller.create(creation("cup")).await.unwrap().revision, 1, "what was refused made nothing");
}
