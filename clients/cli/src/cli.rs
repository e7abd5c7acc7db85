//! The program: arguments, log, exit code. Each command is a file of [`crate::commands`].
//!
//! Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted, 141 nobody reads the output.

use std::process::ExitCode;

use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser};

use crate::commands::Command;
use crate::config_file::{self, ConfigFile};
use crate::failure::{Ended, Failure};
use crate::log::{self, LogFormat};
use crate::terminal::{self, warn};
use crate::version::VERSION;

const EXAMPLES: &str = "\
Examples:
  palpate demo
          a simulated robot explores a bottle
  palpate serve
          the service, for this machine
  palpate evaluate --objects can mug
          which method is better, on two objects

While a server runs, http://127.0.0.1:7257/ shows its sessions, and /docs documents every call.";

/// Reconstructs the shape of objects from one camera view and a robot's touches.
#[derive(Debug, Parser)]
#[command(name = "palpate", version = VERSION.as_str(), after_help = EXAMPLES)]
#[command(arg_required_else_help = true, styles = terminal::HELP, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,

    /// What to log: error, warn, info, debug, trace, or a filter such as `palpate=debug,info`.
    #[arg(long, global = true, env = "RUST_LOG", value_name = "FILTER", help_heading = "Log")]
    #[arg(value_parser = log::filter)]
    log: Option<String>,

    /// How to write the log.
    #[arg(long, global = true, value_enum, default_value = "text", help_heading = "Log")]
    log_format: LogFormat,
}

/// Runs the program with the process's arguments.
pub fn run() -> ExitCode {
    let (program, matches) = match arguments() {
        Ok(arguments) => arguments,
        Err(failure) => return tell(&failure),
    };
    let Cli { command, log, log_format } =
        Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let filter = log.unwrap_or_else(|| command.default_log().to_owned());
    let result = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    let result = result.map_err(Failure::from).and_then(|runtime| {
        let _on_runtime = runtime.enter();
        log::start(&filter, log_format)?;
        let done = runtime.block_on(command.run(program, &matches));
        #[cfg(feature = "otel")]
        crate::traces::finish();
        done
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => tell(&failure),
    }
}

/// The program and the arguments that it was called with, where a configuration file has a say, too.
fn arguments() -> Result<(clap::Command, ArgMatches), Failure> {
    let matches = Cli::command().get_matches();
    let Some(path) = config_file::named_by(&matches) else { return Ok((Cli::command(), matches)) };
    let file = ConfigFile::read(&path)?;
    let program = file.as_defaults_of(Cli::command())?;
    // The arguments alone are right, so what is refused now is the file's.
    let matches = program.clone().try_get_matches().map_err(|refusal| file.blame(in_a_line(&refusal)))?;
    Ok((program, matches))
}

/// What is wrong, without what usage there is.
fn in_a_line(refusal: &clap::Error) -> String {
    let text = refusal.to_string();
    let line = text.lines().next().unwrap_or_default();
    line.strip_prefix("error: ").unwrap_or(line).to_owned()
}

/// Tells people what happened, and programs by the exit code.
fn tell(failure: &Failure) -> ExitCode {
    if let Some(usage) = failure.downcast_ref::<clap::Error>() {
        // Whom could a failure to print be told?
        let _ = usage.print();
        return ExitCode::from(2);
    }
    let ended = failure.downcast_ref::<Ended>();
    if !matches!(ended, Some(Ended::Unread | Ended::Told)) {
        warn(failure);
    }
    // As a shell counts them: 128 and the number of the signal, SIGPIPE or SIGINT.
    match ended {
        Some(Ended::Unread) => ExitCode::from(141),
        Some(Ended::Interrupted(_)) => ExitCode::from(130),
        Some(Ended::Told) | None => ExitCode::FAILURE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failure::wrong_usage;

    #[test]
    fn the_arguments_are_declared_without_contradiction() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_end_has_the_exit_code_that_a_shell_expects() {
        let codes = [
            (tell(&wrong_usage("--this contradicts --that")), 2),
            (tell(&Ended::Unread.into()), 141),
            (tell(&Ended::Interrupted("3 of 4 runs are kept".to_owned()).into()), 130),
            (tell(&"the disk is full".into()), 1),
        ];
        for (code, expected) in codes {
            assert_eq!(code, ExitCode::from(expected));
        }
    }

    #[test]
    fn serve_needs_no_flags() {
        let cli = Cli::try_parse_from(["palpate", "serve"]).unwrap();
        assert_eq!(cli.command.default_log(), "info");
    }

    #[test]
    fn the_version_begins_with_the_release() {
        assert!(VERSION.starts_with(env!("CARGO_PKG_VERSION")), "{}", *VERSION);
    }

    #[test]
    fn the_help_begins_with_what_the_program_is_for() {
        let help = Cli::command().render_help().to_string();
        assert!(help.starts_with("Reconstructs the shape of objects"), "{help}");
    }

    #[test]
    fn examples_fit_into_a_narrow_terminal() {
        let longest = EXAMPLES.lines().filter(|line| line.starts_with(' ')).map(str::len).max();
        assert!(longest <= Some(48), "{longest:?}");
    }
}
