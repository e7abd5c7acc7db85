//! The `palpate` program; all of it is in [`palpate::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    palpate::cli::run()
}
