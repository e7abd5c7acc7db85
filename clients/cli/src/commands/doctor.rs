//! `palpate doctor`: whether a server and its database are well, and what to do where they are not.

mod database;
mod finding;
mod host;
mod port;
mod server;
mod shared;

use palpate_server::{Location, inspect, inspect_shared};
use serde_json::json;

use self::finding::{Findings, Level};
use super::serve;
use super::server::{CallerArgs, address};
use crate::failure::{Ended, Failure};
use crate::progress::CopyProgress;
use crate::terminal::{counted, say};

pub(super) const ABOUT: &str = "\
Looks at a database, the machine and, with --server, a running server, and says of each whether it is well and what to \
do. Nothing is changed, and it makes no difference whether a server runs. The settings of `serve` say which database, \
address and limits are meant.

Exit codes: 0 where nothing is a problem, warnings included, and 1 otherwise.

For instance: palpate doctor --database palpate.db --server http://127.0.0.1:7257";

#[derive(Debug, clap::Args)]
#[group(skip)]
pub(crate) struct Args {
    /// A running server to ask, too.
    #[arg(long, env = "PALPATE_SERVER", value_name = "URL", value_parser = address)]
    server: Option<String>,

    #[command(flatten)]
    caller: CallerArgs,

    /// Print the findings as JSON, for programs.
    #[arg(long)]
    json: bool,

    #[command(flatten, next_help_heading = "Settings of `serve`")]
    serve: serve::Args,
}

/// Looks at everything, and prints what it found.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let limits = args.serve.limits()?;
    let location = args.serve.database.location()?;
    let mut findings = Findings::default();
    host::program(&mut findings);
    let is_held = if let Location::Postgres(address) = &location {
        let progress = CopyProgress::new()?;
        let show = |step| progress.show(step);
        let found = inspect_shared(address, &show).await;
        progress.finish();
        shared::report(address, &found, &limits, &mut findings);
        host::clock(found.proof.as_ref(), &mut findings);
        false
    } else if let Some(path) = location.file().filter(|path| path.is_file()) {
        let progress = CopyProgress::new()?;
        let show = |step| progress.show(step);
        let found = inspect(path, &show).await;
        progress.finish();
        database::report(path, &found, &mut findings);
        database::permissions(&found.files, &mut findings);
        host::disk(found.free_bytes, &found.files, &limits, &mut findings);
        host::clock(found.proof.as_ref(), &mut findings);
        found.is_held
    } else {
        let text = format!("there is no {location}: a server makes it when it starts");
        findings.warn("database", text, "name the database with --database, or start a server");
        host::clock(None, &mut findings);
        false
    };
    host::limits(&limits, &mut findings)?;
    host::open_files(&limits, &mut findings);
    port::report(args.serve.listen, is_held, &mut findings).await;
    if let Some(url) = &args.server {
        server::report(&args.caller.http(url)?, url, &limits, &mut findings).await;
    }
    print(&findings, args.json)
}

fn print(findings: &Findings, as_json: bool) -> Result<(), Failure> {
    let count = |level: Level| findings.all().iter().filter(|finding| finding.level == level).count();
    let (problems, warnings) = (count(Level::Problem), count(Level::Warning));
    if as_json {
        say(json!({ "ok": problems == 0, "findings": findings.all() }))?;
    } else {
        for finding in findings.all() {
            say(finding)?;
        }
        let (problems, warnings) =
            (counted(problems, "problem", "problems"), counted(warnings, "warning", "warnings"));
        say(format_args!("\n{problems}, {warnings}"))?;
    }
    if problems == 0 { Ok(()) } else { Err(Ended::Told.into()) }
}
