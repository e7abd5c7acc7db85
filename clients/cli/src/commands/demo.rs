//! `palpate demo`: a simulated robot explores an object through a real server, in one process.

use std::path::PathBuf;

use super::robot::{LocalServer, NoiseArgs, ObjectArgs, SessionArgs, drive, plan, save_ply};
use crate::failure::Failure;

pub(super) const ABOUT: &str = "\
Starts a server with a temporary database and lets a simulated robot explore an object through it.

The robot sees 12 % of the surface from one side, then touches where the server proposes.
Each line is one attempt: \"hit\", \"early\" (touched before it got there) or \"miss\" (nothing there),
and how far the estimated surface is from the true one, in millimetres.";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    object: ObjectArgs,

    #[command(flatten)]
    session: SessionArgs,

    #[command(flatten)]
    noise: NoiseArgs,

    /// Where the reconstructed mesh is written.
    #[arg(long, value_name = "FILE", default_value = "palpate-demo.ply", help_heading = "Output")]
    out: PathBuf,

    /// Go on serving after the last touch, until Ctrl-C, to look around with curl.
    #[arg(long, help_heading = "Output")]
    keep: bool,
}

/// Runs the demo; Ctrl-C ends it at any time.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    // The folder is removed with the last use of it, on Ctrl-C too.
    let folder = tempfile::tempdir()?;
    tokio::select! {
        result = explore(&args, folder.path().join("palpate.db")) => result,
        interrupted = tokio::signal::ctrl_c() => Ok(interrupted?),
    }
}

async fn explore(args: &Args, database: PathBuf) -> Result<(), Failure> {
    let (name, body) = args.object.load("bottle")?;
    let (server, client) = LocalServer::start(&database).await?;
    let url = &server.url;
    println!(
        "Palpate {} serves at {url} (every call is documented at {url}/docs).",
        env!("CARGO_PKG_VERSION")
    );
    println!("A simulated robot explores: {name}.");
    let plan = plan(&name, "demo", &args.session, &args.noise);
    let exploration = drive(client, &body, plan).await?;
    println!("\n{exploration}");
    save_ply(&exploration, &args.out)?;
    if args.keep {
        let session = format!("{url}/v1/sessions/{}", exploration.session_id);
        println!("\nStill serving, until Ctrl-C. Look around:");
        println!("  curl {session}");
        println!("  curl '{session}/events'");
        println!(
            "  curl -X POST {session}/candidates -H 'content-type: application/json' -d '{{\"top_k\": 3}}'"
        );
        println!("  curl '{session}/mesh?format=obj' -o estimate.obj");
        std::future::pending::<()>().await;
    }
    server.stop().await
}
