//! The program's commands, one file each.

mod completions;
mod demo;
mod evaluate;
mod explore;
mod manual;
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
    #[command(long_about = serve::ABOUT, after_help = serve::EXAMPLES)]
    Serve(serve::Args),
    /// Let the simulated robot explore through a server that runs already.
    #[command(long_about = explore::ABOUT)]
    Explore(explore::Args),
    /// Compare strategies on many objects and seeds, with tables and plots.
    #[command(long_about = evaluate::ABOUT)]
    Evaluate(evaluate::Args),
    /// Print what makes a shell complete the arguments.
    #[command(long_about = completions::ABOUT)]
    Completions(completions::Args),
    /// Print the manual page, or write one for every command.
    #[command(long_about = manual::ABOUT)]
    Man(manual::Args),
}

impl Command {
    /// Runs the command to its end; `program` is what declares all of them.
    pub(crate) async fn run(self, program: clap::Command) -> Result<(), Failure> {
        match self {
            Self::Demo(args) => demo::run(args).await,
            Self::Serve(args) => serve::run(args).await,
            Self::Explore(args) => explore::run(args).await,
            Self::Evaluate(args) => evaluate::run(args).await,
            Self::Completions(args) => completions::run(&args, program),
            Self::Man(args) => manual::run(&args, program),
        }
    }

    /// What is logged when the caller does not say: a server tells what it does, the others print it themselves.
    pub(crate) fn default_log(&self) -> &'static str {
        match self {
            Self::Serve(_) => "info",
            Self::Demo(_) | Self::Explore(_) | Self::Evaluate(_) | Self::Completions(_) | Self::Man(_) => {
                "warn"
            }
        }
    }
}
