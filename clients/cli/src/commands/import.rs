//! `palpate import`: a session from a bundle.

use std::path::PathBuf;

use palpate_client::proto::v1::CreateSessionRequest;

use super::list::label;
use super::server::ServerArgs;
use crate::failure::Failure;
use crate::terminal::say;

pub(super) const ABOUT: &str = "\
Brings a session from a bundle onto a running server. Without further arguments it is the session that was exported, \
byte for byte; with another id or other names it is a fork of it.

For instance: palpate import mug-1.palpate.tar";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The bundle.
    file: PathBuf,

    #[command(flatten)]
    server: ServerArgs,

    /// Another identifier.
    #[arg(long, value_name = "SESSION")]
    to: Option<String>,

    /// Another experiment.
    #[arg(long, value_name = "NAME")]
    experiment: Option<String>,

    /// A label beside those that the session has; may be given several times.
    #[arg(long = "label", value_name = "NAME=VALUE", value_parser = label)]
    labels: Vec<(String, String)>,
}

/// Imports, and says what came of it.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let Args { file, server, to, experiment, labels } = args;
    let bundle = tokio::fs::read(&file).await.map_err(|error| format!("{}: {error}", file.display()))?;
    let client = server.connect().await?;
    let header = CreateSessionRequest {
        session_id: to.unwrap_or_default(),
        experiment: experiment.unwrap_or_default(),
        labels: labels.into_iter().collect(),
        ..Default::default()
    };
    let session = client.import_session(header, bundle.into()).await?;
    say(format_args!("{} is here, with {} events", session.session_id, session.revision))
}
