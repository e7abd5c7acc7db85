//! The program's commands, one file each.

mod backup;
mod bench;
mod completions;
mod config;
mod database;
mod demo;
mod doctor;
mod evaluate;
mod explore;
mod export;
mod fork;
mod import;
mod list;
mod log_level;
mod manual;
mod migrate;
mod replay;
mod restore;
mod robot;
mod serve;
mod server;
mod simulations;
mod token;

use clap::{ArgMatches, Subcommand};

use crate::failure::Failure;

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Watch a simulated robot explore an object through a server of its own.
    #[command(long_about = demo::ABOUT)]
    Demo(demo::Args),
    /// Serve sessions over gRPC and HTTP.
    #[command(long_about = serve::ABOUT, after_help = serve::EXAMPLES)]
    Serve(serve::Args),
    /// Make, list and revoke the tokens that callers show.
    #[command(long_about = token::ABOUT, after_help = token::EXAMPLES)]
    Token(token::Args),
    /// Let the simulated robot explore through a server that runs already.
    #[command(long_about = explore::ABOUT)]
    Explore(explore::Args),
    /// Compare strategies on many objects and seeds, with tables and plots.
    #[command(long_about = evaluate::ABOUT)]
    Evaluate(evaluate::Args),
    /// Measure how many robots a server carries.
    #[command(long_about = bench::ABOUT)]
    Bench(bench::Args),
    /// List the sessions of a running server.
    #[command(name = "ls", long_about = list::ABOUT)]
    List(list::Args),
    /// Make a session of the touches of another one, under another method, strategy or symmetry.
    #[command(long_about = fork::ABOUT)]
    Fork(fork::Args),
    /// Show the steps of a session again, and prove that they are what was recorded.
    #[command(long_about = replay::ABOUT)]
    Replay(replay::Args),
    /// Write a session into a file: a bundle, a table or a recording for viewers.
    #[command(long_about = export::ABOUT)]
    Export(export::Args),
    /// Bring a session from a bundle onto a running server.
    #[command(long_about = import::ABOUT)]
    Import(import::Args),
    /// Say whether a database, the machine and a server are well.
    #[command(long_about = doctor::ABOUT)]
    Doctor(doctor::Args),
    /// Show or change what a running server logs.
    #[command(long_about = log_level::ABOUT)]
    LogLevel(log_level::Args),
    /// Copy the database into one file, while a server runs or not.
    #[command(long_about = backup::ABOUT)]
    Backup(backup::Args),
    /// Put a copy in the place of the database.
    #[command(long_about = restore::ABOUT)]
    Restore(restore::Args),
    /// Bring all sessions to another database, of SQLite or PostgreSQL.
    #[command(long_about = migrate::ABOUT)]
    Migrate(migrate::Args),
    /// Print the settings of a server, what they mean and where they come from.
    #[command(long_about = config::ABOUT)]
    Config(config::Args),
    /// Print what makes a shell complete the arguments.
    #[command(long_about = completions::ABOUT)]
    Completions(completions::Args),
    /// Print the manual page, or write one for every command.
    #[command(long_about = manual::ABOUT)]
    Man(manual::Args),
}

impl Command {
    /// Runs the command to its end; `program` is what declares all of them, and `matches` what it was called with.
    pub(crate) async fn run(self, program: clap::Command, matches: &ArgMatches) -> Result<(), Failure> {
        match self {
            Self::Demo(args) => demo::run(args).await,
            Self::Serve(args) => serve::run(args).await,
            Self::Token(args) => token::run(args).await,
            Self::Explore(args) => explore::run(args).await,
            Self::Evaluate(args) => evaluate::run(args).await,
            Self::Bench(args) => bench::run(args).await,
            Self::List(args) => list::run(args).await,
            Self::Fork(args) => fork::run(args).await,
            Self::Replay(args) => replay::run(args).await,
            Self::Export(args) => export::run(args).await,
            Self::Import(args) => import::run(args).await,
            Self::Doctor(args) => doctor::run(args).await,
            Self::LogLevel(args) => log_level::run(args).await,
            Self::Backup(args) => backup::run(args).await,
            Self::Restore(args) => restore::run(args).await,
            Self::Migrate(args) => migrate::run(args).await,
            Self::Config(args) => config::run(&args, &program, matches),
            Self::Completions(args) => completions::run(&args, program),
            Self::Man(args) => manual::run(&args, program),
        }
    }

    /// What is logged when the caller does not say: a server tells what it does, the others print it themselves.
    pub(crate) fn default_log(&self) -> &'static str {
        match self {
            Self::Serve(_) => "info",
            Self::Demo(_)
            | Self::Token(_)
            | Self::Explore(_)
            | Self::Evaluate(_)
            | Self::Bench(_)
            | Self::List(_)
            | Self::Fork(_)
            | Self::Replay(_)
            | Self::Export(_)
            | Self::Import(_)
            | Self::Doctor(_)
            | Self::LogLevel(_)
            | Self::Backup(_)
            | Self::Restore(_)
            | Self::Migrate(_)
            | Self::Config(_)
            | Self::Completions(_)
            | Self::Man(_) => "warn",
        }
    }
}
