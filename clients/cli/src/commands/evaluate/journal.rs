//! What is written as runs end, so that none is lost: a line for every attempt, a line for every run.
//!
//! ```text
//!   run ends ── deviations/run-0001.f32 ── lines of attempts.csv ── line of runs.csv: from here on it counts
//! ```
//!
//! Whatever was cut off before the last of these is dropped when the files are read again. The report is made from
//! the files, so an evaluation that was interrupted and resumed gives the same figures as one that was not.

use std::collections::{BTreeMap, HashMap};
use std::fs::{File, OpenOptions};
use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Writer, WriterBuilder};
use palpate_core::metrics::StatedError;
use serde::de::DeserializeOwned;

use super::cases::Case;
use super::folder::Folder;
use super::record::{AttemptRow, Run, RunRow};
use crate::failure::Failure;

/// Columns of a [`Case`], which come first in both files.
const CASE_COLUMNS: usize = 4;

/// The files of an evaluation that goes on.
#[derive(Debug)]
pub(super) struct Journal {
    folder: Folder,
    runs: Writer<File>,
    attempts: Writer<File>,
}

impl Journal {
    /// Goes on after what is in the folder, and tells the sessions of the runs that are finished.
    pub(super) fn open(folder: &Folder) -> Result<(Self, Vec<String>), Failure> {
        let finished = read(folder)?;
        rewrite(folder, &finished)?;
        let append = |path: &Path| -> Result<Writer<File>, Failure> {
            let file = OpenOptions::new().append(true).create(true).open(path)?;
            Ok(WriterBuilder::new().has_headers(finished.is_empty()).from_writer(file))
        };
        let (runs, attempts) = (append(&folder.runs())?, append(&folder.attempts())?);
        let finished = finished.into_iter().map(|run| run.session_id).collect();
        Ok((Self { folder: folder.clone(), runs, attempts }, finished))
    }

    /// Writes a run that has ended.
    pub(super) fn add(&mut self, run: &Run) -> Result<(), Failure> {
        if !run.stated_errors.is_empty() {
            std::fs::write(self.folder.deviations(&run.session_id), packed(&run.stated_errors))?;
        }
        write_attempts(&mut self.attempts, run)?;
        self.attempts.flush()?;
        self.runs.serialize((&run.case, RunRow::of(run)))?;
        Ok(self.runs.flush()?)
    }

    /// Brings the files into the order of these sessions, and gives back all runs.
    pub(super) fn close(self, order: &[String]) -> Result<Vec<Run>, Failure> {
        let Self { folder, runs, attempts } = self;
        drop((runs, attempts));
        let places: HashMap<&String, usize> = order.iter().zip(0..).collect();
        let mut runs = read(&folder)?;
        runs.sort_by_key(|run| places.get(&run.session_id).copied());
        rewrite(&folder, &runs)?;
        Ok(runs)
    }
}

fn write_attempts(writer: &mut Writer<File>, run: &Run) -> Result<(), Failure> {
    for row in &run.attempts {
        writer.serialize((&run.case, row))?;
    }
    Ok(())
}

/// Replaces both files at once each: whoever looks sees the old or the new ones, and so does a resumed evaluation.
fn rewrite(folder: &Folder, runs: &[Run]) -> Result<(), Failure> {
    let replace = |path: &Path, fill: &dyn Fn(&mut Writer<File>) -> Result<(), Failure>| {
        let new = path.with_extension("csv.new");
        let mut writer = Writer::from_path(&new)?;
        fill(&mut writer)?;
        writer.flush()?;
        Ok::<_, Failure>(std::fs::rename(new, path)?)
    };
    replace(&folder.attempts(), &|writer| runs.iter().try_for_each(|run| write_attempts(writer, run)))?;
    replace(&folder.runs(), &|writer| {
        runs.iter().try_for_each(|run| Ok(writer.serialize((&run.case, RunRow::of(run)))?))
    })
}

/// All runs that were written to their end.
fn read(folder: &Folder) -> Result<Vec<Run>, Failure> {
    let mut attempts: BTreeMap<String, Vec<AttemptRow>> = BTreeMap::new();
    for (case, row) in lines::<AttemptRow>(&folder.attempts())? {
        attempts.entry(case.to_string()).or_default().push(row);
    }
    let mut runs = Vec::new();
    for (case, row) in lines::<RunRow>(&folder.runs())? {
        let attempts = attempts.remove(&case.to_string()).unwrap_or_default();
        if attempts.len() != row.attempts + 1 {
            continue;
        }
        let deviations = folder.deviations(&row.session_id);
        let stated_errors =
            if deviations.exists() { unpacked(&std::fs::read(deviations)?) } else { Vec::new() };
        runs.push(row.into_run(case, attempts, stated_errors));
    }
    Ok(runs)
}

/// The whole lines of a file; none if there is no file.
fn lines<T: DeserializeOwned>(path: &Path) -> Result<Vec<(Case, T)>, Failure> {
    let text = if path.exists() { std::fs::read_to_string(path)? } else { String::new() };
    // What comes after the last end of a line was cut off.
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    let mut reader = ReaderBuilder::new().from_reader(whole.as_bytes());
    let (case_header, header) = split(reader.headers()?);
    let mut lines = Vec::new();
    for record in reader.records() {
        let (case, row) = split(&record?);
        lines.push((case.deserialize(Some(&case_header))?, row.deserialize(Some(&header))?));
    }
    Ok(lines)
}

fn split(record: &StringRecord) -> (StringRecord, StringRecord) {
    (record.iter().take(CASE_COLUMNS).collect(), record.iter().skip(CASE_COLUMNS).collect())
}

/// Pairs of stated deviation and true error in metres, single precision, the least significant byte first.
fn packed(errors: &[StatedError]) -> Vec<u8> {
    let pair = |error: &StatedError| [error.std_m, error.error_m].map(|value| (value as f32).to_le_bytes());
    errors.iter().flat_map(pair).flatten().collect()
}

fn unpacked(bytes: &[u8]) -> Vec<StatedError> {
    let number =
        |bytes: &[u8]| bytes.try_into().map_or(f64::NAN, |bytes| f64::from(f32::from_le_bytes(bytes)));
    let pair = |bytes: &[u8]| StatedError { std_m: number(&bytes[..4]), error_m: number(&bytes[4..]) };
    bytes.chunks_exact(8).map(pair).collect()
}

#[cfg(test)]
mod tests {
    use palpate_client::proto::v1::Strategy;

    use super::*;

    /// Two runs of a lamp, the second of which stated something.
    fn examples() -> [Run; 2] {
        let mut runs = [1, 2].map(|seed| Run::example("lamp", Strategy::Proactive, seed, 4.0));
        runs[1].session_id = "run-0002".to_owned();
        runs[1].attempts[1].within_2sigma = Some(0.9375);
        runs[1].attempts[1].failure_risk = Some(0.000_123_4);
        runs[1].stated_errors = vec![StatedError { std_m: 0.5, error_m: 0.25 }];
        runs
    }

    fn read_text(path: &Path) -> Vec<String> {
        std::fs::read_to_string(path).unwrap().lines().map(str::to_owned).collect()
    }

    #[test]
    fn files_have_a_header_and_a_line_for_each_with_counts_as_integers() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = Folder::prepare(temporary.path(), false).unwrap();
        let (mut journal, finished) = Journal::open(&folder).unwrap();
        assert!(finished.is_empty());
        for run in &examples() {
            journal.add(run).unwrap();
        }
        let attempts = read_text(&folder.attempts());
        assert_eq!(attempts.len(), 1 + 2 * 2);
        assert_eq!(
            attempts[0],
            "object,method,strategy,seed,attempt,outcome,surface_distance_mm,chamfer_sum_mm,\
             mean_uncertainty,missed_so_far,early_so_far,within_2sigma,failure_risk"
        );
        assert_eq!(attempts[2], "lamp,paper,proactive,1,1,miss,4.0,8.0,0.5,2,1,,", "nothing was stated");
        assert_eq!(attempts[4], "lamp,paper,proactive,2,1,miss,4.0,8.0,0.5,2,2,0.9375,0.000123");
        let runs = read_text(&folder.runs());
        assert_eq!(runs.len(), 1 + 2);
        assert!(runs[0].starts_with("object,method,strategy,seed,session_id,attempts,missed,early,"));
        assert!(runs[1].starts_with("lamp,paper,proactive,1,run-0001,1,2,1,4.0,8.0,4.0,10.0,0.5,0.75,"));
    }

    #[test]
    fn a_resumed_evaluation_keeps_whole_runs_and_drops_what_was_cut_off() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = Folder::prepare(temporary.path(), false).unwrap();
        let [first, second] = examples();
        let (mut journal, _) = Journal::open(&folder).unwrap();
        journal.add(&second).unwrap();
        drop(journal);
        // The process died while it wrote the other run.
        let torn = |path: &Path, text: &str| {
            std::fs::write(path, std::fs::read_to_string(path).unwrap() + text).unwrap();
        };
        torn(&folder.attempts(), "lamp,paper,proactive,1,0,view,12.0,24.0,0.5,0,0,,\nlamp,paper,pro");
        torn(&folder.runs(), "lamp,paper,proactive,1,run-0001,1,2");

        let (mut journal, finished) = Journal::open(&folder).unwrap();
        assert_eq!(finished, ["run-0002"]);
        assert_eq!(read_text(&folder.attempts()).len(), 1 + 2);
        journal.add(&first).unwrap();
        let order = ["run-0001", "run-0002"].map(str::to_owned);
        let mut kept = second;
        kept.attempts[1].failure_risk = Some(0.000_123);
        assert_eq!(journal.close(&order).unwrap(), [first, kept]);
        assert!(read_text(&folder.runs())[1].contains("run-0001"), "in the order of the runs");
    }
}
