//! The log, on standard error, so that a command's own output can be piped.

use anstream::{AutoStream, ColorChoice};
use clap::ValueEnum;
use tracing_subscriber::EnvFilter;

use crate::failure::Failure;

/// How a line of the log is written.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum LogFormat {
    /// For people.
    Text,
    /// One object a line, for programs.
    Json,
}

/// The levels that a filter may name alone.
const LEVELS: [&str; 6] = ["off", "error", "warn", "info", "debug", "trace"];

/// Refuses a filter that would be taken and never match: a word alone must be a level.
pub(crate) fn filter(text: &str) -> Result<String, String> {
    let is_known = |word: &&str| {
        word.is_empty()
            || word.contains(['=', '['])
            || LEVELS.iter().any(|level| level.eq_ignore_ascii_case(word))
    };
    if let Some(odd) = text.split(',').map(str::trim).find(|word| !is_known(word)) {
        let levels = LEVELS.join(", ");
        return Err(format!(
            "`{odd}` is no level: say one of {levels}, or a filter such as palpate=debug,info"
        ));
    }
    EnvFilter::try_new(text).map_err(|error| error.to_string())?;
    Ok(text.to_owned())
}

/// Starts the log for the whole process.
///
/// # Errors
/// The filter is none, or there is a log already.
pub(crate) fn start(filter: &str, format: LogFormat) -> Result<(), Failure> {
    let filter = EnvFilter::try_new(filter).map_err(|error| format!("--log {filter:?}: {error}"))?;
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    let coloured = AutoStream::choice(&std::io::stderr()) != ColorChoice::Never;
    match format {
        LogFormat::Text => log.with_target(false).with_ansi(coloured).try_init()?,
        LogFormat::Json => log.json().flatten_event(true).with_span_list(false).try_init()?,
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_that_would_never_match_is_refused() {
        for right in ["info", "WARN", "palpate=debug,info", "off", "palpate_server[call]=trace", ""] {
            assert_eq!(filter(right), Ok(right.to_owned()));
        }
        for (wrong, named) in [("banana", "`banana`"), ("info,palpate", "`palpate`"), ("palpate=loud", "")] {
            assert!(filter(wrong).unwrap_err().contains(named), "{wrong}");
        }
    }
}
