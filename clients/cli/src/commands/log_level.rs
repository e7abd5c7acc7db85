//! `palpate log-level`: what a running server logs, shown or changed.

mod route;

use std::time::Duration;

use serde_json::{Value, json};

pub(super) use self::route::router;
use super::server::ServerArgs;
use crate::failure::Failure;
use crate::terminal::say;
use crate::{log, probe};

pub(super) const ABOUT: &str = "\
Shows what a running server logs, or changes it without a restart: for good, or for a while with --for, after which \
the level before it holds again. A restart always brings back what the server was started with.

For instance: palpate log-level palpate_server=debug,info --for 10m";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// What to log: error, warn, info, debug, trace, or a filter such as `palpate_server=debug,info`; shown unless given.
    #[arg(value_parser = log::filter)]
    filter: Option<String>,

    /// For how long, such as `10m`; for good unless given.
    #[arg(long = "for", value_name = "TIME", value_parser = humantime::parse_duration, requires = "filter")]
    time: Option<Duration>,

    #[command(flatten)]
    server: ServerArgs,
}

/// Asks, and prints what holds now.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let url = format!("{}/v1/log-level", args.server.url);
    let client = args.server.caller.http(&args.server.url)?;
    let request = match &args.filter {
        None => client.get(&url),
        Some(filter) => {
            let body = json!({ "filter": filter, "for_s": args.time.map(|time| time.as_secs_f64()) });
            client.put(&url).header("content-type", "application/json").body(body.to_string())
        }
    };
    let answer =
        request.send().await.map_err(|error| format!("{}: {}", args.server.url, probe::cause(&error)))?;
    let is_success = answer.status().is_success();
    let text = answer.text().await?;
    let said: Value = serde_json::from_str(&text).unwrap_or_default();
    let Some(filter) = said["filter"].as_str().filter(|_| is_success) else {
        let why = said["detail"].as_str().unwrap_or(&text);
        return Err(format!("{}: {why}", args.server.url).into());
    };
    match (said["until"].as_str(), said["then"].as_str()) {
        (Some(until), Some(then)) => say(format_args!("{filter}, until {until}, then {then}")),
        _ => say(filter),
    }
}
