//! What a person wants to know first when an evaluation is over; all the rest is in files.

use super::record::Run;
use super::spread::Spread;
use crate::terminal::{BOLD, styled};

/// A line a series: its mean over the objects of the means over the seeds. At most 42 columns.
pub(super) fn summary(series: &[(String, String)], objects: &[String], runs: &[Run]) -> String {
    let mut text = styled(BOLD, format_args!("{:<23} error mm  failures", "mean of all objects"));
    for (method, strategy) in series {
        let mean = |value: &dyn Fn(&Run) -> f64| {
            let of_object = |object: &String| {
                let is_of = |run: &&Run| {
                    let case = &run.case;
                    (&case.object, &case.method, &case.strategy) == (object, method, strategy)
                };
                Spread::of(runs.iter().filter(is_of).map(value)).map(|spread| spread.mean)
            };
            Spread::of(objects.iter().filter_map(of_object)).map(|spread| spread.mean)
        };
        let name = format!("{method} {strategy}");
        let error_mm = mean(&|run| 1e3 * run.last.surface_distance_m);
        let failures = mean(&|run| f64::from(run.missed() + run.early()));
        text.push_str(&match error_mm.zip(failures) {
            Some((error_mm, failures)) => format!("\n{name:<23} {error_mm:8.2}  {failures:8.1}"),
            None => format!("\n{name:<23} no run"),
        });
    }
    text
}

#[cfg(test)]
mod tests {
    use palpate_client::proto::v1::Strategy;

    use super::*;

    #[test]
    fn the_summary_is_a_line_a_series_and_fits_into_42_columns() {
        let runs = [
            Run::example("lamp", Strategy::MinUncertainty, 1, 1.0),
            Run::example("lamp", Strategy::MinUncertainty, 2, 3.0),
            Run::example("can", Strategy::MinUncertainty, 1, 10.0),
        ];
        let series = [("paper", "min_uncertainty"), ("palpate", "min_uncertainty")]
            .map(|(method, strategy)| (method.to_owned(), strategy.to_owned()));
        let text = summary(&series, &["lamp", "can"].map(str::to_owned), &runs);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[1], "paper min_uncertainty       6.00       3.2");
        assert_eq!(lines[2], "palpate min_uncertainty no run");
        assert!(lines[1..].iter().all(|line| line.len() <= 42), "{text}");
    }
}
