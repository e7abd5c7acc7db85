//! `palpate replay`: the steps of a session again, and the proof that they are what was recorded.

use palpate_client::proto::v1::event::Kind;
use palpate_client::proto::v1::watch_session_response::Update;
use palpate_client::proto::v1::{Event, ReplaySessionRequest, WatchSessionResponse, contact_result};

use super::server::ServerArgs;
use crate::failure::Failure;
use crate::terminal::say;

pub(super) const ABOUT: &str = "\
Shows the steps of a session again, one line each. With --verify the server computes each state anew from the log and \
compares its hash with the recorded one; where one differs, the command fails.";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The session.
    session: String,

    #[command(flatten)]
    server: ServerArgs,

    /// Compute each state anew and compare its hash with the recorded one.
    #[arg(long)]
    verify: bool,

    /// First revision to show.
    #[arg(long, value_name = "N", default_value_t = 1)]
    from: i64,

    /// Last revision to show; the newest unless given.
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    to: i64,
}

/// Prints the steps.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let Args { session, server, verify, from, to } = args;
    let client = server.connect().await?;
    let request = ReplaySessionRequest {
        session_id: session,
        from_revision: from,
        to_revision: to,
        include_mesh: false,
        verify,
    };
    let mut steps = client.replay_session(request).await?;
    let (mut shown, mut differing) = (0, Vec::new());
    while let Some(step) = steps.next().await? {
        let Some(Update::Event(event)) = &step.update else { continue };
        shown += 1;
        say(line(&step, event, verify))?;
        if verify && !step.hash_matches {
            differing.push(event.seq);
        }
    }
    if !verify {
        return Ok(());
    }
    if differing.is_empty() {
        return say(format_args!("all {shown} states are those that were recorded"));
    }
    Err(format!(
        "{} of {shown} states are not those that were recorded, the first at revision {}: they were computed by another \
         version of the method",
        differing.len(),
        differing[0]
    )
    .into())
}

fn line(step: &WatchSessionResponse, event: &Event, verify: bool) -> String {
    let stats = step.session.as_ref().and_then(|session| session.stats.clone()).unwrap_or_default();
    let hash = if !verify {
        String::new()
    } else if step.hash_matches {
        "  same".to_owned()
    } else {
        "  OTHER".to_owned()
    };
    let retracted = match event.retracted_by_seq {
        0 => String::new(),
        by => format!("  retracted by {by}"),
    };
    let (seq, what) = (event.seq, what(event));
    let (uncertainty, failures) = (stats.mean_uncertainty, stats.failures);
    format!("{seq:>5}  {what:<16}  uncertainty {uncertainty:.3}  failures {failures:>3}{hash}{retracted}")
}

fn what(event: &Event) -> &'static str {
    use contact_result::Outcome;
    match &event.kind {
        None => "unknown",
        Some(Kind::Created(_)) => "created",
        Some(Kind::Forked(_)) => "forked",
        Some(Kind::VisualPrior(_)) => "view",
        Some(Kind::RetractedSeq(_)) => "retraction",
        Some(Kind::Finished(_)) => "finished",
        Some(Kind::Updated(_)) => "updated",
        Some(Kind::Lease(_)) => "lease",
        Some(Kind::ContactResult(result)) => match &result.outcome {
            None => "result",
            Some(Outcome::Contact(_) | Outcome::Contacts(_)) => "contact",
            Some(Outcome::NoContact(_)) => "no contact",
            Some(Outcome::Rejected(_)) => "rejected",
            Some(Outcome::InvalidContact(_)) => "invalid contact",
            Some(Outcome::ObjectMoved(_)) => "object moved",
        },
    }
}
