//! The program: arguments, log, exit code. Each command is a file of [`crate::commands`].
//!
//! Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted twice.

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use tracing_subscriber::EnvFilter;

use crate::commands::Command;
use crate::failure::Failure;

const EXAMPLES: &str = "\
Examples:
  palpate demo                    a simulated robot explores a bottle, touch by touch
  palpate serve                   the service, for programs on this machine
  palpate serve --listen 127.0.0.1:0 --database /tmp/try.db

While a server runs, http://127.0.0.1:7257/docs documents every call.";

/// Reconstructs the shape of objects from one camera view and a robot's touches.
#[derive(Debug, Parser)]
#[command(name = "palpate", version, about, after_help = EXAMPLES, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,

    /// What to log: error, warn, info, debug, trace, or a filter such as `palpate=debug,info`.
    #[arg(long, global = true, env = "RUST_LOG", value_name = "FILTER", help_heading = "Log")]
    log: Option<String>,

    /// How to write the log.
    #[arg(long, global = true, value_enum, default_value = "text", help_heading = "Log")]
    log_format: LogFormat,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum LogFormat {
    /// For people.
    Text,
    /// One object a line, for programs.
    Json,
}

/// Runs the program with the process's arguments.
pub fn run() -> ExitCode {
    let Cli { command, log, log_format } = Cli::parse();
    let result = start_log(log.as_deref().unwrap_or(command.default_log()), log_format)
        .and_then(|()| Ok(tokio::runtime::Builder::new_multi_thread().enable_all().build()?))
        .and_then(|runtime| runtime.block_on(command.run()));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("palpate: {failure}");
            ExitCode::FAILURE
        }
    }
}

/// Writes the log to standard error, so that a command's own output can be piped.
fn start_log(filter: &str, format: LogFormat) -> Result<(), Failure> {
    let filter = EnvFilter::try_new(filter).map_err(|error| format!("--log {filter:?}: {error}"))?;
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    match format {
        LogFormat::Text => log.with_target(false).with_ansi(std::io::stderr().is_terminal()).try_init()?,
        LogFormat::Json => log.json().flatten_event(true).with_span_list(false).try_init()?,
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_arguments_are_declared_without_contradiction() {
        Cli::command().debug_assert();
    }

    #[test]
    fn serve_needs_no_flags() {
        let cli = Cli::try_parse_from(["palpate", "serve"]).unwrap();
        assert_eq!(cli.command.default_log(), "info");
    }
}
