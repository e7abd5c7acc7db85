//! `palpate doctor` says what is wrong and what to do, and changes nothing.

use serde_json::Value;

use crate::harness::{Process, Ran, Transport, run};

/// The level and the text of each finding of a check.
fn found(doctor: &Ran, check: &str) -> Vec<(String, String)> {
    let said: Value = serde_json::from_str(&doctor.out).unwrap_or_else(|_| panic!("{doctor:?}"));
    let of_check = |finding: &&Value| finding["check"] == check;
    let text = |finding: &Value, part: &str| finding[part].as_str().unwrap().to_owned();
    let findings = said["findings"].as_array().unwrap().iter().filter(of_check);
    findings.map(|finding| (text(finding, "level"), text(finding, "found"))).collect()
}

/// What a check said, which must have said one thing.
fn one(doctor: &Ran, check: &str) -> (String, String) {
    let mut found = found(doctor, check);
    assert_eq!(found.len(), 1, "{check}: {found:?}");
    found.remove(0)
}

#[tokio::test]
async fn a_server_and_its_database_are_well_while_it_runs_and_when_it_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let server = Process::serve(&database).await;
    let (url, address) = (server.url(), server.address.to_string());
    server.caller(Transport::Grpc).begin("mug").await;
    let arguments = ["doctor", "--json", "--database", "palpate.db", "--listen", &address];
    let doctor = run(folder.path(), &[&arguments[..], &["--server", &url]].concat()).await;
    assert_eq!(doctor.code, Some(0), "{doctor:?}");
    for (check, said) in [
        ("database", "a server holds it"),
        ("pages", "as they should be"),
        ("chain", "1 session with 2 events, all links followed"),
        ("witness", "no acknowledged event is missing"),
        ("port", "answers at 127.0.0.1:"),
        ("server", "answers at http://127.0.0.1:"),
        ("ready", "the server takes work"),
        ("limits", "all are the defaults"),
        ("in force", "limits that the settings here say"),
        ("program", "palpate 0."),
    ] {
        let (level, text) = one(&doctor, check);
        assert!(level == "ok" && text.contains(said), "{check}: {level} {text}");
    }
    assert_eq!(found(&doctor, "clock").len(), 2, "that of the log and that of the server");
    let other = run(folder.path(), &["doctor", "--json", "--server", &url, "--limit", "streams=3"]).await;
    let (level, text) = one(&other, "in force");
    assert!(level == "warning" && text.ends_with("than the settings here: streams 256"), "{text}");
    server.terminate().await;

    let before: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|file| file.unwrap().file_name()).collect();
    let bytes = std::fs::read(&database).unwrap();
    let doctor = run(folder.path(), &arguments).await;
    assert_eq!(doctor.code, Some(0), "{doctor:?}");
    assert!(one(&doctor, "database").1.contains("no server holds it"));
    assert!(one(&doctor, "port").1.ends_with("is free"));
    assert!(found(&doctor, "server").is_empty());
    let after: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|file| file.unwrap().file_name()).collect();
    assert!(after == before && std::fs::read(&database).unwrap() == bytes, "nothing was changed: {after:?}");

    let doctor = run(folder.path(), &[&arguments[..], &["--server", &url]].concat()).await;
    assert_eq!(doctor.code, Some(1));
    let (level, text) = one(&doctor, "server");
    assert!(level == "problem" && text.contains("nothing answers"), "{text}");
    let doctor = run(folder.path(), &["doctor", "--database", "palpate.db", "--listen", &address]).await;
    assert!(doctor.out.starts_with("ok       program ") && doctor.err.is_empty(), "{doctor:?}");
    assert!(doctor.out.lines().last().unwrap().starts_with("0 problems, "), "{}", doctor.out);
}

#[tokio::test]
async fn damage_of_pages_of_a_chain_and_of_the_end_is_a_problem_each() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let server = Process::serve(&database).await;
    let caller = server.caller(Transport::Grpc);
    let next = caller.begin("mug").await;
    assert_eq!(run(folder.path(), &["backup", "--to", "older.db"]).await.code, Some(0));
    caller.go_on("mug", next, 2).await;
    server.terminate().await;
    let sound = std::fs::read(&database).unwrap();
    let doctor = async || run(folder.path(), &["doctor", "--json", "--listen", "127.0.0.1:0"]).await;

    // An earlier state in the place of the database: its witness knows better.
    std::fs::copy(folder.path().join("older.db"), &database).unwrap();
    let put_back = doctor().await;
    assert_eq!(put_back.code, Some(1));
    let (level, text) = one(&put_back, "witness");
    assert!(level == "problem" && text.starts_with("2 events that robots were told"), "{text}");

    // A bit of what a robot said.
    let mut changed = sound.clone();
    let place = changed.windows(5).position(|bytes| bytes == b"arm-1").unwrap();
    changed[place + 4] ^= 2;
    std::fs::write(&database, &changed).unwrap();
    let broken = doctor().await;
    assert_eq!(broken.code, Some(1));
    assert!(found(&broken, "chain").iter().any(|(level, text)| level == "problem" && text.contains("mug")));

    std::fs::write(&database, &sound[..sound.len() / 2]).unwrap();
    let cut = doctor().await;
    assert_eq!(cut.code, Some(1), "{cut:?}");
    std::fs::write(&database, "notes, and no database at all; ".repeat(200)).unwrap();
    let notes = doctor().await;
    assert_eq!(notes.code, Some(1));
    assert!(one(&notes, "database").1.contains("file is not a database"), "{notes:?}");
}

#[tokio::test]
async fn what_others_may_read_and_who_has_the_port_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("palpate.db");
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let doctor = run(folder.path(), &["doctor", "--json", "--listen", &address]).await;
    assert_eq!(doctor.code, Some(1), "{doctor:?}");
    let (level, text) = one(&doctor, "port");
    assert!(level == "problem" && text.contains("is taken"), "{text}");
    #[cfg(target_os = "linux")]
    assert!(text.contains(&format!("(process {})", std::process::id())), "{text}");
    assert_eq!(one(&doctor, "database").0, "warning", "there is none yet");
    drop(listener);

    Process::serve(&database).await.terminate().await;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(&database, std::fs::Permissions::from_mode(0o644)).unwrap();
        let doctor = run(folder.path(), &["doctor", "--json", "--listen", &address]).await;
        let (level, text) = one(&doctor, "permissions");
        assert!(
            level == "warning" && text.ends_with("palpate.db can be used by others (mode 644)"),
            "{text}"
        );
    }
}
