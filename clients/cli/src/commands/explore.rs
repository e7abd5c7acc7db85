//! `palpate explore`: the demo's robot in front of a server that runs already.

use std::path::PathBuf;

use palpate_client::Client;

use super::robot::{ObjectArgs, SensorArgs, SessionArgs, drive, plan, save_ply};
use crate::failure::Failure;
use crate::terminal::say;
use crate::writable;

pub(super) const ABOUT: &str = "\
Lets a simulated robot explore an object through a running server, over gRPC.

Start the server with `palpate serve`, then: palpate explore --object mug";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The server to talk to.
    #[arg(long, env = "PALPATE_SERVER", value_name = "URL", default_value = "http://127.0.0.1:7257")]
    #[arg(value_parser = server)]
    server: String,

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

/// An address of a server; encrypted ones are refused, as nothing would be encrypted.
fn server(text: &str) -> Result<String, String> {
    match text.split_once("://") {
        Some(("https", rest)) => Err(format!(
            "this version does not speak TLS: write http://{rest} if the way there may be read by others, or let a \
             tunnel encrypt it, such as `ssh -L 7257:127.0.0.1:7257 HOST`"
        )),
        Some(("http", _)) => Ok(text.to_owned()),
        None => Ok(format!("http://{text}")),
        Some((scheme, rest)) => Err(format!("{scheme}:// is not spoken here: write http://{rest}")),
    }
}

/// Explores once; the session stays on the server.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    args.session.check()?;
    args.sensors.faults.check()?;
    if let Some(path) = &args.out {
        writable::check("--out", path)?;
    }
    let (name, body) = args.object.load("bottle")?;
    let client = Client::connect(&args.server).await?;
    say(format_args!("A simulated robot explores through {}: {name}.", args.server))?;
    let plan = plan(&name, "explore", &args.session, &args.sensors);
    let exploration = drive(client, &body, plan).await?;
    say(format_args!("\n{exploration}"))?;
    if let Some(path) = &args.out {
        save_ply(&exploration, path)?;
    }
    say(format_args!("session: {}/v1/sessions/{}", args.server.trim_end_matches('/'), exploration.session_id))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_encrypted_address_is_refused_and_a_bare_one_is_completed() {
        assert!(server("https://127.0.0.1:7257").unwrap_err().contains("write http://127.0.0.1:7257"));
        assert!(server("ftp://lab").unwrap_err().contains("write http://lab"));
        assert_eq!(server("127.0.0.1:7257"), Ok("http://127.0.0.1:7257".to_owned()));
        assert_eq!(server("http://lab:7257"), Ok("http://lab:7257".to_owned()));
    }
}
