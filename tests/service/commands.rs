//! The commands that talk to a server that runs already.

use std::path::Path;
use std::process::{Output, Stdio};

use tokio::process::Command;

use crate::harness::{Process, Transport, report, soon, touch};

/// What a command prints, or what it says when it fails.
async fn palpate(folder: &Path, server: &Process, arguments: &[&str]) -> Result<String, String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate-under-test"));
    command.args(arguments).current_dir(folder).kill_on_drop(true).stdin(Stdio::null());
    command.env_remove("RUST_LOG").env("PALPATE_SERVER", server.url());
    let Output { status, stdout, stderr } = soon("the program ends", command.output()).await.unwrap();
    let (said, complained) = (String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap());
    if status.success() { Ok(said) } else { Err(complained) }
}

#[tokio::test]
async fn sessions_are_listed_forked_and_replayed_from_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let server = Process::serve(&folder.path().join("palpate.db")).await;
    assert_eq!(palpate(folder.path(), &server, &["ls"]).await.unwrap(), "no sessions\n");
    let caller = server.caller(Transport::Grpc);
    let next = caller.begin("mug").await;
    caller.report(report("mug", touch(&next, 0.001), "a")).await.unwrap();

    let forked = palpate(
        folder.path(),
        &server,
        &["fork", "mug", "--to", "mug-paper", "--method", "paper", "--label", "method=paper"],
    );
    assert!(forked.await.unwrap().starts_with("mug-paper has the first 3 events of mug: 1 attempts"));
    let listed = palpate(folder.path(), &server, &["ls", "--label", "method=paper"]).await.unwrap();
    let lines: Vec<&str> = listed.lines().collect();
    assert_eq!(lines.len(), 2, "{listed}");
    assert!(lines[0].starts_with("SESSION") && lines[1].starts_with("mug-paper  active"), "{listed}");
    assert_eq!(palpate(folder.path(), &server, &["ls", "--limit", "1"]).await.unwrap().lines().count(), 3);

    let replayed = palpate(folder.path(), &server, &["replay", "mug", "--verify"]).await.unwrap();
    assert_eq!(replayed.lines().count(), 4, "{replayed}");
    assert!(replayed.ends_with("all 3 states are those that were recorded\n"), "{replayed}");
    let missing = palpate(folder.path(), &server, &["replay", "nobody"]).await.unwrap_err();
    assert!(missing.contains("there is no session \"nobody\""), "{missing}");
    let refused = palpate(folder.path(), &server, &["fork", "mug", "--to", "mug-paper"]).await.unwrap_err();
    assert!(refused.contains("exists already"), "{refused}");
}
