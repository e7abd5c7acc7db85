//! `palpate explore`: the demo's robot in front of a server that runs already.

use std::path::PathBuf;

use super::robot::{ObjectArgs, SensorArgs, SessionArgs, drive, plan, save_ply};
use super::server::ServerArgs;
use crate::failure::Failure;
use crate::terminal::say;
use crate::writable;

pub(super) const ABOUT: &str = "\
Lets a simulated robot explore an object through a running server, over gRPC.

Start the server with `palpate serve`, then: palpate explore --object mug";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    server: ServerArgs,

    #[command(flatten)]
    object: ObjectArgs,

    #[command(flatten)]
    session: SessionArgs,

    #[command(flatten)]
    sensors: SensorArgs,

    /// Where to write the reconstructed mesh as a PLY file; nowhere unless given.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: Option<PathBuf>,
}

/// Explores once; the session stays on the server.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    args.session.check()?;
    args.sensors.faults.check()?;
    if let Some(path) = &args.out {
        writable::check("--out", path)?;
    }
    let (name, body) = args.object.load("bottle")?;
    let client = args.server.connect().await?;
    say(format_args!("A simulated robot explores through {}: {name}.", args.server.url))?;
    let plan = plan(&name, "explore", &args.session, &args.sensors);
    let exploration = drive(client, &body, plan, args.server.url.trim_end_matches('/')).await?;
    say(format_args!("\n{exploration}"))?;
    if let Some(path) = &args.out {
        save_ply(&exploration, path)?;
    }
    say(format_args!(
        "session: {}/v1/sessions/{}",
        args.server.url.trim_end_matches('/'),
        exploration.session_id
    ))
}
