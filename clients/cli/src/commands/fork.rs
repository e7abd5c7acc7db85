//! `palpate fork`: the same touches under another method, strategy or symmetry.

use palpate_client::proto::FieldMask;
use palpate_client::proto::v1::{ForkSessionRequest, Method, SessionConfig, Strategy, Symmetry};

use super::list::label;
use super::robot::parser;
use super::server::ServerArgs;
use crate::failure::Failure;
use crate::terminal::say;

pub(super) const ABOUT: &str = "\
Makes a session of the touches of another one, up to any revision, under another method, strategy or symmetry. \
The session itself stays as it is.

For instance what the paper's method makes of the same touches: \
palpate fork mug-1 --to mug-1-paper --method paper --label method=paper";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The session to fork.
    session: String,

    #[command(flatten)]
    server: ServerArgs,

    /// Identifier of the fork; the server makes one unless given.
    #[arg(long, value_name = "SESSION")]
    to: Option<String>,

    /// The last revision to take over; all unless given.
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    revision: i64,

    /// Another method.
    #[arg(long, value_parser = parser::<Method>())]
    method: Option<Method>,

    /// Another strategy.
    #[arg(long, value_parser = parser::<Strategy>())]
    strategy: Option<Strategy>,

    /// Another symmetry.
    #[arg(long, value_parser = parser::<Symmetry>())]
    symmetry: Option<Symmetry>,

    /// A label of the fork, beside those that the session has; may be given several times.
    #[arg(long = "label", value_name = "NAME=VALUE", value_parser = label)]
    labels: Vec<(String, String)>,

    /// The fork's experiment; that of the session unless given.
    #[arg(long, value_name = "NAME")]
    experiment: Option<String>,
}

/// Forks, and says what came of it.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let Args { session, server, to, revision, method, strategy, symmetry, labels, experiment } = args;
    let client = server.connect().await?;
    let mut config = SessionConfig::default();
    let mut paths = Vec::new();
    if let Some(method) = method {
        config.method = method.into();
        paths.push("method".to_owned());
    }
    if let Some(strategy) = strategy {
        config.strategy = strategy.into();
        paths.push("strategy".to_owned());
    }
    if let Some(symmetry) = symmetry {
        config.symmetry = symmetry.into();
        paths.push("symmetry".to_owned());
    }
    let request = ForkSessionRequest {
        session_id: session,
        revision,
        new_session_id: to.unwrap_or_default(),
        config: (!paths.is_empty()).then_some(config),
        config_mask: (!paths.is_empty()).then_some(FieldMask { paths }),
        request_id: String::new(),
        display_name: String::new(),
        experiment: experiment.unwrap_or_default(),
        labels: labels.into_iter().collect(),
    };
    let fork = client.fork_session(request).await?;
    let stats = fork.stats.clone().unwrap_or_default();
    say(format_args!(
        "{} has the first {} events of {}: {} attempts, mean uncertainty {:.2}",
        fork.session_id, fork.forked_at_revision, fork.forked_from, stats.attempts, stats.mean_uncertainty
    ))
}
