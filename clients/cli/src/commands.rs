//! The program's commands, one file each.

mod demo;
mod evaluate;
mod explore;
mod robot;
mod serve;

use clap::Subcommand;

use crate::failure::Failure;

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Watch a simulated robot explore an object through a server of its own.
    #[command(long_about = demo::ABOUT)]
    Demo(demo::Args),
    /// Serve sessions over gRPC and HTTP.
    #[command(long_about = serve::ABOUT)]
    Serve(serve::Args),
    /// Let the simulated robot explore through a server that runs already.
    #[command(long_about = explore::ABOUT)]
    Explore(explore::Args),
    /// Compare strategies on many objects and seeds, with tables and plots.
    #[command(long_about = evaluate::ABOUT)]
    Evaluate(evaluate::Args),
}

impl Command {
    /// Runs the command to its end.
    pub(crate) async fn run(self) -> Result<(), Failure> {
        match self {
            Self::Demo(args) => demo::run(args).await,
            Self::Serve(args) => serve::run(args).await,
            Self::Explore(args) => explore::run(args).await,
            Self::Evaluate(args) => evaluate::run(args).await,
        }
    }

    /// What is logged when the caller does not say: a server tells what it does, the others print it themselves.
    pub(crate) fn default_log(&self) -> &'static str {
        match self {
            Self::Serve(_) => "info",
            Self::Demo(_) | Self::Explore(_) | Self::Evaluate(_) => "warn",
        }
    }
}
