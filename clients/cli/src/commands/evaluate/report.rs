//! All that is made of the runs: the tables, the pictures, and a few lines for the terminal.

use palpate_core::metrics::Sampling;

use super::folder::Folder;
use super::names::{RELIABILITY, file_names};
use super::objects::EvaluatedObject;
use super::plot::{Course, draw_reliability};
use super::record::Run;
use super::{reliability, summary, table};
use crate::failure::Failure;
use crate::terminal::counted;
use crate::version::VERSION;

/// What an evaluation has come to.
#[derive(Debug)]
pub(super) struct Report<'a> {
    pub(super) folder: &'a Folder,
    /// Of the method on the server.
    pub(super) algorithm_version: &'a str,
    /// Attempts of each run.
    pub(super) attempts: u32,
    pub(super) objects: &'a [EvaluatedObject],
    /// Methods and strategies.
    pub(super) series: &'a [(String, String)],
    /// How many seeds each object and series has.
    pub(super) seeds: u64,
    /// How many runs there would be if all had ended well.
    pub(super) planned: usize,
    /// Whether anything goes wrong on purpose.
    pub(super) has_faults: bool,
    /// The runs that there are.
    pub(super) runs: Vec<Run>,
}

impl Report<'_> {
    /// Writes the tables and the pictures.
    pub(super) fn write(&self) -> Result<(), Failure> {
        let names = self.names();
        for (object, file) in self.objects.iter().zip(file_names(&names)) {
            let plot = Course {
                object: &object.name,
                floor_mm: 1e3 * object.floor.sum_m,
                attempts: self.attempts,
                series: self.series,
                runs: &self.runs,
            };
            plot.write(&self.folder.plot(&file))?;
        }
        let statements = reliability::collect(self.series, &names, &self.runs);
        if !statements.is_empty() {
            draw_reliability(&statements, &self.folder.plot(RELIABILITY))?;
        }
        let columns: Vec<_> =
            self.objects.iter().map(|object| (object.name.clone(), 1e3 * object.floor.sum_m)).collect();
        let table = table::Report {
            command: &typed_command(std::env::args().skip(1)),
            version: &VERSION,
            algorithm_version: self.algorithm_version,
            attempts: self.attempts,
            objects: &columns,
            series: self.series,
            seeds: self.seeds,
            planned: self.planned,
            chamfer_points: Sampling::default().chamfer_points,
            runs: &self.runs,
            has_faults: self.has_faults,
            statements: &statements,
        };
        Ok(std::fs::write(self.folder.table(), table.markdown())?)
    }

    /// The main figures, and where all the others are.
    pub(super) fn summary(&self) -> String {
        let figures = summary::summary(self.series, &self.names(), &self.runs);
        let objects = counted(self.objects.len(), "object", "objects");
        let seeds = counted(self.seeds as usize, "seed", "seeds");
        let made = self.runs.len();
        let runs = match counted(self.planned, "run", "runs") {
            all if made == self.planned => all,
            all => format!("{made} of {all}"),
        };
        format!(
            "\n{figures}\n({runs}: {objects}, {seeds})\n\nwritten to {}:\n  \
             table.md      all tables\n  runs.csv      a line a run\n  attempts.csv  a line an attempt\n  \
             plots/        courses, reliability\n  sessions.db   every touch",
            self.folder.path().display()
        )
    }

    fn names(&self) -> Vec<String> {
        self.objects.iter().map(|object| object.name.clone()).collect()
    }
}

/// The command line as it was typed, with quotes where a shell needs them; without what changes no figure.
fn typed_command(args: impl Iterator<Item = String>) -> String {
    let words: Vec<String> =
        std::iter::once("palpate".to_owned()).chain(args).filter(|word| word != "--resume").collect();
    shlex::try_join(words.iter().map(String::as_str)).unwrap_or_else(|_| words.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_can_be_pasted_into_a_shell() {
        let typed = ["evaluate", "--meshes", "my meshes", "--objects", "can,box", "it's", "--resume"];
        let command = typed_command(typed.iter().map(ToString::to_string));
        let words = shlex::split(&command).unwrap();
        assert_eq!(words[0], "palpate");
        assert_eq!(words[1..], typed[..typed.len() - 1]);
    }
}
