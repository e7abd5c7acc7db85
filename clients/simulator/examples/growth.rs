//! What a long session costs and brings: the time of a contact step, and the surface's error, after ever
//! more touches.
//!
//! Explorations run in process, each on one thread; time is that of the processor, the mean over the latest
//! attempts, so that every extra of [`palpate_core::schedule`] is in it.
//!
//! ```bash
//! cargo run --release --locked -p palpate-simulator --example growth -- --meshes ../shared/meshes
//! ```

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use palpate_core::config::Settings;
use palpate_core::exploration::ProposalRequest;
use palpate_simulator::in_process::Exploration;
use palpate_simulator::objects::{self, Object, Problem};
use palpate_simulator::parallel::in_parallel;
use palpate_simulator::probe::{Outcome, ProbeSettings};

/// Attempts that the time of a step is the mean of: every extra has its turn four times.
const TIMED: usize = 16;

/// Measure what a contact step costs, and how far off the surface is, as a session grows.
#[derive(Debug, Parser)]
#[command(name = "growth")]
struct Args {
    /// Folder of closed meshes (.ply, .stl, .obj) in metres; generated objects without it.
    #[arg(long)]
    meshes: Option<PathBuf>,
    /// Names of objects, separated by commas; all without it.
    #[arg(long, value_delimiter = ',')]
    objects: Vec<String>,
    /// Explorations of each object, with the seeds from the first on.
    #[arg(long, default_value_t = 2)]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// After how many attempts to look, separated by commas.
    #[arg(long, value_delimiter = ',', default_values_t = [50, 150, 400])]
    attempts: Vec<usize>,
    /// Standard deviation of a touched position along each axis, in millimetres.
    #[arg(long, default_value_t = 0.0)]
    tactile_noise_mm: f64,
    /// Explorations at a time; by default as many as there are cores.
    #[arg(long)]
    threads: Option<NonZeroUsize>,
}

/// A session after some attempts.
#[derive(Clone, Copy, Debug)]
struct Mark {
    attempts: usize,
    surface_distance_mm: f64,
    within_two_sigma: f64,
    failures: usize,
    step_ms: f64,
}

fn main() -> ExitCode {
    match measure(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure(args: &Args) -> Result<(), Problem> {
    let objects = objects::load(args.meshes.as_deref(), &args.objects)?;
    let threads = args.threads.or(std::thread::available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN);
    let seeds = args.first_seed..args.first_seed + args.seeds;
    let plans: Vec<(&Object, u64)> =
        seeds.flat_map(|seed| objects.iter().map(move |object| (object, seed))).collect();
    println!("| object | seed | attempts | surface distance, mm | within 2 sigma | failures | step, ms |");
    println!("|---|---|---|---|---|---|---|");
    let explored = in_parallel(&plans, threads, |(object, seed)| {
        let marks = explore(object, *seed, args);
        for mark in marks.iter().flatten() {
            let Mark { attempts, surface_distance_mm, within_two_sigma, failures, step_ms } = mark;
            println!(
                "| {} | {seed} | {attempts} | {surface_distance_mm:.3} | {within_two_sigma:.3} | {failures} | {step_ms:.1} |",
                object.name
            );
        }
        marks
    });
    let explored: Vec<Mark> =
        explored.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    for attempts in &args.attempts {
        let marks: Vec<&Mark> = explored.iter().filter(|mark| mark.attempts == *attempts).collect();
        let mean = |of: fn(&Mark) -> f64| marks.iter().map(|mark| of(mark)).sum::<f64>() / marks.len() as f64;
        println!(
            "| mean | | {attempts} | {:.3} | {:.3} | {:.2} | {:.1} |",
            mean(|mark| mark.surface_distance_mm),
            mean(|mark| mark.within_two_sigma),
            mean(|mark| mark.failures as f64),
            mean(|mark| mark.step_ms)
        );
    }
    Ok(())
}

/// One exploration, looked at after each of the asked numbers of attempts.
fn explore(object: &Object, seed: u64, args: &Args) -> Result<Vec<Mark>, Problem> {
    let exploration = Exploration {
        settings: Settings::default(),
        attempts: args.attempts.iter().copied().max().unwrap_or(0) as u32,
        probe: ProbeSettings { tactile_noise_m: 1e-3 * args.tactile_noise_mm, ..ProbeSettings::default() },
        ..Exploration::new(&object.body, seed)
    };
    let (mut marks, mut failures, mut times_ms) = (Vec::new(), 0, Vec::new());
    let mut before: Option<palpate_core::reconstruction::Reconstruction> = None;
    let mut problem = None;
    exploration.run(|step| {
        failures += usize::from(!matches!(step.outcome, Outcome::Hit(_)));
        let number = times_ms.len() + 1;
        let is_timed = args.attempts.iter().any(|mark| number <= *mark && number + TIMED > *mark);
        let time = before.as_ref().filter(|_| is_timed).map(|before| {
            let start = processor_time();
            if let Ok((state, _)) = before.absorb(step.evidence) {
                state.propose(&ProposalRequest::best(1));
            }
            processor_time() - start
        });
        times_ms.push(time.map_or(f64::NAN, |time| 1e3 * time.as_secs_f64()));
        before = Some(step.state.clone());
        if args.attempts.contains(&number) {
            let Some(surface) = step.state.surface() else { return };
            let latest = &times_ms[times_ms.len().saturating_sub(TIMED)..];
            let timed: Vec<f64> = latest.iter().copied().filter(|ms| ms.is_finite()).collect();
            let (std_m, reference) = (surface.std_m.as_deref().unwrap_or_default(), &object.reference);
            let within = reference.calibration_2sigma(&surface.mesh, std_m);
            match reference.surface_distance_m(&surface.mesh).and_then(|m| Ok((m, within?))) {
                Ok((distance_m, within_two_sigma)) => marks.push(Mark {
                    attempts: number,
                    surface_distance_mm: 1e3 * distance_m,
                    within_two_sigma,
                    failures,
                    step_ms: timed.iter().sum::<f64>() / timed.len() as f64,
                }),
                Err(error) => problem = Some(error),
            }
        }
    })?;
    problem.map_or(Ok(marks), |error| Err(error.into()))
}

/// Time that this thread has been running, by the system's own count; wall time where it keeps none.
fn processor_time() -> Duration {
    use std::sync::OnceLock;
    static START: OnceLock<Instant> = OnceLock::new();
    let counted = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = counted.and_then(|text| text.split_whitespace().next()?.parse().ok());
    nanoseconds.map_or_else(|| START.get_or_init(Instant::now).elapsed(), Duration::from_nanos)
}
