//! Fits what METHOD_PALPATE states about itself to what is true: the calibration of its standard
//! deviations, and the law of the risk that an approach fails.
//!
//! Explorations with seeds of their own are run in process. For every vertex after the fifth attempt
//! there is a stated deviation and a true distance; for every candidate a stated deviation and an
//! outcome. The scale of the deviations is the one with which 95.4 % of the true distances lie within
//! two of them; the law of the risk is the most likely one.
//!
//! ```bash
//! cargo run --release --locked -p palpate-simulator --example calibrate -- --meshes ../shared/meshes
//! ```

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use palpate_core::config::{Config, Settings, Strategy};
use palpate_core::exploration::RiskLaw;
use palpate_core::local::Calibration;
use palpate_core::metrics::StatedError;
use palpate_simulator::camera::Camera;
use palpate_simulator::in_process::Exploration;
use palpate_simulator::objects::{self, Object, Problem};
use palpate_simulator::parallel::in_parallel;
use palpate_simulator::probe;

/// What is stated before this attempt is a guess, whatever the calibration.
const FIRST_ATTEMPT: usize = 5;
/// Attempts up to this one are looked at apart: the template has seen one side only.
const EARLY_ATTEMPTS: usize = 5;
/// Share of a normal variable within two standard deviations of its mean.
const WITHIN_TWO: f64 = 0.9545;

/// Fit the calibration of deviations and the law of the risk to simulated explorations.
#[derive(Debug, Parser)]
#[command(name = "calibrate")]
struct Args {
    /// Folder of closed meshes (.ply, .stl, .obj) in metres; generated objects without it.
    #[arg(long)]
    meshes: Option<PathBuf>,
    /// Names of objects, comma separated; all without it.
    #[arg(long, value_delimiter = ',')]
    objects: Vec<String>,
    /// First seed: others than those of docs/results.md.
    #[arg(long, default_value_t = 11)]
    first_seed: u64,
    /// How many seeds.
    #[arg(long, default_value_t = 4)]
    seeds: u64,
    /// Attempts of each exploration.
    #[arg(long, default_value_t = 50)]
    attempts: u32,
    /// The visible patch as a share of the whole surface.
    #[arg(long, default_value_t = Camera::default().patch_share)]
    patch: f64,
}

/// What one exploration says about the calibration.
#[derive(Default)]
struct Sample {
    /// Stated deviations and true distances of vertices.
    errors: Vec<StatedError>,
    /// What was tried.
    attempts: Vec<Tried>,
}

/// A candidate that was tried.
#[derive(Clone, Copy)]
struct Tried {
    /// One for the first of its exploration.
    number: usize,
    /// Its stated deviation in metres.
    std_m: f64,
    failed: bool,
}

fn main() -> ExitCode {
    match fit(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn fit(args: &Args) -> Result<(), Problem> {
    let objects = objects::load(args.meshes.as_deref(), &args.objects)?;
    let seeds = args.first_seed..args.first_seed + args.seeds;
    let plans: Vec<(&Object, u64, Strategy)> = seeds
        .flat_map(|seed| objects.iter().map(move |object| (object, seed)))
        .flat_map(|(object, seed)| [Strategy::Proactive, Strategy::ExpectedGain].map(|s| (object, seed, s)))
        .collect();
    let threads = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let samples = in_parallel(&plans, threads, |plan| explore(plan, args.attempts, args.patch));
    let mut all = Sample::default();
    for sample in samples {
        let Sample { errors, attempts } = sample?;
        all.errors.extend(errors);
        all.attempts.extend(attempts);
    }
    let Calibration { scale, least_m } = Calibration::FITTED;
    let within = share_within(&all.errors, scale, least_m);
    println!(
        "{} objects, seeds {} to {}, two strategies, {} attempts",
        objects.len(),
        args.first_seed,
        args.first_seed + args.seeds - 1,
        args.attempts
    );
    println!("deviations: {} of {} vertices within two of them", percent(within), all.errors.len());
    println!("  in use: scale {scale}; fitted: scale {:.2}", fitted_scale(&all.errors, least_m));
    let config = Config::default();
    let (early, later): (Vec<_>, Vec<_>) =
        all.attempts.iter().copied().partition(|tried| tried.number <= EARLY_ATTEMPTS);
    for (which, attempts) in [("all", &all.attempts), ("the first five", &early), ("later ones", &later)] {
        report_risk(which, attempts, &config);
    }
    Ok(())
}

fn report_risk(which: &str, attempts: &[Tried], config: &Config) {
    let failed = attempts.iter().filter(|tried| tried.failed).count();
    println!("risk, {which}: {failed} of {} attempts failed", attempts.len());
    for (name, law) in [("in use", RiskLaw::FITTED), ("fitted", fitted_law(attempts, config))] {
        let RiskLaw { scale } = law;
        let stated: f64 = attempts.iter().map(|tried| law.of_failure(config, tried.std_m)).sum();
        let likelihood = log_likelihood(&law, attempts, config);
        println!("  {name}: scale {scale:.2}: states {stated:.0} failures, log likelihood {likelihood:.1}");
    }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn explore(
    &(object, seed, strategy): &(&Object, u64, Strategy),
    attempts: u32,
    patch_share: f64,
) -> Result<Sample, Problem> {
    let exploration = Exploration {
        settings: Settings { strategy, ..Settings::default() },
        attempts,
        camera: Camera { patch_share, ..Camera::default() },
        ..Exploration::new(&object.body, seed)
    };
    let mut sample = Sample::default();
    let mut number = 0;
    exploration.run(|step| {
        number += 1;
        let failed = !matches!(step.outcome, probe::Outcome::Hit(_));
        sample.attempts.extend(step.candidate.std_m.map(|std_m| Tried { number, std_m, failed }));
        if number < FIRST_ATTEMPT {
            return;
        }
        let Some(surface) = step.state.surface() else { return };
        let stated = surface.mesh.vertices.iter().zip(surface.std_m.iter().flatten());
        sample.errors.extend(stated.step_by(7).map(|(vertex, std_m)| StatedError {
            std_m: *std_m,
            error_m: object.body.surface().closest(vertex).distance_m,
        }));
    })?;
    Ok(sample)
}

/// The share of errors within two deviations that are stated with another scale.
fn share_within(errors: &[StatedError], scale: f64, least_m: f64) -> f64 {
    let in_use = Calibration::FITTED;
    let other = Calibration { scale, least_m };
    let is_within = |error: &&StatedError| {
        let deviation_m = (error.std_m.powi(2) - in_use.least_m.powi(2)).max(0.0).sqrt() / in_use.scale;
        error.error_m <= 2.0 * other.stated_m(deviation_m)
    };
    errors.iter().filter(is_within).count() as f64 / errors.len().max(1) as f64
}

fn fitted_scale(errors: &[StatedError], least_m: f64) -> f64 {
    let scales = (1..=400).map(|step| 0.01 * f64::from(step));
    scales
        .into_iter()
        .find(|scale| share_within(errors, *scale, least_m) >= WITHIN_TWO)
        .unwrap_or(f64::INFINITY)
}

fn log_likelihood(law: &RiskLaw, attempts: &[Tried], config: &Config) -> f64 {
    let of = |&Tried { std_m, failed, .. }: &Tried| {
        let risk = law.of_failure(config, std_m).clamp(1e-6, 1.0 - 1e-6);
        if failed { risk.ln() } else { (1.0 - risk).ln() }
    };
    attempts.iter().map(of).sum()
}

fn fitted_law(attempts: &[Tried], config: &Config) -> RiskLaw {
    let laws = (4..=120).map(|scale| RiskLaw { scale: 0.05 * f64::from(scale) });
    let judged = laws.map(|law| (log_likelihood(&law, attempts, config), law));
    let better = |best: (f64, RiskLaw), other: (f64, RiskLaw)| if other.0 > best.0 { other } else { best };
    judged.fold((f64::NEG_INFINITY, RiskLaw::FITTED), better).1
}
