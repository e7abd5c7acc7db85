//! `palpate man`: the help as manual pages.

use std::path::PathBuf;

use clap_mangen::{Man, generate_to};

use crate::failure::Failure;
use crate::terminal::hand_over;

pub(super) const ABOUT: &str = "\
Prints the manual page of the program, or writes one for every command.

To read it: palpate man | man -l -";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Writes palpate.1, palpate-demo.1 and so on into this folder.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

/// Prints or writes the pages.
pub(crate) fn run(args: &Args, program: clap::Command) -> Result<(), Failure> {
    match &args.out {
        Some(folder) => generate_to(program, folder)
            .map_err(|error| format!("--out {}: {error}", folder.display()).into()),
        None => {
            let mut page = Vec::new();
            Man::new(program).render(&mut page)?;
            hand_over(&page)
        }
    }
}
