//! Draws the paper's two figures from real runs of METHOD_PAPER: how the estimates of some objects come
//! about, and how the error of one falls.
//!
//! The method runs in process, in front of the simulated camera and probe: no server, no database. Every
//! run has its own seed, so the figures are the same whatever the number of threads.
//!
//! ```bash
//! cargo run --release --locked -p palpate --example paper_figures -- --meshes ../shared/meshes --out docs/images
//! ```

mod drawing;
#[path = "paper_figures/mustard.rs"]
mod mustard;
#[path = "paper_figures/progress.rs"]
mod progress;
#[path = "paper_figures/work.rs"]
mod work;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use palpate_core::config::{Method, Settings, StopRule, Strategy};
use palpate_simulator::body::Body;
use palpate_simulator::camera::Camera;
use palpate_simulator::in_process::Exploration;
use palpate_simulator::objects::Problem;

use self::work::Work;

/// Draw the paper's two figures from real runs of METHOD_PAPER.
///
/// paper-progress.svg: a row for each object, with the target mesh and the estimate after 0, 1, 2, 5, 10
/// and 30 attempts, coloured by its uncertainty. paper-mustard.svg: the chamfer distance of the mustard
/// bottle over 50 attempts, for both strategies, beside what the paper published.
///
/// The same arguments draw the same figures with the same version of the method.
#[derive(Debug, Parser)]
#[command(name = "paper_figures")]
struct Args {
    /// A folder of closed triangle meshes in metres (.ply, .stl, .obj), mustard_bottle among them.
    #[arg(long, value_name = "FOLDER")]
    meshes: PathBuf,
    /// Where both figures are written; made where it does not exist.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// The rows of paper-progress.svg, separated by commas: files of the folder without their
    /// ending, or generated objects such as bottle.
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_values = ["lamp", "wine_bottle", "mustard_bottle"])]
    objects: Vec<String>,
    /// How much the camera sees, as a share of the object's whole surface; it never sees the far side.
    #[arg(long, value_name = "SHARE", default_value_t = 0.3, value_parser = share)]
    patch: f64,
    /// Executions of each strategy in paper-mustard.svg, with the seeds 1, 2, ...; paper-progress.svg shows
    /// runs with the seed 1.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=1.0).contains(&value) => Ok(value),
        _ => Err("must be between 0.01 and 1".to_owned()),
    }
}

fn main() -> ExitCode {
    match draw(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn draw(args: &Args) -> Result<(), Problem> {
    std::fs::create_dir_all(&args.out).map_err(|error| format!("--out {}: {error}", args.out.display()))?;
    let progress = progress::Figure::load(args)?;
    let mustard = mustard::Figure::load(args)?;
    let work = Work::begin(progress.attempts() + mustard.attempts())?;
    progress.write(&args.out.join("paper-progress.svg"), &work)?;
    mustard.write(&args.out.join("paper-mustard.svg"), &work)
}

/// A run of the paper's method that nothing ends early.
fn exploration<'a>(
    body: &'a Body,
    seed: u64,
    strategy: Strategy,
    attempts: u32,
    patch_share: f64,
) -> Exploration<'a> {
    let never = StopRule { max_attempts: None, mean_uncertainty_below: None, max_consecutive_failures: None };
    Exploration {
        settings: Settings { method: Method::Paper, strategy, stop: never, ..Settings::default() },
        attempts,
        camera: Camera { patch_share, ..Camera::default() },
        ..Exploration::new(body, seed)
    }
}
