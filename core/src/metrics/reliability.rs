//! Whether what an estimate says of itself is true: deviations against errors, risks against failures.
//!
//! Pooled over many estimates, what is stated must agree with what is found: of the errors, 95.4 %
//! lie within two honest standard deviations; of the attempts that were said to fail with 20 %,
//! about 20 % do.

/// 97.5 % of a standard normal variable lie below: half of what a 95 % interval leaves out.
const Z_95: f64 = 1.959_964;

/// What was said of a vertex, and what is true.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedError {
    /// The standard deviation that was stated, in metres.
    pub std_m: f64,
    /// The true distance from the surface, in metres.
    pub error_m: f64,
}

impl StatedError {
    /// Whether the error is at most `sigmas` times what was stated.
    pub fn is_within(&self, sigmas: f64) -> bool {
        self.error_m <= sigmas * self.std_m
    }
}

/// Share of the errors within `sigmas` stated standard deviations, in [0, 1]; 0 of nothing.
pub fn coverage(errors: &[StatedError], sigmas: f64) -> f64 {
    let within = errors.iter().filter(|error| error.is_within(sigmas)).count();
    within as f64 / errors.len().max(1) as f64
}

/// Share of a normal variable within `sigmas` standard deviations of its mean, in [0, 1].
pub fn normal_coverage(sigmas: f64) -> f64 {
    libm::erf(sigmas / std::f64::consts::SQRT_2)
}

/// Vertices of which about the same was said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviationBin {
    /// How many.
    pub count: usize,
    /// The least and the greatest stated standard deviation, in metres.
    pub range_m: [f64; 2],
    /// Mean of the stated standard deviations, in metres.
    pub mean_std_m: f64,
    /// Root mean square of the true errors, in metres.
    pub rms_error_m: f64,
    /// Share of the errors within two stated standard deviations.
    pub within_2sigma: f64,
}

impl DeviationBin {
    /// All vertices of `errors` as one bin; `None` of nothing.
    pub fn of(errors: &[StatedError]) -> Option<Self> {
        if errors.is_empty() {
            return None;
        }
        let count = errors.len() as f64;
        let stated = || errors.iter().map(|error| error.std_m);
        let squares: f64 = errors.iter().map(|error| error.error_m.powi(2)).sum();
        Some(Self {
            count: errors.len(),
            range_m: [stated().fold(f64::INFINITY, f64::min), stated().fold(0.0, f64::max)],
            mean_std_m: stated().sum::<f64>() / count,
            rms_error_m: (squares / count).sqrt(),
            within_2sigma: coverage(errors, 2.0),
        })
    }
}

/// Vertices in `bins` quantiles of what was stated, the smallest deviations first.
///
/// Bins differ by at most one vertex; there are fewer where there are fewer vertices.
pub fn deviation_bins(mut errors: Vec<StatedError>, bins: usize) -> Vec<DeviationBin> {
    errors.sort_by(|a, b| a.std_m.total_cmp(&b.std_m));
    let edge = |bin: usize| bin * errors.len() / bins;
    (0..bins).filter_map(|bin| DeviationBin::of(&errors[edge(bin)..edge(bin + 1)])).collect()
}

/// What was said of an attempt, and how it ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedRisk {
    /// The probability of a failure that was stated, in [0, 1].
    pub risk: f64,
    /// Whether the attempt failed.
    pub failed: bool,
}

/// Attempts of which about the same was said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RiskBin {
    /// The bin's stated risks: at least the first, less than the second; 1 belongs to the last bin.
    pub range: [f64; 2],
    /// How many.
    pub count: usize,
    /// Mean of the stated risks.
    pub mean_risk: f64,
    /// Share that failed.
    pub failed: f64,
    /// 95 % confidence interval of that share, after Wilson: it fits small counts and shares near 0 too.
    pub failed_95: [f64; 2],
}

/// Attempts by stated risk, between consecutive `edges`; bins without any are left out.
pub fn risk_bins(attempts: &[StatedRisk], edges: &[f64]) -> Vec<RiskBin> {
    let bin = |range: &[f64]| {
        let [from, to] = *range else { return None };
        let belongs = |risk: f64| (from..to).contains(&risk) || (risk == to && to == 1.0);
        let members = || attempts.iter().filter(|attempt| belongs(attempt.risk));
        let count = members().count();
        let failed = members().filter(|attempt| attempt.failed).count() as f64 / count as f64;
        (count > 0).then(|| RiskBin {
            range: [from, to],
            count,
            mean_risk: members().map(|attempt| attempt.risk).sum::<f64>() / count as f64,
            failed,
            failed_95: wilson(failed, count as f64),
        })
    };
    edges.windows(2).filter_map(bin).collect()
}

/// Wilson's score interval of a share of `n`.
fn wilson(share: f64, n: f64) -> [f64; 2] {
    let z2 = Z_95 * Z_95;
    let centre = (share + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z_95 / (1.0 + z2 / n) * (share * (1.0 - share) / n + z2 / (4.0 * n * n)).sqrt();
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// `count` errors that are normal with the deviation `truth` times the stated one.
    fn normal_errors(count: usize, truth: f64) -> Vec<StatedError> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut uniform = || rng.random_range(f64::EPSILON..1.0);
        (0..count)
            .map(|_| {
                let std_m = 0.001 * (1.0 + uniform());
                // Box and Muller.
                let z: f64 = (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
                StatedError { std_m, error_m: (truth * std_m * z).abs() }
            })
            .collect()
    }

    #[test]
    fn honest_deviations_cover_what_a_normal_variable_promises() {
        let errors = normal_errors(40_000, 1.0);
        for sigmas in [0.5, 1.0, 2.0, 3.0] {
            assert!((coverage(&errors, sigmas) - normal_coverage(sigmas)).abs() < 0.01, "{sigmas}");
        }
        assert!((normal_coverage(1.0) - 0.682_689).abs() < 1e-6);
        assert!((normal_coverage(2.0) - 0.954_500).abs() < 1e-6);
        // Half of the true deviation stated: one normal deviation where two are expected.
        assert!((coverage(&normal_errors(40_000, 2.0), 2.0) - 0.682_689).abs() < 0.01);
        assert_eq!(coverage(&[], 2.0), 0.0);
    }

    #[test]
    fn quantile_bins_are_equally_full_and_ordered_by_what_was_stated() {
        let errors = normal_errors(10_003, 1.0);
        let bins = deviation_bins(errors, 10);
        assert_eq!(bins.iter().map(|bin| bin.count).sum::<usize>(), 10_003);
        assert!(bins.iter().all(|bin| bin.count.abs_diff(1_000) <= 1));
        assert!(bins.windows(2).all(|pair| pair[0].range_m[1] <= pair[1].range_m[0]));
        for bin in bins {
            assert!((bin.range_m[0]..=bin.range_m[1]).contains(&bin.mean_std_m));
            assert!((bin.rms_error_m / bin.mean_std_m - 1.0).abs() < 0.1, "{bin:?}");
        }
        let few = vec![StatedError { std_m: 0.001, error_m: 0.003 }; 2];
        assert_eq!(deviation_bins(few, 10).len(), 2, "no bin is empty");
        assert!(deviation_bins(Vec::new(), 10).is_empty());
    }

    #[test]
    fn a_risk_belongs_to_one_bin_and_certain_failure_to_the_last() {
        let attempt = |(risk, failed)| StatedRisk { risk, failed };
        let attempts =
            [(0.0, false), (0.09, true), (0.1, false), (0.2, true), (0.3, false), (1.0, true)].map(attempt);
        let bins = risk_bins(&attempts, &[0.0, 0.1, 0.5, 0.9, 1.0]);
        let shown: Vec<_> = bins.iter().map(|bin| (bin.range, bin.count)).collect();
        assert_eq!(shown, [([0.0, 0.1], 2), ([0.1, 0.5], 3), ([0.9, 1.0], 1)]);
        assert!((bins[1].mean_risk - 0.2).abs() < 1e-12);
        assert!((bins[1].failed - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn the_interval_of_a_share_is_wilsons() {
        let [low, high] = wilson(0.1, 10.0);
        assert!((low - 0.0179).abs() < 1e-4 && (high - 0.4042).abs() < 1e-4, "{low} {high}");
        let [low, high] = wilson(0.0, 30.0);
        assert!(low == 0.0 && (high - 0.1135).abs() < 1e-4, "none of 30 does not mean never: {high}");
    }
}
