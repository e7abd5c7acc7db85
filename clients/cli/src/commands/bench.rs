//! `palpate bench`: how many robots a server carries, and how long each of them waits.

mod figures;
mod load;
mod plot;
mod process;

use std::ffi::OsString;
use std::iter::Sum;
use std::path::PathBuf;
use std::time::Duration;

use palpate_client::RetryPolicy;
use palpate_client::proto::v1::Method;
use palpate_server::Location;

use self::figures::Figures;
use self::load::Load;
use self::process::ServerProcess;
use super::database::location;
use super::robot::{attempts, parser};
use super::server::{CallerArgs, address};
use crate::failure::{Ended, Failure};
use crate::terminal::{say, wrapped};
use crate::writable;

pub(super) const ABOUT: &str = "\
Lets many simulated robots touch at once, each in a session of its own, and measures what the server makes of it.

Each robot reports a contact and gets the next candidate in the same call; refused, it waits as long as the server \
says and asks again. Without --rate each robot reports again as soon as it is answered; with it, contacts come at that \
rate whether the server keeps up or not, and the wait counts from when they were due.

For instance: palpate bench --sessions 64";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The server to measure, or several over one log; one of its own, over a temporary file, unless given.
    #[arg(long = "server", value_name = "URL", value_parser = address, help_heading = "Server")]
    urls: Vec<String>,

    /// Servers of its own over this database of PostgreSQL, such as postgres://palpate@127.0.0.1/bench, in which the
    /// sessions stay.
    #[arg(long, value_name = "ADDRESS", conflicts_with = "urls", help_heading = "Server")]
    database: Option<OsString>,

    /// How many servers of its own share the database.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "database", help_heading = "Server")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=64))]
    servers: u32,

    /// Each robot calls another one of several servers each time, instead of always the same.
    #[arg(long, help_heading = "Server")]
    hop: bool,

    #[command(flatten)]
    caller: CallerArgs,

    /// How many robots touch at once, each in a session of its own.
    #[arg(long, value_name = "N", default_value_t = 8, help_heading = "Load")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=4096))]
    sessions: u32,

    /// How many contacts a second come in all, whether the server keeps up or not.
    #[arg(long, value_name = "R", value_parser = positive, help_heading = "Load")]
    rate: Option<f64>,

    /// How many contacts each robot reports.
    #[arg(long, value_name = "K", default_value_t = 25, value_parser = attempts, help_heading = "Load")]
    attempts: u32,

    /// How long a robot waits for an answer before it gives the contact up, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = positive, help_heading = "Load")]
    deadline: f64,

    /// Which method reconstructs; the server's best unless given.
    #[arg(long, value_parser = parser::<Method>(), help_heading = "Load")]
    method: Option<Method>,

    /// The folder that the plot and the table of all contacts are written into.
    #[arg(long, value_name = "FOLDER", default_value = "palpate-bench", help_heading = "Output")]
    out: PathBuf,
}

/// Measures; Ctrl-C ends it, and the server with it.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    std::fs::create_dir_all(&args.out).map_err(|error| format!("{}: {error}", args.out.display()))?;
    let (plot, table) = (args.out.join("bench.svg"), args.out.join("bench.csv"));
    writable::check("--out", &plot)?;
    writable::check("--out", &table)?;
    tokio::select! {
        figures = measure(&args) => {
            let figures = figures?;
            say(&figures)?;
            plot::draw(&figures, &plot)?;
            figures.write(&table)?;
            let written = format!("{}: how many contacts are answered within a time. {}: each of them.", plot.display(), table.display());
            say(wrapped(&written, 2))
        }
        interrupted = tokio::signal::ctrl_c() => {
            interrupted?;
            Err(Ended::Interrupted("interrupted: nothing was written".to_owned()).into())
        }
    }
}

async fn measure(args: &Args) -> Result<Figures, Failure> {
    if let Some(address) = &args.database
        && let Location::File(file) = location(address)?
    {
        return Err(format!("--database {}: is no address of PostgreSQL", file.display()).into());
    }
    let mut own = Vec::new();
    while args.urls.is_empty() && own.len() < args.servers as usize {
        own.push(ServerProcess::start(args.database.as_deref()).await?);
    }
    let urls: Vec<&str> =
        args.urls.iter().map(String::as_str).chain(own.iter().map(|own| own.url.as_str())).collect();
    // Refusals are to be seen, so the client does not ask again by itself.
    let once = RetryPolicy { max_attempts: 1, ..RetryPolicy::default() };
    let mut clients = Vec::new();
    for url in &urls {
        let builder = args.caller.client(url)?.deadline(Duration::from_secs_f64(args.deadline)).retry(once);
        clients.push(builder.connect().await?);
    }
    let load = Load {
        sessions: args.sessions,
        attempts: args.attempts,
        rate: args.rate,
        deadline: Duration::from_secs_f64(args.deadline),
        method: args.method.unwrap_or_default(),
        is_hopping: args.hop,
    };
    say(format_args!(
        "{} robots, {} contacts each, at {}, on {} cores for both sides.",
        args.sessions,
        args.attempts,
        urls.join(", "),
        std::thread::available_parallelism().map_or(1, usize::from)
    ))?;
    let robots = load.begin(&clients).await?;
    // Whose time is whose can be told on this machine alone.
    let servers = || all(own.iter().map(ServerProcess::cpu));
    let database = || args.database.as_ref().and_then(|_| process::cpu_of_all("postgres"));
    let before = (servers(), database());
    let (answers, elapsed) = load.run(&clients, robots).await?;
    let used = |after: Option<Duration>, before| {
        after.zip(before).map(|(after, before)| after.saturating_sub(before))
    };
    Ok(Figures {
        answers,
        elapsed,
        rate: args.rate,
        cpu: used(servers(), before.0),
        database_cpu: used(database(), before.1),
        memory_bytes: all(own.iter().map(ServerProcess::peak_memory_bytes)),
    })
}

/// The sum of what is known of each; nothing where there are none, or something is not known.
fn all<T: Sum>(each: impl ExactSizeIterator<Item = Option<T>>) -> Option<T> {
    if each.len() == 0 { None } else { each.sum() }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if f64::is_finite(number) && number > 0.0 => Ok(number),
        _ => Err("must be a number above 0".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_a_number_above_zero() {
        assert_eq!(positive("0.5"), Ok(0.5));
        for wrong in ["0", "-3", "inf", "NaN", "fast"] {
            assert!(positive(wrong).is_err(), "{wrong}");
        }
    }
}
