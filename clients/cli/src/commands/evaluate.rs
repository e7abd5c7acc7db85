//! `palpate evaluate`: the paper's Table I and its plots for any objects, through a real server.

mod cases;
mod folder;
mod journal;
mod names;
mod objects;
mod paper;
mod plot;
mod record;
mod reliability;
mod report;
mod run;
mod spread;
mod summary;
mod table;
mod work;

use std::path::PathBuf;

use palpate_client::proto::v1::{Method, Strategy, Symmetry, TemplateAxes};

use self::folder::Folder;
use self::journal::Journal;
use self::report::Report;
use super::robot::{LocalServer, SensorArgs, attempts, parser};
use crate::failure::{Ended, Failure, wrong_usage};
use crate::terminal::{counted, say};

pub(super) const ABOUT: &str = "\
Lets the simulated robot explore every object with every method, strategy and seed, and compares what comes out.

Everything goes through a real server whose database stays in the output folder. Each run is written down as it ends: \
Ctrl-C or a run that fails loses nothing else, and the same command with --resume makes what is missing.

The output folder gets:
  table.md
    the tables, laid out like the paper's
  runs.csv
    one line a run, all metrics
  attempts.csv
    one line an attempt
  plots/OBJECT.svg
    errors over attempts
  plots/reliability.svg
    stated deviations and risks against the truth
  deviations/
    what each vertex was stated, for --resume
  sessions.db
    the event log behind every figure

The same arguments give the same figures, however many runs go on at once.";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A folder of closed triangle meshes in metres: .ply, .stl or .obj.
    #[arg(long, value_name = "FOLDER", help_heading = "Objects")]
    meshes: Option<PathBuf>,

    /// Multiplies the coordinates of the mesh files: 0.001 for millimetres.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, requires = "meshes", help_heading = "Objects")]
    scale: f64,

    /// Generated objects by name, separated by commas or blanks, `generated` for all of them; all of them if there is
    /// no --meshes either.
    #[arg(long, value_name = "NAME", value_delimiter = ',', num_args = 1.., help_heading = "Objects")]
    objects: Vec<String>,

    /// How contacts are chosen, separated by commas or blanks; expected_gain is left out but for palpate, as the
    /// others have none.
    #[arg(long, value_parser = parser::<Strategy>(), value_name = "NAME", value_delimiter = ',', num_args = 1.., default_values = ["proactive", "min_uncertainty"])]
    strategies: Vec<Strategy>,

    /// Which methods reconstruct, separated by commas or blanks.
    #[arg(long, value_parser = parser::<Method>(), value_name = "NAME", value_delimiter = ',', num_args = 1.., default_values = ["paper", "palpate"])]
    methods: Vec<Method>,

    /// What is known of every object's symmetry beforehand: declared to `palpate`, and left out for the
    /// others, which refuse one.
    #[arg(long, value_parser = parser::<Symmetry>())]
    symmetry: Option<Symmetry>,

    /// The axes of the ellipsoid of the method `paper`; left out for the others.
    #[arg(long, value_parser = parser::<TemplateAxes>())]
    template_axes: Option<TemplateAxes>,

    /// How many runs of each, with the seeds 1, 2, ...
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,

    /// Attempts of each run, failures included; a session takes at most 1000.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = attempts)]
    attempts: u32,

    /// The output folder; made where it does not exist.
    #[arg(long, value_name = "FOLDER", default_value = "palpate-evaluation")]
    out: PathBuf,

    /// Goes on with the evaluation that is in the output folder: its finished runs are kept, the others made anew.
    #[arg(long)]
    resume: bool,

    /// How many runs go on at once; as many as there are cores unless given.
    #[arg(long, value_name = "N")]
    jobs: Option<std::num::NonZeroUsize>,

    #[command(flatten)]
    sensors: SensorArgs,
}

/// Evaluates and reports what was done, even if Ctrl-C or a failure has ended it early.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    args.sensors.faults.check()?;
    let series = cases::series(&args);
    if series.is_empty() {
        return Err(wrong_usage(
            "--strategies expected_gain needs --methods palpate: there is nothing to run",
        ));
    }
    let objects = objects::load(args.meshes.as_deref(), args.scale, &args.objects)?;
    let folder = Folder::prepare(&args.out, args.resume)?;
    let (server, client) = LocalServer::start(&folder.database()).await?;
    let algorithm_version = client.server_info().await?.algorithm_version;
    folder.claim(&folder::arguments(&args, &objects, &algorithm_version))?;

    let (mut journal, finished) = Journal::open(&folder)?;
    let tasks = cases::tasks(&objects, &args);
    let order: Vec<_> = tasks.iter().map(|task| task.session_id().to_owned()).collect();
    let outcome = work::work(&client, tasks, &finished, args.jobs, &mut journal).await;
    server.stop().await?;

    let report = Report {
        folder: &folder,
        algorithm_version: &algorithm_version,
        attempts: args.attempts,
        objects: &objects,
        series: &series,
        seeds: args.seeds,
        planned: order.len(),
        has_faults: args.sensors.faults.faults().any(),
        runs: journal.close(&order)?,
    };
    if !report.runs.is_empty() {
        report.write()?;
    }
    let kept = format!("{} of {} kept", report.runs.len(), counted(order.len(), "run", "runs"));
    let again = "the same command with --resume makes the others";
    match outcome {
        Ok(failed) => {
            say(report.summary())?;
            if failed == 0 { Ok(()) } else { Err(format!("{failed} failed, {kept}: {again}").into()) }
        }
        Err(failure) if matches!(failure.downcast_ref(), Some(Ended::Interrupted(_))) => {
            say(report.summary())?;
            Err(Ended::Interrupted(format!("interrupted, {kept}: {again}")).into())
        }
        Err(failure) => Err(failure),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn typed(args: &[&str]) -> Args {
        #[derive(clap::Parser)]
        struct Program {
            #[command(flatten)]
            args: Args,
        }
        <Program as clap::Parser>::parse_from([&["palpate"], args].concat()).args
    }

    /// A small evaluation into this folder.
    fn small(out: &str, more: &[&str]) -> Args {
        let what = ["--objects", "ball", "--methods", "palpate", "--strategies", "proactive"];
        let how = ["--attempts", "5", "--symmetry", "revolution", "--measured-normals", "--out", out];
        typed(&[&what[..], &how, more].concat())
    }

    #[tokio::test]
    async fn an_evaluation_leaves_what_its_help_names() {
        let folder = tempfile::tempdir().unwrap();
        run(small(folder.path().to_str().unwrap(), &["--seeds", "1"])).await.unwrap();
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

    #[tokio::test]
    async fn a_resumed_evaluation_gives_the_files_of_one_that_was_not_interrupted() {
        let folder = tempfile::tempdir().unwrap();
        let out = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let read = |out: &str, name: &str| std::fs::read_to_string(format!("{out}/{name}")).unwrap();
        let (whole, resumed) = (out("whole"), out("resumed"));
        run(small(&whole, &["--seeds", "2"])).await.unwrap();
        run(small(&resumed, &["--seeds", "2", "--jobs", "1"])).await.unwrap();
        // As if it had been killed in its second run: the session is there, the line of the run is not.
        let runs = read(&resumed, "runs.csv");
        let cut = runs.trim_end().rfind('\n').unwrap() + 7;
        std::fs::write(format!("{resumed}/runs.csv"), &runs[..cut]).unwrap();
        std::fs::remove_file(format!("{resumed}/deviations/run-0002.f32")).unwrap();

        let refusal = run(small(&resumed, &["--seeds", "2"])).await.unwrap_err().to_string();
        assert!(refusal.contains("--resume goes on with it"), "{refusal}");
        let refusal = run(small(&resumed, &["--seeds", "3", "--resume"])).await.unwrap_err().to_string();
        assert!(refusal.contains("`seeds: 2`"), "{refusal}");
        run(small(&resumed, &["--seeds", "2", "--resume"])).await.unwrap();
        for name in
            ["runs.csv", "attempts.csv", "table.md", "plots/generated-ball.svg", "plots/reliability.svg"]
        {
            assert!(read(&whole, name) == read(&resumed, name), "{name}");
        }
    }

    #[tokio::test]
    async fn an_object_that_is_pushed_aside_is_compared_where_it_stands() {
        let folder = tempfile::tempdir().unwrap();
        let faults = ["--pad", "flat", "--move-after", "4", "--move-mm", "300", "--seeds", "1"];
        run(small(folder.path().to_str().unwrap(), &faults)).await.unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let attempts = read("attempts.csv");
        let errors_mm: Vec<f64> =
            attempts.lines().skip(1).map(|line| line.split(',').nth(6).unwrap().parse().unwrap()).collect();
        assert!(errors_mm[4] < 50.0 && errors_mm[5] > 200.0, "it is elsewhere: {errors_mm:?}");
        assert!(read("runs.csv").lines().next().unwrap().ends_with(",stopped_early,warnings"));
        assert!(read("table.md").contains("| runs with a warning, % | palpate, proactive | "));
    }

    #[tokio::test]
    async fn methods_without_the_strategy_are_nothing_to_run() {
        let args = typed(&["--methods", "paper", "--strategies", "expected_gain"]);
        let refusal = run(args).await.unwrap_err().to_string();
        assert!(refusal.contains("needs --methods palpate"), "{refusal}");
    }
}
