//! Whether the methods know how good they are: what they stated, pooled over objects, seeds and attempts.

use std::fmt::Write;

use palpate_core::metrics::{
    DeviationBin, RiskBin, StatedError, StatedRisk, coverage, deviation_bins, risk_bins,
};

use super::record::Run;

/// The stated deviations are compared with the truth after every so many attempts, this one first.
pub(super) const MEASURED_EVERY: u32 = 5;
/// Into how many quantiles of the stated deviation the vertices go.
const DEVIATION_BINS: usize = 10;
/// Until this attempt the object's other side is a guess, so their risks are shown apart as well.
const EARLY_ATTEMPTS: usize = 5;
/// Between these the stated risks are grouped: finer where most candidates are.
pub(super) const RISK_EDGES: [f64; 6] = [0.0, 0.01, 0.03, 0.1, 0.3, 1.0];

/// Everything that one method stated under one strategy, beside what was true.
#[derive(Debug)]
pub(super) struct Statements {
    /// Method and strategy.
    pub(super) name: String,
    /// Its place among the series, which decides its colour.
    pub(super) series: usize,
    /// The measured vertices of each object, all seeds and attempts together.
    pub(super) errors_by_object: Vec<Vec<StatedError>>,
    /// The candidates that were tried.
    pub(super) risks: Vec<StatedRisk>,
    /// Those of them that were among the first of their runs.
    pub(super) early_risks: Vec<StatedRisk>,
}

/// What each of the series stated; those that state nothing are left out.
pub(super) fn collect(series: &[(String, String)], objects: &[String], runs: &[Run]) -> Vec<Statements> {
    let of_series = |(place, (method, strategy)): (usize, &(String, String))| {
        let runs =
            || runs.iter().filter(move |run| (&run.case.method, &run.case.strategy) == (method, strategy));
        let of_object = |object: &String| -> Vec<StatedError> {
            let runs = runs().filter(|run| run.case.object == *object);
            runs.flat_map(|run| run.stated_errors.iter().copied()).collect()
        };
        let errors_by_object = objects.iter().map(of_object).filter(|errors| !errors.is_empty()).collect();
        // Before the rows of the attempts there is one of the state without any.
        let risks_until = |last: usize| {
            let attempts = runs().flat_map(|run| run.attempts.iter().take(last.saturating_add(1)));
            attempts
                .filter(|row| !row.is_false())
                .filter_map(|row| row.failure_risk.map(|risk| StatedRisk { risk, failed: row.failed() }))
                .collect()
        };
        Statements {
            name: format!("{method}, {strategy}"),
            series: place,
            errors_by_object,
            risks: risks_until(usize::MAX),
            early_risks: risks_until(EARLY_ATTEMPTS),
        }
    };
    let stated =
        |statements: &Statements| !statements.errors_by_object.is_empty() || !statements.risks.is_empty();
    series.iter().enumerate().map(of_series).filter(stated).collect()
}

const NOTES: &str = "\
A method that states how wrong it may be must be right about that.
All objects, seeds and attempts are pooled, every vertex counts the same, and so does every candidate that was tried.
";

impl Statements {
    /// The measured vertices of all objects.
    fn errors(&self) -> Vec<StatedError> {
        self.errors_by_object.concat()
    }

    /// The candidates by what was stated of them.
    pub(super) fn risk_bins(&self) -> Vec<RiskBin> {
        risk_bins(&self.risks, &RISK_EDGES)
    }

    fn markdown(&self, text: &mut String) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "\n### {}", self.name);
        let errors = self.errors();
        if let Some(all) = DeviationBin::of(&errors) {
            let shares = [1.0, 2.0, 3.0].map(|sigmas| 100.0 * coverage(&errors, sigmas));
            let [one, two, three] = shares;
            let _ = writeln!(
                text,
                "\nOf {} vertices {one:.1} % lie within one sigma, {two:.1} % within two, {three:.1} % within three; \
                 68.3, 95.4 and 99.7 % of a normal distribution do.\n",
                all.count
            );
            text.push_str(
                "| stated sigma, mm | mean, mm | rms true error, mm | within 2 sigma |\n|---|---|---|---|\n",
            );
            for bin in deviation_bins(errors, DEVIATION_BINS) {
                deviation_row(text, &bin);
            }
            deviation_row(text, &all);
        }
        if !self.risks.is_empty() {
            text.push_str(
                "\n| stated risk | candidates | mean | failed | 95 % interval |\n|---|---|---|---|---|\n",
            );
            for bin in self.risk_bins() {
                let [from, to] = bin.range.map(|share| 100.0 * share);
                risk_row(text, &format!("{from:.0} to {to:.0} %"), &bin);
            }
            let early = format!("attempts 1 to {EARLY_ATTEMPTS}");
            for (name, risks) in [(early.as_str(), &self.early_risks), ("all", &self.risks)] {
                risk_bins(risks, &[0.0, 1.0]).iter().for_each(|bin| risk_row(text, name, bin));
            }
        }
    }
}

fn deviation_row(text: &mut String, bin: &DeviationBin) {
    let [from, to, mean, rms] =
        [bin.range_m[0], bin.range_m[1], bin.mean_std_m, bin.rms_error_m].map(|metres| 1e3 * metres);
    let share = bin.within_2sigma;
    let _ = writeln!(text, "| {from:.2} to {to:.2} | {mean:.2} | {rms:.2} | {share:.3} |");
}

fn risk_row(text: &mut String, name: &str, bin: &RiskBin) {
    let [mean, failed, low, high] =
        [bin.mean_risk, bin.failed, bin.failed_95[0], bin.failed_95[1]].map(|share| 100.0 * share);
    let count = bin.count;
    let _ = writeln!(text, "| {name} | {count} | {mean:.2} % | {failed:.1} % | {low:.1} to {high:.1} % |");
}

/// The section of the report; empty if nothing was stated.
pub(super) fn markdown(statements: &[Statements]) -> String {
    if statements.is_empty() {
        return String::new();
    }
    let mut text = format!("\n## Stated uncertainty against the truth\n\n{NOTES}");
    let _ = writeln!(
        text,
        "The vertices are those after every attempt whose number is a multiple of {MEASURED_EVERY}, in \
         {DEVIATION_BINS} equal groups by stated sigma."
    );
    text.push_str("The last line of each table is all of them, the line before it the risks of the first attempts; `plots/reliability.svg` shows the same.\n");
    for statements in statements {
        statements.markdown(&mut text);
    }
    text
}

#[cfg(test)]
mod tests {
    use palpate_client::proto::v1::Strategy;

    use super::*;

    /// A run whose vertices are wrong by 1 mm, and whose one candidate was missed.
    fn stating(object: &str, std_m: &[f64], risk: f64) -> Run {
        let mut run = Run::example(object, Strategy::Proactive, 1, 1.0);
        run.stated_errors = std_m.iter().map(|&std_m| StatedError { std_m, error_m: 0.001 }).collect();
        run.attempts[1].within_2sigma = Some(coverage(&run.stated_errors, 2.0));
        run.attempts[1].failure_risk = Some(risk);
        run
    }

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(ToString::to_string).collect()
    }

    fn series() -> Vec<(String, String)> {
        [("other", "proactive"), ("paper", "proactive")].map(|(a, b)| (a.to_owned(), b.to_owned())).to_vec()
    }

    #[test]
    fn what_was_stated_is_pooled_over_runs_and_kept_apart_by_object() {
        let runs = [
            stating("lamp", &[0.001, 0.002], 0.02),
            stating("can", &[0.0001], 0.5),
            stating("lamp", &[0.003], 0.2),
        ];
        let found = collect(&series(), &names(&["lamp", "pear", "can"]), &runs);
        assert_eq!(found.len(), 1, "a series that stated nothing is left out");
        let statements = &found[0];
        assert_eq!((statements.name.as_str(), statements.series), ("paper, proactive", 1));
        let counts: Vec<_> = statements.errors_by_object.iter().map(Vec::len).collect();
        assert_eq!(counts, [3, 1], "the pear has none");
        assert!(statements.risks.iter().all(|stated| stated.failed));
        assert_eq!(statements.risk_bins().len(), 3);
    }

    #[test]
    fn a_contact_in_the_air_says_nothing_of_the_risk_that_was_stated() {
        let mut run = stating("lamp", &[0.001], 0.02);
        run.attempts[1].outcome = "false".to_owned();
        let found = collect(&series(), &names(&["lamp"]), &[run]);
        assert!(found[0].risks.is_empty() && !found[0].errors_by_object.is_empty());
    }

    #[test]
    fn the_tables_show_what_was_stated_beside_what_was_found() {
        let runs = [stating("lamp", &[0.0004, 0.001], 0.02), stating("can", &[0.002, 0.004], 0.2)];
        let text = markdown(&collect(&series(), &names(&["lamp", "can"]), &runs));
        let lines = [
            "### paper, proactive",
            "Of 4 vertices 75.0 % lie within one sigma, 75.0 % within two, 100.0 % within three;",
            "| 0.40 to 0.40 | 0.40 | 1.00 | 0.000 |",
            "| 4.00 to 4.00 | 4.00 | 1.00 | 1.000 |",
            "| 0.40 to 4.00 | 1.85 | 1.00 | 0.750 |",
            "| 1 to 3 % | 1 | 2.00 % | 100.0 % | 20.7 to 100.0 % |",
            "| attempts 1 to 5 | 2 | 11.00 % | 100.0 % | 34.2 to 100.0 % |",
            "| all | 2 | 11.00 % | 100.0 % | 34.2 to 100.0 % |",
        ];
        for line in lines {
            assert!(text.contains(line), "{line}\nis not in\n{text}");
        }
        assert!(markdown(&[]).is_empty());
    }
}
