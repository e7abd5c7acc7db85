//! A disk that fails under the server: nothing is acknowledged that it did not take, and all is well again with it.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::harness::ball::{contact_at, plausible};
use crate::harness::{Process, Transport, accepted, creation, report};

/// Error numbers of Linux.
const EIO: i32 = 5;
const ENOSPC: i32 = 28;
const EROFS: i32 = 30;

/// Compiles the library that fails on demand.
fn faulty_disk(folder: &Path) -> PathBuf {
    let library = folder.join("faults.so");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("service/disk/faults.c");
    let compiled = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .arg(&library)
        .arg(source)
        .arg("-ldl")
        .status()
        .unwrap();
    assert!(compiled.success());
    library
}

#[tokio::test]
async fn what_the_disk_did_not_take_is_not_acknowledged_and_all_is_well_again_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let (database, faults) = (folder.path().join("palpate.db"), folder.path().join("faults"));
    let disk = faulty_disk(folder.path());
    let server = Process::serve_with(&database, |command| {
        command.env("LD_PRELOAD", &disk).env("PALPATE_FAULTS", &faults);
    })
    .await;
    let ready = async || accepted(server.http().get("/readyz")).await.map_err(|refused| refused.reason);
    server.caller(Transport::Grpc).begin("ball").await;
    let mut seq = 2;
    for (number, (operation, error, reason)) in [
        ("write", EIO, "STORE_DOWN"),
        ("sync", EIO, "STORE_DOWN"),
        ("write", ENOSPC, "STORE_FULL"),
        ("write", EROFS, "STORE_DOWN"),
    ]
    .into_iter()
    .enumerate()
    {
        for transport in Transport::BOTH {
            let caller = server.caller(transport);
            let id = format!("touch-{number}-{}", transport.name());
            let said = || report("ball", contact_at([0.0, 0.0, 1.0], 0.0, plausible(number)), &id);
            std::fs::write(&faults, format!("{operation} {error}")).unwrap();
            let what = format!("{operation} {error}");
            assert_eq!(caller.report(said()).await.unwrap_err().reason, reason, "{what}");
            assert_eq!(caller.create(creation("new")).await.unwrap_err().reason, reason, "{what}");
            assert_eq!(ready().await.unwrap_err(), reason, "{what}");
            assert_eq!(caller.get("ball").await.unwrap().revision, seq, "{what}: readers go on");
            std::fs::remove_file(&faults).unwrap();
            seq += 1;
            assert_eq!(caller.report(said()).await.unwrap().seq, seq, "{what}");
            assert_eq!(ready().await.unwrap().text().await.unwrap(), "ready\n", "{what}");
        }
    }
    let log = server.caller(Transport::Grpc).log("ball").await;
    server.kill().await;
    let server = Process::serve(&database).await;
    let caller = server.caller(Transport::Grpc);
    assert_eq!(caller.log("ball").await, log);
    assert_eq!(log.len() as i64, seq);
    assert!(caller.get("new").await.is_err(), "what was refused is not there");
}
