//! How far a copy of the database is, on a terminal.

use indicatif::{ProgressBar, ProgressStyle};
use palpate_server::Progress;

use crate::failure::Failure;

/// A bar for the copying, and then one for the checking.
#[derive(Debug)]
pub(crate) struct CopyProgress {
    copying: ProgressBar,
    proving: ProgressBar,
}

impl CopyProgress {
    /// Nothing is shown yet, and nothing is ever where there is no terminal.
    pub(crate) fn new() -> Result<Self, Failure> {
        Self::with("  copying  {wide_bar} {binary_bytes} of {binary_total_bytes}")
    }

    /// The same where events are counted, and not bytes.
    pub(crate) fn in_events() -> Result<Self, Failure> {
        Self::with("  copying  {wide_bar} {pos} of {len} events")
    }

    fn with(copying: &str) -> Result<Self, Failure> {
        let bar = |template: &str| {
            Ok::<_, Failure>(ProgressBar::no_length().with_style(ProgressStyle::with_template(template)?))
        };
        Ok(Self { copying: bar(copying)?, proving: bar("  checking {wide_bar} {pos} of {len} events")? })
    }

    /// Shows a step.
    pub(crate) fn show(&self, step: Progress) {
        let (bar, done, all) = match step {
            Progress::Copied(bytes, all) => (&self.copying, bytes, all),
            Progress::Proved(events, all) => (&self.proving, events, all),
        };
        bar.set_length(all.max(done));
        bar.set_position(done);
    }

    /// Takes both away.
    pub(crate) fn finish(&self) {
        self.copying.finish_and_clear();
        self.proving.finish_and_clear();
    }
}
