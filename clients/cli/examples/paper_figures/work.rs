//! The runs behind the figures, and how far they have come.

use std::fmt::Display;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use palpate_core::reconstruction::Reconstruction;
use palpate_simulator::in_process::Exploration;
use palpate_simulator::objects::Problem;

/// A bar over all attempts of all runs; a line a run where there is no terminal.
#[derive(Debug)]
pub(crate) struct Work {
    bar: ProgressBar,
}

impl Work {
    /// Nothing is done yet of this many attempts.
    pub(crate) fn begin(attempts: u64) -> Result<Self, Problem> {
        let bar = ProgressBar::new(attempts);
        bar.set_style(ProgressStyle::with_template("{wide_bar} {pos}/{len} attempts, {eta} left")?);
        bar.enable_steady_tick(Duration::from_secs(1));
        Ok(Self { bar })
    }

    /// Makes a run: its state after the look, then after each attempt. There are fewer where nothing was
    /// left to propose.
    pub(crate) fn explore(
        &self,
        name: impl Display,
        exploration: &Exploration<'_>,
    ) -> Result<Vec<Reconstruction>, Problem> {
        let look = Exploration { attempts: 0, ..exploration.clone() };
        let mut states = vec![look.run(|_| ())?];
        exploration.run(|step| {
            states.push(step.state.clone());
            self.bar.inc(1);
        })?;
        if self.bar.is_hidden() {
            println!("explored: {name}");
        }
        Ok(states)
    }

    /// Tells of something that is finished.
    pub(crate) fn say(&self, line: impl Display) {
        self.bar.suspend(|| println!("{line}"));
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
