//! A server is configured by a file, by the environment and by flags, and says what it goes by.

use std::collections::BTreeMap;

use palpate_proto::v1;

use crate::harness::{Process, Transport, accepted, run, run_with};

/// What `config --show` printed, without the comments.
fn settings(shown: &str) -> BTreeMap<&str, &str> {
    shown.lines().filter(|line| !line.starts_with('#')).filter_map(|line| line.split_once(" = ")).collect()
}

/// What is said above a setting of where it comes from.
fn source<'a>(shown: &'a str, name: &str) -> &'a str {
    let lines: Vec<&str> = shown.lines().collect();
    let setting = lines.iter().position(|line| line.starts_with(&format!("{name} = "))).unwrap();
    lines[setting - 1].split_once("From: ").unwrap().1
}

const FILE: &str = r#"
listen = "127.0.0.1:0"
database = "lab.db"
log = "debug"
allow_origin = ["http://one.example", "http://two.example"]
simulated_robots = 2

[limits]
message_bytes = "32 MiB"
drain = "3 s"
streams = 7
"#;

#[tokio::test]
async fn flags_win_over_the_environment_that_over_the_file_and_that_over_the_defaults() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("palpate.toml"), FILE).unwrap();
    let arguments = ["config", "--show", "--simulated-robots", "3", "--limit", "streams=9"];
    let shown = run_with(folder.path(), &arguments, |command| {
        command.env("PALPATE_CONFIG", "palpate.toml").env("PALPATE_DATABASE", "other.db");
    });
    let shown = shown.await;
    assert_eq!(shown.code, Some(0), "{}", shown.err);
    let found = settings(&shown.out);
    for (name, value, from) in [
        ("listen", "\"127.0.0.1:0\"", "the file."),
        ("database", "\"other.db\"", "PALPATE_DATABASE."),
        ("simulated_robots", "3", "--simulated-robots."),
        ("allow_origin", "[\"http://one.example\", \"http://two.example\"]", "the file."),
        ("insecure_open", "false", "default."),
        ("log", "\"debug\"", "the file."),
        ("message_bytes", "\"32 MiB\"", "the file; the default is \"16 MiB\"."),
        ("drain", "\"3s\"", "the file; the default is \"10s\"."),
        ("streams", "9", "--limit or PALPATE_LIMIT; the default is 256."),
        ("contacts", "1000", "default."),
    ] {
        assert_eq!(found.get(name), Some(&value), "{name}");
        assert_eq!(source(&shown.out, name), from, "{name}");
    }
}

#[tokio::test]
async fn what_is_shown_is_a_file_that_says_the_same() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("palpate.toml"), FILE).unwrap();
    let shown = run(folder.path(), &["config", "--show", "--config", "palpate.toml"]).await;
    std::fs::write(folder.path().join("again.toml"), &shown.out).unwrap();
    let again = run(folder.path(), &["config", "--show", "--config", "again.toml"]).await;
    assert_eq!(again.code, Some(0), "{}", again.err);
    assert_eq!(settings(&again.out), settings(&shown.out));
}

#[tokio::test]
async fn a_server_keeps_to_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("palpate.toml");
    std::fs::write(&file, "simulated_robots = 2\n[limits]\nmessage_bytes = \"32 MiB\"\n").unwrap();
    let database = folder.path().join("palpate.db");
    let server = Process::serve_with(&database, |command| {
        command.env("PALPATE_CONFIG", &file);
    });
    let server = server.await;
    let version = accepted(server.http().get("/version")).await.unwrap().text().await.unwrap();
    assert!(version.contains(&(32 << 20).to_string()), "{version}");
    let simulations = accepted(server.http().get("/v1/simulations")).await.unwrap().text().await.unwrap();
    assert!(simulations.contains("\"most_at_once\":2"), "{simulations}");
}

#[tokio::test]
async fn what_a_file_cannot_say_is_refused_with_the_name_that_was_meant() {
    let folder = tempfile::tempdir().unwrap();
    for (text, said) in [
        ("lisen = \"127.0.0.1:0\"", "there is no setting lisen; did you mean listen?"),
        ("streams = 3", "there is no setting streams; it is a limit: write it under [limits]"),
        ("listen = \"nowhere\"", "invalid value 'nowhere' for '--listen"),
        ("simulated_robots = 99", "99 is not in 0..=16"),
        ("config = \"other.toml\"", "there is no setting config"),
        ("listen = ", "TOML parse error at line 1"),
        ("[limits]\ncontact = 3", "there is no limit contact; did you mean contacts?"),
        ("[limits]\ndrain = 30", "drain = \"30\": write a time with its unit, such as \"30 s\""),
        ("[limits]\nwrite_queue = 0", "write_queue is 0"),
        ("[limits]\nheartbeat_min = \"1 h\"", "heartbeat_min is longer than heartbeat"),
    ] {
        std::fs::write(folder.path().join("palpate.toml"), text).unwrap();
        let refused = run(folder.path(), &["serve", "--config", "palpate.toml"]).await;
        assert_eq!((refused.code, refused.out.as_str()), (Some(1), ""), "{text}: {}", refused.err);
        assert!(refused.err.contains("palpate.toml") || refused.err.contains("limits:"), "{}", refused.err);
        assert!(refused.err.contains(said), "{text}: {}", refused.err);
    }
    let missing = run(folder.path(), &["serve", "--config", "nothing.toml"]).await;
    assert!(missing.err.contains("nothing.toml: No such file"), "{}", missing.err);
    assert!(!folder.path().join("palpate.db").exists(), "nothing was begun");
}

#[tokio::test]
async fn a_server_works_without_what_limits_of_0_turn_off() {
    let folder = tempfile::tempdir().unwrap();
    let off = "explained_vertices=0,keep_out=0,labels=0,leased_places=0,shadow=0";
    let database = folder.path().join("palpate.db");
    let server = Process::serve_with(&database, |command| {
        command.env("PALPATE_LIMIT", format!("checkpoint_bytes=0,mesh_bytes=0,past_states=0,{off}"));
    });
    let server = server.await;
    let caller = server.caller(Transport::Grpc);
    let next = caller.begin("mug").await;
    caller.go_on("mug", next, 2).await;
    for revision in [2, 4, 3] {
        let request = v1::GetMeshRequest { session_id: "mug".into(), revision, ..Default::default() };
        assert_eq!(caller.mesh(request).await.unwrap().revision, revision);
    }
}
