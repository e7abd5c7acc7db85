//! The program's commands, one file each.

pub(crate) mod serve;

use clap::Subcommand;

use crate::cli::Failure;

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Serve sessions over gRPC and HTTP.
    Serve(serve::Args),
}

impl Command {
    /// Runs the command to its end.
    pub(crate) async fn run(self) -> Result<(), Failure> {
        match self {
            Self::Serve(args) => serve::run(args).await,
        }
    }

    /// What is logged when the caller does not say: a server tells what it does, the others print it themselves.
    pub(crate) fn default_log(&self) -> &'static str {
        match self {
            Self::Serve(_) => "info",
        }
    }
}
