//! The `palpate` program; all of it is in [`palpate::run`].

use std::process::ExitCode;

fn main() -> ExitCode {
    palpate::run()
}
