//! `palpate completions`: what makes a shell complete the arguments.

use clap_complete::Shell;

use crate::failure::Failure;
use crate::terminal::hand_over;

pub(super) const ABOUT: &str = "\
Prints what makes a shell complete the arguments.

For bash, for instance: source <(palpate completions bash)";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The shell.
    shell: Shell,
}

/// Prints the script.
pub(crate) fn run(args: &Args, mut program: clap::Command) -> Result<(), Failure> {
    // Into memory first: the generator panics where it cannot write.
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, "palpate", &mut script);
    hand_over(&script)
}
