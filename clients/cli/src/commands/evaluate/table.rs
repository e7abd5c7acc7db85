//! The report: a markdown table laid out like the paper's Table I, the published figures beside.

use std::fmt::Write;

use super::names::cell;
use super::paper;
use super::record::Run;
use super::reliability::{self, MEASURED_EVERY, Statements};
use super::spread::Spread;

/// What the tables are made of, besides the runs.
#[derive(Debug)]
pub(super) struct Report<'a> {
    /// The command as it was typed.
    pub(super) command: &'a str,
    /// Of this program.
    pub(super) version: &'a str,
    /// Of the method on the server.
    pub(super) algorithm_version: &'a str,
    /// Attempts of each run.
    pub(super) attempts: u32,
    /// Names and sampling floors (chamfer sum, mm) of the objects, in the order of the columns.
    pub(super) objects: &'a [(String, f64)],
    /// Methods and strategies, in the order of the rows.
    pub(super) series: &'a [(String, String)],
    /// How many seeds each cell has.
    pub(super) seeds: u64,
    /// How many runs there would be if all had ended well.
    pub(super) planned: usize,
    /// Samples of each surface behind a chamfer distance.
    pub(super) chamfer_points: usize,
    /// All runs.
    pub(super) runs: &'a [Run],
    /// Whether anything goes wrong on purpose, so that a server that says nothing of it is worth a row.
    pub(super) has_faults: bool,
    /// What the methods stated in them.
    pub(super) statements: &'a [Statements],
}

const NOTES: &str = "\
Figures are mean ± standard deviation over the seeds; a seed decides the view, the patch and the offsets on the pad.
A run that the server stopped early counts with its last estimate.
The chamfer distance is the sum of the two directed means between random samples; the paper states neither its \
convention nor its number of samples.
The sampling floor is what the exact surface scores against other samples of itself: a figure near it says nothing \
about the reconstruction.
The surface distance is the mean of the two directed mean point-to-surface distances, computed from the triangles; \
it has no floor.
The event log of every run is kept in `sessions.db` beside this file: `palpate serve --database sessions.db` shows it.
`runs.csv` has one line a run, `attempts.csv` one an attempt, `plots/` the course of every object.
";

const PUBLISHED_NOTES: &str = "\
Published figures are those of Table I for objects of the same name: three executions each, from other views.
The published minU leaves out runs that were trapped in repeated failures; here every run counts.
";

const WARNING_NOTES: &str = "
A run has a warning if a reply of the server told of something wrong; an early contact, which is a failure, and a table \
that was not declared do not count.
";

impl Report<'_> {
    /// The whole report as markdown.
    pub(super) fn markdown(&self) -> String {
        let mut text = String::from("# Evaluation\n\n```bash\n");
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}\n```\n", self.command);
        let _ = writeln!(text, "palpate {}, algorithm {}.", self.version, self.algorithm_version);
        let seeds = if self.seeds == 1 { "seed 1".to_owned() } else { format!("seeds 1 to {}", self.seeds) };
        let _ = writeln!(text, "{} attempts a run, failures included; {seeds}.\n", self.attempts);
        if self.runs.len() < self.planned {
            let (made, planned) = (self.runs.len(), self.planned);
            let _ =
                writeln!(text, "**Incomplete: {made} of {planned} runs.** `--resume` makes the others.\n");
        }
        text.push_str(NOTES);
        if self.objects.iter().any(|(object, _)| paper::column(object).is_some()) {
            text.push_str(PUBLISHED_NOTES);
        }
        text.push_str("\n## Chamfer distance and failures, as in Table I\n\n");
        self.header(&mut text);
        let chamfer = format!("chamfer, mm, {} samples", self.chamfer_points);
        self.rows(&mut text, &chamfer, 2, |run| Some(1e3 * run.last.chamfer.sum_m), published_chamfer);
        let floors: Vec<_> = self.objects.iter().map(|(_, floor)| Some(*floor)).collect();
        self.row(&mut text, &chamfer, "sampling floor", &show_all(&floors, 2), &mean_of(&floors, 2));
        let failures = format!("failures of {}", self.attempts);
        // Fifty attempts are what the published failures are counted over.
        let published = if self.attempts == 50 { published_failures } else { nothing_published };
        self.rows(&mut text, &failures, 1, |run| Some(f64::from(run.missed() + run.early())), published);
        self.rows(&mut text, "of these, missed", 1, |run| Some(f64::from(run.missed())), nothing_published);
        self.rows(&mut text, "of these, early", 1, |run| Some(f64::from(run.early())), nothing_published);
        self.warned_rows(&mut text);
        text.push_str("\n## Surface distance and the other metrics\n\n");
        self.header(&mut text);
        let calibration =
            format!("true error within 2 sigma, mean of attempts {MEASURED_EVERY} to {}", self.attempts);
        let metrics: [(&str, usize, Metric); 6] = [
            ("surface distance, mm", 2, |run| Some(1e3 * run.last.surface_distance_m)),
            ("Hausdorff distance, mm", 1, |run| Some(1e3 * run.last.hausdorff_m)),
            ("F-score at 1 mm", 2, |run| Some(run.last.f_score_1mm)),
            ("coverage at 2 mm", 2, |run| Some(run.last.coverage)),
            ("volume, of the true one", 2, |run| Some(run.last.volume_ratio)),
            (&calibration, 3, Run::within_2sigma),
        ];
        for (metric, digits, value) in metrics {
            self.rows(&mut text, metric, digits, value, nothing_published);
        }
        text.push_str(&reliability::markdown(self.statements));
        text
    }

    fn header(&self, text: &mut String) {
        let names: Vec<_> = self.objects.iter().map(|(name, _)| cell(name)).collect();
        let _ = writeln!(text, "| metric | method, strategy | {} | mean |", names.join(" | "));
        let _ = writeln!(text, "|---|---|{}---|", "---|".repeat(names.len()));
    }

    /// One row a series, each followed by its published counterpart where there is one.
    fn rows(
        &self,
        text: &mut String,
        metric: &str,
        digits: usize,
        value: Metric,
        published: fn(&paper::Column, usize) -> Option<paper::Spread>,
    ) {
        for (method, strategy) in self.series {
            let cells = self.cells(method, strategy, value);
            if cells.iter().all(Option::is_none) {
                continue;
            }
            let means: Vec<_> = cells.iter().map(|cell| cell.map(|spread| spread.mean)).collect();
            let shown: Vec<_> = cells.iter().map(|cell| cell.map(|spread| spread.show(digits))).collect();
            self.row(text, metric, &format!("{method}, {strategy}"), &shown, &mean_of(&means, digits));
            self.published_row(text, metric, digits, strategy, published);
        }
    }

    /// What a series has come to, object by object.
    fn cells(&self, method: &String, strategy: &String, value: Metric) -> Vec<Option<Spread>> {
        let of_object = |(object, _): &(String, f64)| {
            let of_cell = |run: &&Run| {
                let case = &run.case;
                (&case.object, &case.method, &case.strategy) == (object, method, strategy)
            };
            Spread::of(self.runs.iter().filter(of_cell).filter_map(value))
        };
        self.objects.iter().map(of_object).collect()
    }

    /// One row a series: how many of its runs the server warned of, where there is something to warn of.
    fn warned_rows(&self, text: &mut String) {
        if !self.has_faults && self.runs.iter().all(|run| run.warnings == 0) {
            return;
        }
        let warned = |run: &Run| Some(if run.warnings > 0 { 100.0 } else { 0.0 });
        for (method, strategy) in self.series {
            let shares: Vec<_> = self
                .cells(method, strategy, warned)
                .iter()
                .map(|cell| cell.map(|spread| spread.mean))
                .collect();
            if shares.iter().any(Option::is_some) {
                let series = format!("{method}, {strategy}");
                self.row(
                    text,
                    "runs with a warning, %",
                    &series,
                    &show_all(&shares, 0),
                    &mean_of(&shares, 0),
                );
            }
        }
        text.push_str(WARNING_NOTES);
    }

    fn published_row(
        &self,
        text: &mut String,
        metric: &str,
        digits: usize,
        strategy: &str,
        published: fn(&paper::Column, usize) -> Option<paper::Spread>,
    ) {
        let (which, name) = match strategy {
            "proactive" => (0, "published, OURS"),
            "min_uncertainty" => (1, "published, minU"),
            _ => return,
        };
        let cells: Vec<_> = self
            .objects
            .iter()
            .map(|(object, _)| paper::column(object).and_then(|column| published(column, which)))
            .collect();
        if cells.iter().all(Option::is_none) {
            return;
        }
        let means: Vec<_> = cells.iter().map(|cell| cell.map(|(mean, _)| mean)).collect();
        let shown: Vec<_> = cells
            .iter()
            .map(|cell| cell.map(|(mean, sd)| format!("{mean:.digits$} ± {sd:.digits$}")))
            .collect();
        self.row(text, metric, name, &shown, &mean_of(&means, digits));
    }

    fn row(&self, text: &mut String, metric: &str, series: &str, cells: &[Option<String>], mean: &str) {
        let cells: Vec<_> = cells.iter().map(|cell| cell.as_deref().unwrap_or("–")).collect();
        let _ = writeln!(text, "| {metric} | {series} | {} | {mean} |", cells.join(" | "));
    }
}

/// What a row shows of a run.
type Metric = fn(&Run) -> Option<f64>;

fn published_chamfer(column: &paper::Column, which: usize) -> Option<paper::Spread> {
    Some(column.chamfer_mm[which])
}

fn published_failures(column: &paper::Column, which: usize) -> Option<paper::Spread> {
    Some(column.failures[which])
}

fn nothing_published(_: &paper::Column, _: usize) -> Option<paper::Spread> {
    None
}

fn show_all(values: &[Option<f64>], digits: usize) -> Vec<Option<String>> {
    values.iter().map(|value| value.map(|value| format!("{value:.digits$}"))).collect()
}

/// The mean over the objects, if every object has a value.
fn mean_of(values: &[Option<f64>], digits: usize) -> String {
    let known: Option<Vec<f64>> = values.iter().copied().collect();
    match known.and_then(Spread::of) {
        Some(spread) => format!("{:.digits$}", spread.mean),
        None => "–".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use palpate_client::proto::v1::Strategy;

    use super::super::record::AttemptRow;
    use super::*;

    fn report(objects: &[(String, f64)], runs: &[Run]) -> String {
        Report {
            command: "palpate evaluate --seeds 2",
            version: "0.1.0",
            algorithm_version: "paper-1",
            attempts: 50,
            objects,
            series: &[("paper".to_owned(), "proactive".to_owned())],
            seeds: 2,
            planned: runs.len() + 1,
            chamfer_points: 13_000,
            runs,
            has_faults: false,
            statements: &[],
        }
        .markdown()
    }

    #[test]
    fn a_cell_is_the_mean_over_its_own_seeds_with_the_published_figure_below() {
        let objects = [("lamp".to_owned(), 1.05), ("sugar_box".to_owned(), 1.97)];
        let runs = [
            Run::example("lamp", Strategy::Proactive, 1, 1.0),
            Run::example("lamp", Strategy::Proactive, 2, 3.0),
            Run::example("lamp", Strategy::Random, 1, 99.0),
            Run::example("sugar_box", Strategy::Proactive, 1, 5.0),
            Run::example("sugar_box", Strategy::Proactive, 2, 5.0),
        ];
        let text = report(&objects, &runs);
        let lines = [
            "| metric | method, strategy | lamp | sugar box | mean |",
            "| chamfer, mm, 13000 samples | paper, proactive | 4.00 ± 2.83 | 10.00 ± 0.00 | 7.00 |",
            "| chamfer, mm, 13000 samples | published, OURS | 1.07 ± 0.01 | 3.82 ± 0.12 | 2.44 |",
            "| chamfer, mm, 13000 samples | sampling floor | 1.05 | 1.97 | 1.51 |",
            "| failures of 50 | paper, proactive | 3.5 ± 0.7 | 3.5 ± 0.7 | 3.5 |",
            "| failures of 50 | published, OURS | 1.0 ± 0.7 | 12.7 ± 1.8 | 6.8 |",
            "| surface distance, mm | paper, proactive | 2.00 ± 1.41 | 5.00 ± 0.00 | 3.50 |",
        ];
        for line in lines {
            assert!(text.contains(line), "{line}\nis not in\n{text}");
        }
        assert!(!text.contains("within 2 sigma"), "a metric that no run has is left out");
        assert!(text.contains("**Incomplete: 5 of 6 runs.**"), "{text}");
        assert!(text.contains("palpate evaluate --seeds 2\n"));
    }

    #[test]
    fn calibration_is_the_mean_over_the_attempts_at_which_it_was_measured() {
        let mut run = Run::example("lamp", Strategy::Proactive, 1, 1.0);
        let measured = run.attempts[1].clone();
        run.attempts
            .extend([0.9, 0.94].map(|share| AttemptRow { within_2sigma: Some(share), ..measured.clone() }));
        run.calibration_2sigma = Some(1.0);
        let text = report(&[("lamp".to_owned(), 1.05)], &[run]);
        let row =
            "| true error within 2 sigma, mean of attempts 5 to 50 | paper, proactive | 0.920 | 0.920 |";
        assert!(text.contains(row), "{text}");
    }

    #[test]
    fn runs_with_a_warning_are_shown_where_there_is_one_or_should_be() {
        let objects = [("lamp".to_owned(), 1.05), ("pear".to_owned(), 1.0)];
        let mut runs: Vec<_> = [("lamp", 1), ("lamp", 2), ("pear", 1)]
            .map(|(object, seed)| Run::example(object, Strategy::Proactive, seed, 1.0))
            .into();
        assert!(!report(&objects, &runs).contains("warning"));
        runs[1].warnings = 7;
        let text = report(&objects, &runs);
        assert!(text.contains("| runs with a warning, % | paper, proactive | 50 | 0 | 25 |"), "{text}");
        assert!(text.contains("\n\nA run has a warning if"), "the table ends before the note\n{text}");
    }

    #[test]
    fn objects_that_the_paper_does_not_have_get_no_published_row() {
        let objects = [("generated-mug".to_owned(), 1.0)];
        let text = report(&objects, &[Run::example("generated-mug", Strategy::Proactive, 1, 2.0)]);
        assert!(!text.to_lowercase().contains("published"), "{text}");
        assert!(text.contains("| 4.00 | 4.00 |"), "a single run has no spread\n{text}");
    }

    #[test]
    fn a_bar_in_an_objects_name_does_not_break_the_table() {
        let objects = [("a|b".to_owned(), 1.0)];
        let text = report(&objects, &[Run::example("a|b", Strategy::Proactive, 1, 2.0)]);
        assert!(text.contains(r"| metric | method, strategy | a\|b | mean |"), "{text}");
    }
}
