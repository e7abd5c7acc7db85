//! `palpate token`: who may call a server that asks.

use std::time::{Duration, UNIX_EPOCH};

use clap::Subcommand;
use palpate_server::access::{NewToken, Scope, TokenInfo, Tokens};

use super::database::DatabaseArgs;
use super::list::table;
use crate::failure::Failure;
use crate::terminal::{say, warn};

pub(super) const ABOUT: &str = "\
Makes, lists and revokes the tokens that callers of a server show.

A server asks for them when it listens on other addresses than the loopback, or with --require-tokens. Whoever may \
write the database may make tokens, whether a server runs on it or not: a new token counts at once, and a revoked \
one no longer within a second, also where its caller has a stream open.

Scopes, of which each includes those before it:
  read     look at sessions, meshes and tables
  robot    run sessions: create them, add views and touches, take them back, finish
  operate  delete sessions and import them
  admin    run the server: its log level";

pub(super) const EXAMPLES: &str = "\
Examples:
  palpate token create --name arm-1
          for a robot; the token is printed, once
  palpate token create --name wall --scope read --experiments mugs --expires 90d
          for a screen that shows sessions of experiments
          that begin with mugs, for three months
  palpate token revoke arm-1";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    database: DatabaseArgs,

    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make a token, and print it: nobody can read it again.
    Create(Create),
    /// List all tokens, without their secrets.
    List,
    /// Take a token out of force.
    Revoke {
        /// Its name, or its id.
        #[arg(value_name = "NAME")]
        token: String,
    },
}

#[derive(Debug, clap::Args)]
struct Create {
    /// What the caller is called, in lists and in each event that it sends.
    #[arg(long, value_name = "NAME")]
    name: String,

    /// What it may do: read, robot, operate or admin.
    #[arg(long, value_name = "SCOPE", default_value = "robot")]
    scope: Scope,

    /// Keep it to experiments whose names begin so: sessions of all others are not there for it.
    #[arg(long, value_name = "BEGINNING")]
    experiments: Option<String>,

    /// How long it is in force, such as 12h or 90d; until it is revoked, unless given.
    #[arg(long = "expires", value_name = "TIME", value_parser = time)]
    lasts: Option<Duration>,

    /// How many sessions that it created there may be at a time.
    #[arg(long, value_name = "N")]
    max_sessions: Option<u64>,

    /// How many MiB the events of those sessions may take.
    #[arg(long = "max-mib", value_name = "MIB")]
    most_mib: Option<u64>,

    /// Its part of the computing threads where all want them, as other tokens have 1.
    #[arg(long, value_name = "SHARE", default_value_t = 1.0)]
    compute_share: f64,
}

/// Changes or shows the tokens of the database.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let Args { database, command } = args;
    let database = database.location()?;
    if !matches!(command, Command::Create(_)) && database.file().is_some_and(|file| !file.exists()) {
        return Err(format!("there is no database {database}: --database says which one").into());
    }
    let mut tokens = Tokens::open(&database).await?;
    match command {
        Command::Create(new) => {
            let Create { name, scope, experiments, lasts, max_sessions, most_mib, compute_share } = new;
            let most_bytes = most_mib.map(|mib| mib.saturating_mul(1 << 20));
            let new = NewToken {
                name,
                scope,
                experiments,
                lasts,
                most_sessions: max_sessions,
                most_bytes,
                compute_share,
            };
            let issued = tokens.create(&new).await?;
            say(issued.token)?;
            // Beside the output, which may go into a file.
            warn(format_args!(
                "this is the only time that the token of {:?} is shown: callers give it as PALPATE_TOKEN, or in a file \
                 that only they can read",
                new.name
            ));
        }
        Command::List => {
            let all = tokens.list().await?;
            if all.is_empty() {
                say("no tokens: `palpate token create` makes one")?;
            } else {
                let mut rows = vec![HEADINGS.map(str::to_owned).to_vec()];
                rows.extend(all.iter().map(row));
                for line in table(&rows) {
                    say(line)?;
                }
            }
        }
        Command::Revoke { token } => {
            let TokenInfo { id, name, .. } = tokens.revoke(&token).await?;
            say(format_args!("{name} ({id}) is revoked"))?;
        }
    }
    Ok(tokens.close().await?)
}

const HEADINGS: [&str; 9] =
    ["NAME", "ID", "SCOPE", "EXPERIMENTS", "STATE", "EXPIRES", "SESSIONS", "MIB", "SHARE"];

fn row(token: &TokenInfo) -> Vec<String> {
    let bound = |bound: Option<u64>| bound.map_or("any".to_owned(), |bound| bound.to_string());
    vec![
        token.name.clone(),
        token.id.clone(),
        token.scope.clone(),
        token.experiments.as_ref().map_or("all".to_owned(), |prefix| format!("{prefix}...")),
        token.state.to_owned(),
        token.expires_us.map_or("never".to_owned(), date),
        bound(token.most_sessions),
        bound(token.most_bytes.map(|bytes| bytes >> 20)),
        token.compute_share.to_string(),
    ]
}

fn date(us: i64) -> String {
    let since_1970 = Duration::from_micros(u64::try_from(us).unwrap_or(0));
    humantime::format_rfc3339_seconds(UNIX_EPOCH + since_1970).to_string()
}

/// A time as people write it, such as `90d`.
fn time(text: &str) -> Result<Duration, String> {
    let time = humantime::parse_duration(text);
    time.ok()
        .filter(|time| !time.is_zero())
        .ok_or_else(|| format!("{text:?} is no time: write 30m, 12h or 90d"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_that_would_be_over_at_once_is_none() {
        assert_eq!(time("90d"), Ok(Duration::from_secs(90 * 86_400)));
        for wrong in ["", "90", "0h", "-1h", "soon"] {
            assert!(time(wrong).unwrap_err().contains("90d"), "{wrong}");
        }
    }
}
