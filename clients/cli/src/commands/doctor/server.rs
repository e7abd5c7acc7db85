//! A running server, asked over HTTP.

use std::time::{Duration, SystemTime};

use palpate_server::Limits;
use reqwest::Client;
use serde_json::Value;

use super::finding::Findings;
use crate::failure::Failure;
use crate::probe;

/// A clock that differs by more makes times in logs hard to compare.
const SKEW: Duration = Duration::from_secs(3);

/// What a server said.
pub(super) struct Answer {
    pub(super) text: String,
    /// The text as JSON, null where it is none.
    pub(super) json: Value,
    is_success: bool,
    date: Option<SystemTime>,
}

/// Asks a server for a path.
///
/// # Errors
/// It does not answer.
pub(super) async fn ask(client: &Client, url: &str, path: &str) -> Result<Answer, Failure> {
    let answer = client.get(format!("{url}{path}")).send().await?;
    let is_success = answer.status().is_success();
    let date = answer.headers().get("date").and_then(|date| date.to_str().ok());
    let date = date.and_then(|date| httpdate::parse_http_date(date).ok());
    let text = answer.text().await?;
    let json = serde_json::from_str(&text).unwrap_or_default();
    Ok(Answer { text, json, is_success, date })
}

/// What the server at this address says of itself, and in what its limits are other than these.
pub(super) async fn report(client: &Client, url: &str, limits: &Limits, findings: &mut Findings) {
    let version = match ask(client, url, "/version").await {
        Ok(answer) => answer,
        Err(error) => {
            let text = format!("nothing answers at {url}: {}", probe::cause(&*error));
            findings.problem("server", text, "start it, or name its address with --server");
            return;
        }
    };
    let own = env!("CARGO_PKG_VERSION");
    match version.json["version"].as_str() {
        Some(theirs) if theirs == own => findings.ok("server", format!("palpate {theirs} answers at {url}")),
        Some(theirs) => findings.warn(
            "server",
            format!("palpate {theirs} answers at {url}, and this program is {own}"),
            "ask with the server's own version",
        ),
        None if version.json["reason"].as_str().is_some_and(|reason| reason.starts_with("TOKEN_")) => {
            findings.problem(
                "server",
                format!("a server answers at {url}, and not without a token"),
                "give one with --token-file or PALPATE_TOKEN",
            );
            return;
        }
        None => {
            findings.problem(
                "server",
                format!("what answers at {url} is no palpate"),
                "name its address with --server",
            );
            return;
        }
    }
    readiness(client, url, findings).await;
    compare_limits(client, url, limits, findings).await;
    if let Some(theirs) = version.date {
        let skew = SystemTime::now().duration_since(theirs).unwrap_or_else(|error| error.duration());
        let text = format!("the server's clock differs from this machine's by {} s", skew.as_secs());
        if skew > SKEW {
            findings.warn("clock", text, "keep both right with NTP");
        } else {
            findings.ok("clock", text);
        }
    }
}

/// Whether the server has the limits that the settings here say, by its metrics.
async fn compare_limits(client: &Client, url: &str, limits: &Limits, findings: &mut Findings) {
    let Ok(metrics) = ask(client, url, "/metrics").await else { return };
    let numbers = limits.numbers();
    let ours = |name: &str| numbers.iter().find(|(known, _)| *known == name).map(|(_, number)| *number);
    let theirs: Vec<(&str, f64)> = metrics.text.lines().filter_map(limit).collect();
    let differ = theirs.iter().filter(|(name, number)| ours(name) != Some(*number));
    let named: Vec<String> = differ.map(|(name, number)| format!("{name} {number}")).collect();
    // Whoever may not read the metrics is told nothing of limits.
    if theirs.is_empty() {
        return;
    }
    if named.is_empty() {
        findings
            .ok("in force", format!("the server has the {} limits that the settings here say", theirs.len()));
    } else {
        let text = format!("the server has other limits than the settings here: {}", named.join(", "));
        findings.warn(
            "in force",
            text,
            "name the server's own file with --config, or restart it with this one",
        );
    }
}

/// The name and the number of a limit in a line of the metrics.
fn limit(line: &str) -> Option<(&str, f64)> {
    let (name, number) = line.strip_prefix("palpate_limit{name=\"")?.split_once("\"} ")?;
    Some((name, number.parse().ok()?))
}

async fn readiness(client: &Client, url: &str, findings: &mut Findings) {
    match ask(client, url, "/readyz").await {
        Ok(ready) if ready.is_success => {
            findings.ok("ready", "the server takes work");
            for line in ready.text.lines().skip(1) {
                findings.warn("ready", line, "`palpate ls` and the server's log say which sessions and why");
            }
        }
        Ok(refused) => {
            let why = refused.json["detail"].as_str().unwrap_or(&refused.text).to_owned();
            findings.problem("ready", why, "the server's log says what keeps it from its work");
        }
        Err(error) => {
            findings.problem(
                "ready",
                probe::cause(&*error),
                "the server's log says what keeps it from its work",
            );
        }
    }
}
