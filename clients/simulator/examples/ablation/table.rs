//! The table in markdown, row by row, with its spread over the seeds.

use std::fmt::{Display, Formatter, Result};

use palpate_core::reconstruction::ALGORITHM_VERSION;

use crate::run::Run;

/// The command, how to read the figures, and the head of the table.
pub(crate) fn head(objects: &[&str], seeds: u64, attempts: u32) -> String {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let columns: Vec<String> = objects.iter().map(|object| object.replace('_', " ")).collect();
    format!(
        "```bash\n\
         cargo run --release --locked -p palpate-simulator --example ablation -- {}\n\
         ```\n\n\
         Algorithm {ALGORITHM_VERSION}; seeds 1 to {seeds}, {attempts} attempts a run, failures included.\n\
         `±` is the standard deviation over the seeds of the mean over the objects.\n\n\
         | METHOD_PALPATE | surface distance, mm | failures of {attempts} | worst run, mm | {} |\n\
         |---|---|---|---|{}",
        arguments.join(" "),
        columns.join(" | "),
        "---|".repeat(columns.len()),
    )
}

/// All runs of one choice of stages.
#[derive(Debug)]
pub(crate) struct Row<'a> {
    pub(crate) name: &'a str,
    /// In the order of the columns.
    pub(crate) objects: &'a [&'a str],
    pub(crate) runs: &'a [Run],
}

impl Row<'_> {
    /// Mean and standard deviation over the seeds of a figure's mean over the objects.
    fn over_seeds(&self, figure: impl Fn(&Run) -> f64, digits: usize) -> String {
        let mut seeds: Vec<u64> = self.runs.iter().map(|run| run.seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        let of = |seed| mean(self.runs.iter().filter(|run| run.seed == seed).map(&figure));
        let means: Vec<f64> = seeds.into_iter().map(of).collect();
        let middle = mean(means.iter().copied());
        if means.len() < 2 {
            return format!("{middle:.digits$}");
        }
        let squares: f64 = means.iter().map(|value| (value - middle).powi(2)).sum();
        let deviation = (squares / (means.len() - 1) as f64).sqrt();
        format!("{middle:.digits$} ± {deviation:.digits$}")
    }
}

impl Display for Row<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let distance = self.over_seeds(|run| run.surface_distance_mm, 3);
        let failures = self.over_seeds(|run| f64::from(run.failures), 2);
        write!(f, "| {} | {distance} | {failures} |", self.name)?;
        if let Some(worst) =
            self.runs.iter().max_by(|a, b| a.surface_distance_mm.total_cmp(&b.surface_distance_mm))
        {
            let object = worst.object.replace('_', " ");
            write!(f, " {:.2} ({object}, seed {}) |", worst.surface_distance_mm, worst.seed)?;
        }
        for object in self.objects {
            let runs = self.runs.iter().filter(|run| run.object == *object);
            write!(f, " {:.2} |", mean(runs.map(|run| run.surface_distance_mm)))?;
        }
        Ok(())
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    sum / f64::from(count)
}
