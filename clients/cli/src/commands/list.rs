//! `palpate ls`: the sessions of a server as a table.

use palpate_client::Client;
use palpate_client::proto::v1::{ListSessionsRequest, Session, SessionState};

use super::server::ServerArgs;
use crate::failure::Failure;
use crate::terminal::say;

pub(super) const ABOUT: &str = "\
Lists the sessions of a running server, newest first.

For instance those of one experiment: palpate ls --experiment mugs --label strategy=random";

/// Sessions in one request.
const PAGE: i32 = 100;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    server: ServerArgs,

    /// Only sessions of this experiment.
    #[arg(long, value_name = "NAME")]
    experiment: Option<String>,

    /// Only sessions with this label; may be given several times.
    #[arg(long = "label", value_name = "NAME=VALUE", value_parser = label)]
    labels: Vec<(String, String)>,

    /// At most this many.
    #[arg(long, value_name = "N", default_value_t = 50)]
    limit: usize,
}

/// A label as it is typed.
pub(super) fn label(text: &str) -> Result<(String, String), String> {
    let pair = text.split_once('=').filter(|(name, _)| !name.is_empty());
    let (name, value) = pair.ok_or_else(|| format!("{text:?} is no label: write NAME=VALUE"))?;
    Ok((name.to_owned(), value.to_owned()))
}

/// Prints the table.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let client = args.server.connect().await?;
    let (sessions, has_more) = sessions(&client, &args).await?;
    if sessions.is_empty() {
        return say("no sessions");
    }
    let mut rows = vec![HEADINGS.map(str::to_owned).to_vec()];
    rows.extend(sessions.iter().map(row));
    for line in table(&rows) {
        say(line)?;
    }
    if has_more {
        say(format_args!("... and more: --limit shows them"))?;
    }
    Ok(())
}

async fn sessions(client: &Client, args: &Args) -> Result<(Vec<Session>, bool), Failure> {
    let mut request = ListSessionsRequest {
        page_size: PAGE,
        experiment: args.experiment.clone().unwrap_or_default(),
        labels: args.labels.iter().cloned().collect(),
        ..Default::default()
    };
    let mut all = Vec::new();
    loop {
        let page = client.list_sessions(request.clone()).await?;
        all.extend(page.sessions);
        request.page_token = page.next_page_token;
        if all.len() > args.limit || request.page_token.is_empty() {
            let has_more = all.len() > args.limit || !request.page_token.is_empty();
            all.truncate(args.limit);
            return Ok((all, has_more));
        }
    }
}

const HEADINGS: [&str; 8] =
    ["SESSION", "STATE", "REVISION", "ATTEMPTS", "FAILURES", "UNCERTAINTY", "EXPERIMENT", "LABELS"];

fn row(session: &Session) -> Vec<String> {
    let stats = session.stats.clone().unwrap_or_default();
    let labels: Vec<String> = session.labels.iter().map(|(name, value)| format!("{name}={value}")).collect();
    vec![
        session.session_id.clone(),
        state(session.state()).to_owned(),
        session.revision.to_string(),
        stats.attempts.to_string(),
        stats.failures.to_string(),
        format!("{:.2}", stats.mean_uncertainty),
        session.experiment.clone(),
        labels.join(" "),
    ]
}

fn state(state: SessionState) -> &'static str {
    match state {
        SessionState::Unspecified => "unknown",
        SessionState::AwaitingPrior => "awaiting prior",
        SessionState::Active => "active",
        SessionState::Finished => "finished",
        SessionState::Quarantined => "quarantined",
    }
}

/// The rows as lines, each column as wide as its widest cell; what nobody sees in a terminal is escaped.
pub(super) fn table(rows: &[Vec<String>]) -> Vec<String> {
    let rows: Vec<Vec<String>> =
        rows.iter().map(|row| row.iter().map(|cell| shown(cell)).collect()).collect();
    let columns = rows.first().map_or(0, Vec::len);
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:<width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

fn shown(cell: &str) -> String {
    let escaped = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    cell.chars().map(escaped).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_stand_below_each_other_and_controls_are_seen() {
        let rows = [vec!["A".to_owned(), "B".to_owned()], vec!["long".to_owned(), "x\u{1b}".to_owned()]];
        assert_eq!(table(&rows), ["A     B", "long  x\\u{1b}"]);
    }

    #[test]
    fn a_label_has_a_name() {
        assert_eq!(label("a=b=c"), Ok(("a".to_owned(), "b=c".to_owned())));
        assert!(label("a").is_err() && label("=b").is_err());
    }
}
