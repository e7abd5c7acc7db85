//! `palpate demo`: a simulated robot explores an object through a real server, in one process.

use std::path::{Path, PathBuf};

use super::robot::{Exploration, LocalServer, ObjectArgs, SensorArgs, SessionArgs, drive, plan, save_ply};
use crate::failure::{Ended, Failure};
use crate::terminal::{BOLD, COMMAND, program, say, styled, wrapped};
use crate::version::VERSION;
use crate::writable;

pub(super) const ABOUT: &str = "\
Starts a server with a temporary database and lets a simulated robot explore an object through it.

The robot sees 12 % of the surface from one side, then touches where the server proposes. \
Each line is one attempt: \"hit\", \"early\" (touched before it got there) or \"miss\" (nothing there), \
and how far the estimated surface is from the true one, in millimetres.";

/// The only session of the demo's own server.
const SESSION_ID: &str = "demo";

/// The demo touches as robots do, the paper's point is for comparisons.
#[derive(Debug, clap::Args)]
#[command(mut_arg("pad", |pad| pad.default_value("flat")))]
pub(crate) struct Args {
    #[command(flatten)]
    object: ObjectArgs,

    #[command(flatten)]
    session: SessionArgs,

    #[command(flatten)]
    sensors: SensorArgs,

    /// Where the reconstructed mesh is written.
    #[arg(long, value_name = "FILE", default_value = "palpate-demo.ply", help_heading = "Output")]
    out: PathBuf,

    /// Go on serving after the last touch, until Ctrl-C, to look around in a browser or with curl.
    #[arg(long, help_heading = "Output")]
    keep: bool,
}

/// Runs the demo; Ctrl-C ends it at any time.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    args.session.check()?;
    args.sensors.faults.check()?;
    writable::check("--out", &args.out)?;
    // The folder is removed with the last use of it, on Ctrl-C too.
    let folder = tempfile::tempdir()?;
    let database = folder.path().join("palpate.db");
    let (server, exploration) = tokio::select! {
        result = explore(&args, &database) => result?,
        interrupted = tokio::signal::ctrl_c() => {
            interrupted?;
            return Err(Ended::Interrupted("interrupted: nothing was kept".to_owned()).into());
        }
    };
    if args.keep {
        say(look_around(&server.url, &exploration.session_id))?;
        tokio::signal::ctrl_c().await?;
    } else {
        say(next_steps(&args.out))?;
    }
    server.stop().await
}

async fn explore(args: &Args, database: &Path) -> Result<(LocalServer, Exploration), Failure> {
    let (name, body) = args.object.load("bottle")?;
    let (server, client) = LocalServer::start(database).await?;
    say(wrapped(
        &format!("Palpate {}: a simulated robot explores, through a server of its own: {name}.", *VERSION),
        0,
    ))?;
    let mut plan = plan(&name, "demo", &args.session, &args.sensors);
    // Named here, so that its page can be told before it begins.
    SESSION_ID.clone_into(&mut plan.session.session_id);
    say(format_args!("Watch it while it runs: {}", page(&server.url, SESSION_ID)))?;
    let exploration = drive(client, &body, plan).await?;
    say(format_args!("\n{exploration}"))?;
    save_ply(&exploration, &args.out)?;
    Ok((server, exploration))
}

/// Where a session is shown as it is touched.
fn page(url: &str, session_id: &str) -> String {
    format!("{url}/#/session/{session_id}")
}

/// What a running server can be asked.
fn look_around(url: &str, session_id: &str) -> String {
    let session = format!("{url}/v1/sessions/{session_id}");
    let commands = [
        format!("curl {session}"),
        format!("curl '{session}/events'"),
        format!(
            "curl -X POST {session}/candidates -H 'content-type: application/json' -d '{{\"top_k\": 3}}'"
        ),
        format!("curl '{session}/mesh?format=obj' -o estimate.obj"),
    ];
    let mut text = format!("\n{}", styled(BOLD, "Still serving, until Ctrl-C. Look around:"));
    text.push_str(&format!("\n  {} shows it, touch by touch", page(url, session_id)));
    text.push_str(&format!("\n  {url}/docs documents every call"));
    for command in commands {
        text.push_str(&format!("\n  {}", styled(COMMAND, command)));
    }
    text
}

/// What to try when the demo is over, and its server with it.
fn next_steps(mesh: &Path) -> String {
    let palpate = program();
    let look = format!("1. Look at {}, in MeshLab, Blender or any other viewer.", mesh.display());
    let mut text = format!("\n{}\n{}", styled(BOLD, "Next:"), wrapped(&look, 3));
    for (what, commands) in [
        (
            "2. Serve, and ask from another terminal; README.md has a whole session with curl:",
            vec![format!("{palpate} serve"), "curl http://127.0.0.1:7257/version".to_owned()],
        ),
        (
            "3. Compare methods, over objects and seeds:",
            vec![format!("{palpate} evaluate --objects can mug --seeds 2")],
        ),
    ] {
        text.push_str(&format!("\n{}", wrapped(what, 3)));
        for command in commands {
            text.push_str(&format!("\n   {}", styled(COMMAND, command)));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use palpate_simulator::probe::Pad;

    use super::*;

    #[test]
    fn the_demo_touches_with_a_flat_pad_unless_told_otherwise() {
        #[derive(clap::Parser)]
        struct Program {
            #[command(flatten)]
            args: Args,
        }
        let touches_with = |args: &[&str]| {
            let Args { session, sensors, .. } =
                <Program as clap::Parser>::parse_from([&["palpate"], args].concat()).args;
            plan("can", "demo", &session, &sensors).probe.pad
        };
        assert_eq!(touches_with(&[]), Pad::Flat);
        assert_eq!(touches_with(&["--pad", "point"]), Pad::Point);
    }

    #[test]
    fn the_demo_ends_with_three_things_to_try_and_no_address_of_its_own() {
        let text = next_steps(Path::new("palpate-demo.ply"));
        for step in
            ["1. Look at palpate-demo.ply", " serve", "curl http://127.0.0.1:7257", " evaluate --objects"]
        {
            assert!(text.contains(step), "{text}");
        }
        assert!(
            look_around("http://127.0.0.1:1234", "s").contains("http://127.0.0.1:1234/v1/sessions/s/events")
        );
    }
}
