//! The log, on standard error, so that a command's own output can be piped.

use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, SystemTime};

use anstream::{AutoStream, ColorChoice};
use clap::ValueEnum;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, Registry, fmt, reload};

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

/// What is logged in this process, to be changed while it runs; the log is one for the whole process, and so is this.
static LEVEL: OnceLock<Level> = OnceLock::new();

/// What is logged, and how that is changed.
#[derive(Debug)]
pub(crate) struct Level {
    handle: reload::Handle<EnvFilter, Registry>,
    now: Mutex<Setting>,
}

/// The filter in force.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Setting {
    pub(crate) filter: String,
    /// Until when, and the filter that holds then.
    pub(crate) until: Option<(SystemTime, String)>,
    /// Tells this setting from earlier ones.
    number: u64,
}

/// What is logged in this process, once the log was started.
pub(crate) fn level() -> Option<&'static Level> {
    LEVEL.get()
}

impl Level {
    pub(crate) fn now(&self) -> Setting {
        self.lock().clone()
    }

    /// Sets another filter, for good or for a while; the one before it holds again then.
    ///
    /// # Errors
    /// It is none.
    pub(crate) fn set(&'static self, text: &str, time: Option<Duration>) -> Result<Setting, String> {
        let text = filter(text)?;
        let setting = {
            let mut now = self.lock();
            // A second change for a while does not make the first one last.
            let usual = now.until.take().map_or_else(|| now.filter.clone(), |(_, usual)| usual);
            let until = time.map(|time| (SystemTime::now() + time, usual));
            *now = Setting { filter: text, until, number: now.number + 1 };
            self.apply(&now.filter)?;
            now.clone()
        };
        if let (Some(time), Some((_, usual))) = (time, setting.until.clone()) {
            let number = setting.number;
            tokio::spawn(async move {
                tokio::time::sleep(time).await;
                let mut now = self.lock();
                if now.number == number {
                    *now = Setting { filter: usual, until: None, number: number + 1 };
                    if let Err(error) = self.apply(&now.filter) {
                        tracing::error!(error, "the log level could not be set back");
                    }
                }
            });
        }
        Ok(setting)
    }

    fn apply(&self, filter: &str) -> Result<(), String> {
        let filter = EnvFilter::try_new(filter).map_err(|error| error.to_string())?;
        self.handle.reload(filter).map_err(|error| error.to_string())
    }

    fn lock(&self) -> MutexGuard<'_, Setting> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Starts the log for the whole process, on the runtime.
///
/// # Errors
/// The filter is none, or there is a log already.
pub(crate) fn start(text: &str, format: LogFormat) -> Result<(), Failure> {
    let filter = EnvFilter::try_new(text).map_err(|error| format!("--log {text:?}: {error}"))?;
    let (filter, handle) = reload::Layer::new(filter);
    let coloured = AutoStream::choice(&std::io::stderr()) != ColorChoice::Never;
    let log = fmt::layer().with_writer(std::io::stderr);
    let log = match format {
        LogFormat::Text => log.with_target(false).with_ansi(coloured).boxed(),
        LogFormat::Json => log.json().flatten_event(true).with_span_list(false).boxed(),
    };
    // What is logged says nothing of what is traced.
    let log = tracing_subscriber::registry().with(log.with_filter(filter));
    #[cfg(feature = "otel")]
    let log = log.with(crate::traces::layer()?);
    log.try_init()?;
    let now = Mutex::new(Setting { filter: text.to_owned(), until: None, number: 0 });
    // Nobody else starts one: that would have failed above.
    let _ = LEVEL.set(Level { handle, now });
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
