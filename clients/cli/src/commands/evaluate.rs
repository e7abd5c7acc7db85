//! `palpate evaluate`: the paper's Table I and its plots for any objects, through a real server.

mod objects;
mod paper;
mod plot;
mod record;
mod reliability;
mod run;
mod spread;
mod table;

use std::path::{Path, PathBuf};

use futures_util::{StreamExt, TryStreamExt, stream};
use indicatif::{ProgressBar, ProgressStyle};
use palpate_client::Client;
use palpate_client::proto::v1::{Method, Strategy, Symmetry};
use palpate_core::metrics::Sampling;

use self::objects::EvaluatedObject;
use self::plot::{Course, draw_reliability};
use self::record::{Case, Run};
use self::table::Report;
use super::robot::{LocalServer, NoiseArgs, SessionArgs, attempts, name_of, parser, plan};
use crate::failure::Failure;

pub(super) const ABOUT: &str = "\
Lets the simulated robot explore every object with every method, strategy and seed, and compares what comes out.

Everything goes through a real server whose database stays in the output folder. The output folder gets:
  table.md               the tables, laid out like the paper's, with its figures beside where the names match,
                         and how far stated deviations and risks of failure are true
  runs.csv               one line a run, all metrics
  attempts.csv           one line an attempt, with the stated risk, and every fifth with the calibration
  plots/OBJECT.svg       errors over attempts, one file an object
  plots/reliability.svg  stated deviations and risks against the truth, if a method states any
  sessions.db            the event log behind every figure

The same arguments give the same figures, however many runs go on at once.";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A folder of closed triangle meshes in metres: .ply, .stl or .obj.
    #[arg(long, value_name = "FOLDER", help_heading = "Objects")]
    meshes: Option<PathBuf>,

    /// Multiplies the coordinates of the mesh files: 0.001 for millimetres.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, requires = "meshes", help_heading = "Objects")]
    scale: f64,

    /// Generated objects by name, `generated` for all of them; all of them if there is no --meshes either.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', help_heading = "Objects")]
    objects: Vec<String>,

    /// How contacts are chosen; expected_gain is left out for the paper's method, which has none.
    #[arg(long, value_parser = parser::<Strategy>(), value_delimiter = ',', default_values = ["proactive", "min_uncertainty"])]
    strategies: Vec<Strategy>,

    /// Which methods reconstruct.
    #[arg(long, value_parser = parser::<Method>(), value_delimiter = ',', default_values = ["paper", "palpate"])]
    methods: Vec<Method>,

    /// What is known of every object's symmetry beforehand: declared to `palpate`, and left out for `paper`, which
    /// refuses one.
    #[arg(long, value_parser = parser::<Symmetry>())]
    symmetry: Option<Symmetry>,

    /// How many runs of each, with the seeds 1, 2, ...
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,

    /// Attempts of each run, failures included; a session takes at most 1000.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = attempts)]
    attempts: u32,

    /// The output folder; made where it does not exist.
    #[arg(long, value_name = "FOLDER", default_value = "palpate-evaluation")]
    out: PathBuf,

    /// How many runs go on at once; as many as there are cores unless given.
    #[arg(long, value_name = "N")]
    jobs: Option<std::num::NonZeroUsize>,

    #[command(flatten)]
    noise: NoiseArgs,
}

/// Evaluates and writes the report; Ctrl-C ends it without one.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let command = typed_command(std::env::args().skip(1));
    let objects = objects::load(args.meshes.as_deref(), args.scale, &args.objects)?;
    let database = prepare(&args.out)?;
    let (server, client) = LocalServer::start(&database).await?;
    let algorithm_version = client.server_info().await?.algorithm_version;
    let runs = run_all(&client, &objects, &args).await?;
    server.stop().await?;

    let series = series(&args);
    record::write_attempts(&runs, &args.out.join("attempts.csv"))?;
    record::write_runs(&runs, &args.out.join("runs.csv"))?;
    for object in &objects {
        let plot = Course {
            object: &object.name,
            floor_mm: 1e3 * object.floor.sum_m,
            attempts: args.attempts,
            series: &series,
            runs: &runs,
        };
        plot.write(&args.out.join("plots").join(&object.name).with_extension("svg"))?;
    }
    let names: Vec<_> = objects.iter().map(|object| object.name.clone()).collect();
    let statements = reliability::collect(&series, &names, &runs);
    if !statements.is_empty() {
        draw_reliability(&statements, &args.out.join("plots").join("reliability.svg"))?;
    }
    let columns: Vec<_> =
        objects.iter().map(|object| (object.name.clone(), 1e3 * object.floor.sum_m)).collect();
    let table = Report {
        command: &command,
        version: env!("CARGO_PKG_VERSION"),
        algorithm_version: &algorithm_version,
        attempts: args.attempts,
        objects: &columns,
        series: &series,
        seeds: args.seeds,
        chamfer_points: Sampling::default().chamfer_points,
        runs: &runs,
        statements: &statements,
    }
    .markdown();
    std::fs::write(args.out.join("table.md"), &table)?;
    println!("{table}\nwritten to {}", args.out.display());
    Ok(())
}

/// Makes the output folder and returns where its database goes.
fn prepare(out: &Path) -> Result<PathBuf, Failure> {
    std::fs::create_dir_all(out.join("plots"))
        .map_err(|error| format!("--out {}: {error}", out.display()))?;
    let database = out.join("sessions.db");
    if database.exists() {
        let text = "holds the sessions of an earlier evaluation: choose another --out, or remove that folder";
        return Err(format!("--out {}: sessions.db {text}", out.display()).into());
    }
    Ok(database)
}

/// Every method with every strategy that it has.
fn pairs(args: &Args) -> impl Iterator<Item = (Method, Strategy)> {
    let strategies = |&method| args.strategies.iter().map(move |&strategy| (method, strategy));
    // METHOD_PAPER states no deviation that a gain could be expected from.
    let exists = |pair: &(Method, Strategy)| *pair != (Method::Paper, Strategy::ExpectedGain);
    args.methods.iter().flat_map(strategies).filter(exists)
}

fn series(args: &Args) -> Vec<(String, String)> {
    pairs(args).map(|(method, strategy)| (name_of(method).to_owned(), name_of(strategy).to_owned())).collect()
}

/// Runs every case, some at once, and returns them in the order of the cases.
async fn run_all(client: &Client, objects: &[EvaluatedObject], args: &Args) -> Result<Vec<Run>, Failure> {
    let cases = cases(objects, args);
    let bar = ProgressBar::new(cases.len() as u64);
    bar.set_style(ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {elapsed} so far, {eta} left")?);
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let jobs = args.jobs.map_or(cores, std::num::NonZeroUsize::get);
    stream::iter(cases)
        .map(|(object, case, plan)| {
            let name = format!("{}, {}, {}, seed {}", case.object, case.method, case.strategy, case.seed);
            let task = tokio::spawn(run::run(client.clone(), object, case, plan));
            let bar = &bar;
            async move {
                let run = task.await?.map_err(|error| format!("{name}: {error}"))?;
                bar.inc(1);
                if bar.is_hidden() {
                    println!("{name}: {:.2} mm", 1e3 * run.last.surface_distance_m);
                }
                Ok(run)
            }
        })
        .buffered(jobs)
        .try_collect()
        .await
}

fn cases(
    objects: &[EvaluatedObject],
    args: &Args,
) -> Vec<(EvaluatedObject, Case, palpate_simulator::robot::Plan)> {
    let mut cases = Vec::new();
    for object in objects {
        for (method, strategy) in pairs(args) {
            for seed in 1..=args.seeds {
                let session = SessionArgs {
                    attempts: args.attempts,
                    strategy,
                    method: Some(method),
                    symmetry: args.symmetry.filter(|_| method != Method::Paper),
                    seed,
                };
                let mut plan = plan(&object.name, "evaluate", &session, &args.noise);
                plan.session.session_id = format!("run-{:04}", cases.len() + 1);
                cases.push((object.clone(), Case::new(&object.name, method, strategy, seed), plan));
            }
        }
    }
    cases
}

/// The command line as it was typed, with quotes where a shell needs them.
fn typed_command(args: impl Iterator<Item = String>) -> String {
    let mut command = "palpate".to_owned();
    for arg in args {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=+@".contains(c);
        command.push(' ');
        if !arg.is_empty() && arg.chars().all(plain) {
            command.push_str(&arg);
        } else {
            command.push_str(&format!("'{}'", arg.replace('\'', r"'\''")));
        }
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_can_be_pasted_into_a_shell() {
        let args = ["evaluate", "--meshes", "my meshes", "--objects", "can,box", "it's"];
        let command = typed_command(args.iter().map(ToString::to_string));
        assert_eq!(command, r"palpate evaluate --meshes 'my meshes' --objects can,box 'it'\''s'");
    }

    fn typed(args: &[&str]) -> Args {
        #[derive(clap::Parser)]
        struct Program {
            #[command(flatten)]
            args: Args,
        }
        <Program as clap::Parser>::parse_from([&["palpate"], args].concat()).args
    }

    #[tokio::test]
    async fn an_evaluation_leaves_what_its_help_names() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().to_str().unwrap();
        let what = ["--objects", "ball", "--methods", "palpate", "--strategies", "proactive"];
        let how = ["--seeds", "1", "--attempts", "5", "--symmetry", "revolution", "--measured-normals"];
        run(typed(&[&what[..], &how, &["--out", out]].concat())).await.unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        for name in ["runs.csv", "plots/generated-ball.svg", "plots/reliability.svg"] {
            assert!(!read(name).is_empty(), "{name}");
        }
        assert!(folder.path().join("sessions.db").exists());
        let table = read("table.md");
        let row = "| true error within 2 sigma, mean of attempts 5 to 5 | palpate, proactive | ";
        assert!(table.contains(row) && table.contains("### palpate, proactive"), "{table}");
        let attempts = read("attempts.csv");
        let shown: Vec<Vec<_>> =
            attempts.lines().skip(1).map(|line| line.split(',').rev().take(2).collect()).collect();
        assert_eq!(shown.len(), 6);
        let share = |text: &str| (0.0..=1.0).contains(&text.parse::<f64>().unwrap());
        for (attempt, cells) in shown.iter().enumerate() {
            let [risk, within] = cells[..] else { panic!("two cells") };
            assert!(if attempt == 0 { risk.is_empty() } else { share(risk) }, "{attempts}");
            assert!(if attempt == 5 { share(within) } else { within.is_empty() }, "{attempts}");
        }
    }

    #[test]
    fn a_symmetry_is_declared_to_every_method_but_the_papers_which_refuses_one() {
        let args = typed(&["--symmetry", "mirror", "--seeds", "1", "--measured-normals"]);
        let objects = objects::load(None, 1.0, &["ball".to_owned()]).unwrap();
        let cases = cases(&objects, &args);
        assert_eq!(cases.len(), 4);
        for (_, case, plan) in cases {
            let declared = plan.session.config.unwrap().symmetry();
            assert_eq!(declared == Symmetry::Mirror, case.method == "palpate", "{case:?}");
            assert!(plan.probe.measures_normals);
        }
    }

    #[test]
    fn an_earlier_evaluation_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let database = prepare(folder.path()).unwrap();
        std::fs::write(database, "").unwrap();
        assert!(prepare(folder.path()).unwrap_err().to_string().contains("sessions.db"));
    }
}
