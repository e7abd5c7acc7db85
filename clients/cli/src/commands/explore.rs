//! `palpate explore`: the demo's robot in front of a server that runs already.

use std::path::PathBuf;

use palpate_client::Client;

use super::robot::{NoiseArgs, ObjectArgs, SessionArgs, drive, plan, save_ply};
use crate::failure::Failure;

pub(super) const ABOUT: &str = "\
Lets a simulated robot explore an object through a running server, over gRPC.

Start the server with `palpate serve`, then: palpate explore --object mug";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The server to talk to.
    #[arg(long, env = "PALPATE_SERVER", value_name = "URL", default_value = "http://127.0.0.1:7257")]
    server: String,

    #[command(flatten)]
    object: ObjectArgs,

    #[command(flatten)]
    session: SessionArgs,

    #[command(flatten)]
    noise: NoiseArgs,

    /// Where to write the reconstructed mesh as a PLY file; nowhere unless given.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: Option<PathBuf>,
}

/// Explores once; the session stays on the server.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let (name, body) = args.object.load("bottle")?;
    let client = Client::connect(&args.server).await?;
    println!("A simulated robot explores through {}: {name}.", args.server);
    let plan = plan(&name, "explore", &args.session, &args.noise);
    let exploration = drive(client, &body, plan).await?;
    println!("\n{exploration}");
    if let Some(path) = &args.out {
        save_ply(&exploration, path)?;
    }
    println!("session: {}/v1/sessions/{}", args.server.trim_end_matches('/'), exploration.session_id);
    Ok(())
}
