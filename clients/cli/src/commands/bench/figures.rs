//! What was measured: each contact, and what they come to.

use std::fmt;
use std::path::Path;
use std::time::Duration;

use crate::failure::Failure;

/// What became of a contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    pub(super) robot: usize,
    /// Which of the robot's contacts, from 0.
    pub(super) contact: u32,
    /// When it was due, after the start.
    pub(super) since: Duration,
    /// How long it took until it was answered or given up, refusals included.
    pub(super) waited: Duration,
    pub(super) refusals: u32,
    pub(super) is_answered: bool,
}

/// A run.
#[derive(Debug)]
pub(super) struct Figures {
    pub(super) answers: Vec<Answer>,
    pub(super) elapsed: Duration,
    pub(super) rate: Option<f64>,
    /// How long the servers computed, where that is known.
    pub(super) cpu: Option<Duration>,
    /// How long PostgreSQL computed, where that is known.
    pub(super) database_cpu: Option<Duration>,
    /// The most memory that the servers had at once, where that is known.
    pub(super) memory_bytes: Option<u64>,
}

impl Figures {
    /// Waits of the contacts that were answered, the shortest first, in milliseconds.
    pub(super) fn waits_ms(&self) -> Vec<f64> {
        let answered = self.answers.iter().filter(|answer| answer.is_answered);
        let mut waits: Vec<f64> = answered.map(|answer| 1e3 * answer.waited.as_secs_f64()).collect();
        waits.sort_by(f64::total_cmp);
        waits
    }

    /// Writes a row for each contact.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn write(&self, path: &Path) -> Result<(), Failure> {
        let mut table = csv::Writer::from_path(path)?;
        table.write_record(["robot", "contact", "due_s", "wait_ms", "refusals", "answered"])?;
        for Answer { robot, contact, since, waited, refusals, is_answered } in &self.answers {
            table.write_record([
                robot.to_string(),
                contact.to_string(),
                format!("{:.6}", since.as_secs_f64()),
                format!("{:.3}", 1e3 * waited.as_secs_f64()),
                refusals.to_string(),
                is_answered.to_string(),
            ])?;
        }
        Ok(table.flush()?)
    }
}

/// The wait that a share of all contacts does not exceed; `waits` are in order.
fn quantile(waits: &[f64], share: f64) -> f64 {
    let place = (share * waits.len() as f64).ceil() as usize;
    waits.get(place.max(1) - 1).copied().unwrap_or(f64::NAN)
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let waits = self.waits_ms();
        let seconds = self.elapsed.as_secs_f64();
        let given_up = self.answers.len() - waits.len();
        let refusals: u32 = self.answers.iter().map(|answer| answer.refusals).sum();
        writeln!(
            f,
            "contacts   {} answered in {seconds:.1} s: {:.1} a second",
            waits.len(),
            waits.len() as f64 / seconds
        )?;
        if let Some(rate) = self.rate {
            writeln!(f, "           {rate:.1} a second were due")?;
        }
        let [p50, p90, p99] = [0.5, 0.9, 0.99].map(|share| quantile(&waits, share));
        writeln!(f, "wait       {p50:.0} ms median, {p90:.0} ms p90, {p99:.0} ms p99")?;
        write!(f, "refusals   {refusals}, given up {given_up}")?;
        for (name, cpu) in [("server    ", self.cpu), ("PostgreSQL", self.database_cpu)] {
            let Some(cpu) = cpu else { continue };
            let each_ms = 1e3 * cpu.as_secs_f64() / waits.len().max(1) as f64;
            write!(f, "\n{name} {:.1} s of a core, {each_ms:.1} ms a contact", cpu.as_secs_f64())?;
        }
        if let Some(bytes) = self.memory_bytes {
            write!(f, "\n           {:.0} MB of memory at most", bytes as f64 / 1e6)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_is_the_wait_that_the_share_does_not_exceed() {
        let waits: Vec<f64> = (1..=200).map(f64::from).collect();
        assert_eq!([0.5, 0.9, 0.99, 1.0].map(|share| quantile(&waits, share)), [100.0, 180.0, 198.0, 200.0]);
        assert_eq!(quantile(&[7.0], 0.5), 7.0);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn what_was_given_up_is_told_and_in_no_wait() {
        let answer = |waited, is_answered| Answer {
            robot: 0,
            contact: 0,
            since: Duration::ZERO,
            waited: Duration::from_millis(waited),
            refusals: 2,
            is_answered,
        };
        let figures = Figures {
            answers: vec![answer(30, true), answer(10, true), answer(900, false)],
            elapsed: Duration::from_secs(2),
            rate: Some(1.5),
            cpu: Some(Duration::from_millis(50)),
            database_cpu: Some(Duration::from_millis(6)),
            memory_bytes: Some(40_000_000),
        };
        let told = figures.to_string();
        for part in [
            "2 answered in 2.0 s: 1.0 a second",
            "10 ms median",
            "30 ms p99",
            "refusals   6, given up 1",
            "server     0.1 s of a core, 25.0 ms a contact",
            "PostgreSQL 0.0 s of a core, 3.0 ms a contact",
            "40 MB",
        ] {
            assert!(told.contains(part), "{part}: {told}");
        }
    }
}
