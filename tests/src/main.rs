//! The `palpate` program under a name of its own, so that the tests can start it, kill it and start it again.

use std::process::ExitCode;

fn main() -> ExitCode {
    palpate::run()
}
