//! Mean and spread over seeds.

/// Mean and sample standard deviation of some runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    pub(super) mean: f64,
    /// Zero for a single value.
    pub(super) sd: f64,
    /// How many values.
    pub(super) n: usize,
}

impl Spread {
    /// `None` of nothing.
    pub(super) fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let values: Vec<f64> = values.into_iter().collect();
        let n = values.len();
        if n == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let sd = if n > 1 { (squares / (n - 1) as f64).sqrt() } else { 0.0 };
        Some(Self { mean, sd, n })
    }

    /// `mean ± sd` with `digits` after the point; a single value has no spread to show.
    pub(super) fn show(&self, digits: usize) -> String {
        let Self { mean, sd, n } = self;
        if *n > 1 { format!("{mean:.digits$} ± {sd:.digits$}") } else { format!("{mean:.digits$}") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_is_that_of_a_sample() {
        let spread = Spread::of([1.0, 2.0, 3.0, 4.0]).unwrap();
        assert_eq!(spread.mean, 2.5);
        assert!((spread.sd - (5.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert_eq!(spread.show(2), "2.50 ± 1.29");
        assert_eq!(Spread::of([7.0]).unwrap().show(1), "7.0");
        assert!(Spread::of([]).is_none());
    }
}
