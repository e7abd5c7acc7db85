//! The program as an operator calls it, with nothing in its environment that would configure it.

use std::path::Path;
use std::process::{Output, Stdio};

use tokio::process::Command;

use super::soon;

/// What became of a command.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) code: Option<i32>,
    /// What it printed.
    pub(crate) out: String,
    /// What it complained about.
    pub(crate) err: String,
}

/// Runs a command to its end.
pub(crate) async fn run(folder: &Path, arguments: &[&str]) -> Ran {
    run_with(folder, arguments, |_| {}).await
}

/// The same with more for the program, such as its environment.
pub(crate) async fn run_with(folder: &Path, arguments: &[&str], more: impl FnOnce(&mut Command)) -> Ran {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate-under-test"));
    command.args(arguments).current_dir(folder).kill_on_drop(true).stdin(Stdio::null());
    for (name, _) in std::env::vars_os() {
        if name == "RUST_LOG" || name.to_string_lossy().starts_with("PALPATE_") {
            command.env_remove(name);
        }
    }
    more(&mut command);
    let Output { status, stdout, stderr } = soon("the program ends", command.output()).await.unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Ran { code: status.code(), out: text(stdout), err: text(stderr) }
}
