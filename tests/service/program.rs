//! The program as people and scripts call it: what it prints, refuses and ends with.

use std::path::Path;
use std::process::{Output, Stdio};

use tokio::io::{AsyncBufReadExt, AsyncReadExt, BufReader};
use tokio::process::Command;

use crate::harness::soon;

fn palpate(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate-under-test"));
    command.args(arguments).current_dir(folder).kill_on_drop(true).stdin(Stdio::null());
    for name in [
        "RUST_LOG",
        "PALPATE_LISTEN",
        "PALPATE_DATABASE",
        "PALPATE_ALLOW_HOST",
        "PALPATE_ALLOW_ORIGIN",
        "PALPATE_SERVER",
    ] {
        command.env_remove(name);
    }
    command
}

async fn run(folder: &Path, arguments: &[&str]) -> Output {
    soon("the program ends", palpate(folder, arguments).output()).await.unwrap()
}

/// Runs what must be refused, and gives the exit code with what was said.
async fn refused(folder: &Path, arguments: &[&str]) -> (i32, String) {
    let Output { status, stdout, stderr } = run(folder, arguments).await;
    assert!(stdout.is_empty(), "nothing is done first: {}", String::from_utf8_lossy(&stdout));
    (status.code().unwrap(), String::from_utf8(stderr).unwrap())
}

#[tokio::test]
async fn a_closed_pipe_ends_the_program_quietly() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = palpate(folder.path(), &["demo", "--object", "ball", "--attempts", "5"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = String::new();
    let mut lines = BufReader::new(child.stdout.take().unwrap());
    soon("a line", lines.read_line(&mut first)).await.unwrap();
    assert!(first.starts_with("Palpate 0."), "{first}");
    drop(lines);
    let mut said = String::new();
    soon("its end", child.stderr.take().unwrap().read_to_string(&mut said)).await.unwrap();
    assert_eq!(said, "");
    assert_eq!(soon("its end", child.wait()).await.unwrap().code(), Some(141));
}

#[tokio::test]
async fn a_measurement_tells_counts_and_waits_and_writes_a_table_and_a_plot() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["bench", "--sessions", "2", "--attempts", "3", "--rate", "20", "--out", "measured"];
    let Output { status, stdout, stderr } = run(folder.path(), &arguments).await;
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    let told = String::from_utf8(stdout).unwrap();
    for part in
        ["2 robots, 3 contacts each", "6 answered in", "20.0 a second were due", "given up 0", "ms p99"]
    {
        assert!(told.contains(part), "{part}: {told}");
    }
    #[cfg(target_os = "linux")]
    assert!(told.contains("ms a contact") && told.contains("MB of memory"), "{told}");
    let table = std::fs::read_to_string(folder.path().join("measured/bench.csv")).unwrap();
    assert_eq!(table.lines().count(), 7, "{table}");
    let plot = std::fs::read_to_string(folder.path().join("measured/bench.svg")).unwrap();
    assert!(plot.contains("<polyline") && plot.contains("Contacts answered within a time"), "{plot}");
    let (code, said) = refused(folder.path(), &["bench", "--rate", "0"]).await;
    assert!(code == 2 && said.contains("must be a number above 0"), "{said}");
}

#[tokio::test]
async fn the_demo_ends_with_what_to_try_next_and_without_escapes_in_a_pipe() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(folder.path(), &["demo", "--object", "Ball", "--attempts", "1"]).await;
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success());
    assert!(text.contains("1 touch in ") && text.contains("\n1. Look at palpate-demo.ply"), "{text}");
    assert!(!text.contains('\x1b'), "{text}");
    let count = |address: &str| text.matches(address).count();
    assert!(text.contains("Watch it while it runs: http://127.0.0.1:"), "{text}");
    assert_eq!(
        count("127.0.0.1:"),
        count("127.0.0.1:7257") + 1,
        "the demo's own address is dead by now: {text}"
    );
    let ply = std::fs::read(folder.path().join("palpate-demo.ply")).unwrap();
    assert!(ply.starts_with(b"ply"));
}

#[tokio::test]
async fn wrong_usage_is_refused_before_anything_is_done() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, advice) in [
        (&["serve", "--allow-origin", "*"][..], "name the page's origin"),
        (&["serve", "--allow-origin", "null"], "serve the page"),
        (&["serve", "--allow-host", "palpate.lan:7257"], "write palpate.lan"),
        (&["serve", "--allow-origin", "localhost:5173"], "write http://localhost:5173"),
        (&["serve", "--log", "banana"], "`banana` is no level"),
        (&["explore", "--server", "ftp://127.0.0.1:7257"], "write http://127.0.0.1:7257"),
        (&["serve", "--tls-cert", "cert.pem"], "--tls-key"),
        (&["serve", "--insecure-open", "--require-tokens"], "cannot be used with"),
        (&["demo", "--attempts", "1001"], "between 1 and 1000"),
        (&["evaluate", "--attempts", "1001"], "between 1 and 1000"),
        (
            &["demo", "--method", "paper", "--strategy", "expected_gain"],
            "--strategy expected_gain needs --method palpate",
        ),
        (&["demo", "--method", "paper", "--symmetry", "mirror"], "--symmetry needs --method palpate"),
    ] {
        let (code, said) = refused(folder.path(), arguments).await;
        assert_eq!(code, 2, "{arguments:?}: {said}");
        assert!(said.contains(advice), "{arguments:?}: {said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[tokio::test]
async fn a_server_for_the_whole_network_warns_at_its_start() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = palpate(folder.path(), &["serve", "--listen", "0.0.0.0:0", "--insecure-open"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut log = BufReader::new(child.stderr.take().unwrap()).lines();
    let first = soon("its first line", log.next_line()).await.unwrap().unwrap();
    assert!(first.contains("WARN") && first.contains("--insecure-open"), "{first}");
    soon("its end", child.kill()).await.unwrap();
}

#[tokio::test]
async fn a_file_that_cannot_be_written_is_told_in_words_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, words) in [
        (&["serve", "--listen", "127.0.0.1:0", "--database", "."][..], "is a folder"),
        (&["serve", "--listen", "127.0.0.1:0", "--database", "no/such.db"], "there is no folder"),
        (&["demo", "--out", "no/such.ply"], "there is no folder"),
        #[cfg(target_os = "linux")]
        (&["serve", "--listen", "127.0.0.1:0", "--database", "/proc/such.db"], "nothing can be written"),
    ] {
        let (code, said) = refused(folder.path(), arguments).await;
        assert_eq!(code, 1, "{arguments:?}: {said}");
        assert!(said.contains(words) && !said.contains("listens"), "{arguments:?}: {said}");
    }
}

#[tokio::test]
async fn a_file_that_is_no_database_is_refused_without_a_word_of_listening() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("notes.db"), "these are notes, and no database at all").unwrap();
    let (code, said) =
        refused(folder.path(), &["serve", "--listen", "127.0.0.1:0", "--database", "notes.db"]).await;
    assert_eq!(code, 1);
    assert!(said.contains("notes.db") && !said.contains("listens"), "{said}");
}

/// What a script writes for a small evaluation; without a terminal each run is told in a line.
const EVALUATION: [&str; 11] = [
    "evaluate",
    "--objects",
    "ball",
    "Can",
    "--methods",
    "palpate",
    "--seeds",
    "4",
    "--attempts",
    "10",
    "--jobs=1",
];

#[tokio::test]
async fn an_interrupted_evaluation_keeps_its_runs_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let lines_of = |name: &str| {
        let text = std::fs::read_to_string(folder.path().join("palpate-evaluation").join(name)).unwrap();
        text.lines().count()
    };
    let mut child =
        palpate(folder.path(), &EVALUATION).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut told = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(soon("a run", told.next_line()).await.unwrap().unwrap().contains(" mm"));
    let id = child.id().unwrap().to_string();
    let sent = Command::new("sh").args(["-c", "kill -INT \"$1\"", "sh", &id]).status().await.unwrap();
    assert!(sent.success());
    while soon("the rest", told.next_line()).await.unwrap().is_some() {}
    let mut said = String::new();
    soon("its end", child.stderr.take().unwrap().read_to_string(&mut said)).await.unwrap();
    assert_eq!(soon("its end", child.wait()).await.unwrap().code(), Some(130), "{said}");
    assert!(said.contains("interrupted") && said.contains("--resume"), "{said}");
    let kept = lines_of("runs.csv") - 1;
    assert!((1..16).contains(&kept), "{kept}");

    let (code, said) = refused(folder.path(), &EVALUATION).await;
    assert!(code == 1 && said.contains("--resume goes on with it"), "{said}");
    let output = run(folder.path(), &[&EVALUATION[..], &["--resume"]].concat()).await;
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.matches(", seed ").count(), 16 - kept, "only what is missing is made: {text}");
    assert_eq!((lines_of("runs.csv"), lines_of("attempts.csv")), (1 + 16, 1 + 16 * 11));
    assert!(text.contains("16 runs: 2 objects, 4 seeds") && text.contains("table.md"), "{text}");
    assert!(text.lines().count() < 40, "the tables are in their file: {text}");
}

#[tokio::test]
async fn shells_and_readers_of_manuals_are_served() {
    let folder = tempfile::tempdir().unwrap();
    let script = run(folder.path(), &["completions", "bash"]).await;
    assert!(String::from_utf8(script.stdout).unwrap().contains("--allow-origin"));
    let page = run(folder.path(), &["man"]).await;
    assert!(String::from_utf8(page.stdout).unwrap().contains(".TH palpate 1"));
    assert!(run(folder.path(), &["man", "--out", "."]).await.status.success());
    for name in ["palpate.1", "palpate-serve.1", "palpate-evaluate.1"] {
        assert!(folder.path().join(name).exists(), "{name}");
    }
}
