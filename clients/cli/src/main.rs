//! The `palpate` program; all of it is in [`palpate::run`].

use std::process::ExitCode;

/// Gives back what large clouds took for a moment, which the system's own allocator keeps: docs/reliability.md has both.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    palpate::run()
}
