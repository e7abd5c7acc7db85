//! What each idea of METHOD_PALPATE is worth: the method with all of them, and with each left out.
//!
//! The method runs in process, in front of the simulated camera and probe: no server, no database.
//! Every run has its own seed, so the table is the same whatever the number of threads.
//!
//! ```bash
//! cargo run --release --locked -p palpate-simulator --example ablation -- --meshes ../shared/meshes
//! ```

mod ideas;
mod run;
mod table;

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use palpate_core::config::Stages;
use palpate_simulator::camera::Camera;
use palpate_simulator::objects::{self, Object, Problem};
use palpate_simulator::parallel::in_parallel;

use self::ideas::Choice;
use self::run::{Plan, Run};
use self::table::Row;

/// Measure what each idea of METHOD_PALPATE is worth, and print a markdown table.
///
/// One row with every idea in use, then one for each with it left out. A row takes about a minute
/// for seven objects and five seeds on two cores.
#[derive(Debug, Parser)]
#[command(name = "ablation")]
struct Args {
    /// Folder of closed meshes (.ply, .stl, .obj) in metres.
    #[arg(long)]
    meshes: Option<PathBuf>,
    /// Names of objects, separated by commas: files of the folder without their ending, or
    /// generated ones such as bottle. By default all files, or all generated ones without a folder.
    #[arg(long, value_delimiter = ',')]
    objects: Vec<String>,
    /// Only these ideas, by the names of their switches in `Stages`, separated by commas.
    #[arg(long, value_delimiter = ',')]
    ideas: Vec<String>,
    /// Explorations of each object, with the seeds from 1 on.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..))]
    seeds: u64,
    /// Attempts of each exploration, failures included.
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    attempts: u32,
    /// The visible patch as a share of the whole surface.
    #[arg(long, default_value_t = Camera::default().patch_share)]
    patch: f64,
    /// Standard deviation of the camera along its rays, in millimetres.
    #[arg(long, default_value_t = 0.0)]
    depth_noise_mm: f64,
    /// Standard deviation of a touched position along each axis, in millimetres.
    #[arg(long, default_value_t = 0.0)]
    tactile_noise_mm: f64,
    /// Explorations at a time; by default as many as there are cores.
    #[arg(long)]
    threads: Option<NonZeroUsize>,
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
    let threads = match args.threads {
        Some(threads) => threads,
        None => std::thread::available_parallelism()?,
    };
    let choices = ideas::choices(&args.ideas)?;
    let bar = ProgressBar::new(choices.len() as u64 * args.seeds * objects.len() as u64);
    bar.set_style(ProgressStyle::with_template("{wide_bar} {pos}/{len} {msg}, {eta} left")?);
    bar.enable_steady_tick(Duration::from_secs(1));

    let names: Vec<&str> = objects.iter().map(|object| object.name.as_str()).collect();
    println!("{}", table::head(&names, args.seeds, args.attempts));
    for Choice { name, stages, .. } in choices {
        bar.set_message(name.to_owned());
        let plans: Vec<Plan> = (1..=args.seeds)
            .flat_map(|seed| objects.iter().map(move |object| (seed, object)))
            .map(|(seed, object)| plan(args, seed, object, stages))
            .collect();
        let run = |plan: &Plan<'_>| plan.run().inspect(|_| bar.inc(1));
        let runs = in_parallel(&plans, threads, run).into_iter().collect::<Result<Vec<Run>, _>>()?;
        bar.suspend(|| println!("{}", Row { name, objects: &names, runs: &runs }));
    }
    bar.finish_and_clear();
    Ok(())
}

fn plan<'a>(args: &Args, seed: u64, object: &'a Object, stages: Stages) -> Plan<'a> {
    Plan {
        object,
        seed,
        stages,
        attempts: args.attempts,
        camera: Camera { patch_share: args.patch, depth_noise_m: 1e-3 * args.depth_noise_mm },
        tactile_noise_m: 1e-3 * args.tactile_noise_mm,
    }
}
