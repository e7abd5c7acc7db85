//! `palpate config`: all settings of a server, with where each comes from.

use std::borrow::Cow;

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches};
use palpate_server::Limits;

use super::serve;
use crate::config_file::{ConfigFile, setting_name, settings};
use crate::failure::Failure;
use crate::limits;
use crate::terminal::say;
use crate::version::VERSION;

pub(super) const ABOUT: &str = "\
Prints every setting that `palpate serve` would have now, what it means and where it comes from: a flag, the \
environment, the file or the default. What it prints can be used as the file.

For instance: palpate config --show --config palpate.toml";

#[derive(Debug, clap::Args)]
#[command(arg_required_else_help = true)]
#[group(skip)]
pub(crate) struct Args {
    /// Print the settings; nothing is started.
    #[arg(long, required = true)]
    show: bool,

    #[command(flatten, next_help_heading = "Settings of `serve`")]
    serve: serve::Args,
}

/// Prints the settings that the arguments, the environment and the file give.
pub(crate) fn run(args: &Args, program: &clap::Command, matches: &ArgMatches) -> Result<(), Failure> {
    let file = args.serve.config.as_deref().map(ConfigFile::read).transpose()?;
    let in_force = args.serve.limits()?;
    let matches = matches.subcommand_matches("config").unwrap_or(matches);
    say(format_args!("# Settings of palpate {}; what is left out is the default.", *VERSION))?;
    for arg in settings(program) {
        say(setting(arg, file.as_ref(), matches))?;
    }
    say("\n[limits]")?;
    let (defaults, written) = (limits::written(&Limits::default())?, limits::written(&in_force)?);
    for (((name, meaning), (_, default)), (_, value)) in Limits::MEANINGS.iter().zip(defaults).zip(written) {
        let has = |settings: &[(String, String)]| settings.iter().any(|(known, _)| known == name);
        let source = if has(&args.serve.limits) {
            "--limit or PALPATE_LIMIT"
        } else if file.as_ref().is_some_and(|file| has(&file.limits)) {
            "the file"
        } else {
            "default"
        };
        let default = if value == default { String::new() } else { format!("; the default is {default}") };
        say(format_args!("\n{}\n# From: {source}{default}.\n{name} = {value}", comment(meaning.trim())))?;
    }
    Ok(())
}

/// One setting as lines of the file.
fn setting(arg: &Arg, file: Option<&ConfigFile>, matches: &ArgMatches) -> String {
    let name = setting_name(arg).unwrap_or_default();
    let id = arg.get_id().as_str();
    let meaning = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let flag = arg.get_long().unwrap_or_default();
    let environment = arg.get_env().map(|name| name.to_string_lossy().into_owned());
    let source = match matches.value_source(id) {
        Some(ValueSource::CommandLine) => format!("--{flag}"),
        Some(ValueSource::EnvVariable) => environment.clone().unwrap_or_default(),
        Some(_) if file.is_some_and(|file| file.has(&name)) => "the file".to_owned(),
        _ => "default".to_owned(),
    };
    let also = environment.map(|name| format!(", {name}")).unwrap_or_default();
    let values: Vec<String> = matches
        .get_raw(id)
        .into_iter()
        .flatten()
        .map(|raw| quoted(&masked(&raw.to_string_lossy())))
        .collect();
    let line = match (values.as_slice(), arg.get_action()) {
        ([], ArgAction::Append) => format!("{name} = []"),
        ([], ArgAction::SetTrue) => format!("{name} = false"),
        ([], _) => format!("# {name} = \"\""),
        (values, ArgAction::Append) => format!("{name} = [{}]", values.join(", ")),
        (values, _) => format!("{name} = {}", values.join(", ")),
    };
    format!("\n{}\n# Flag --{flag}{also}. From: {source}.\n{line}", comment(&meaning))
}

fn comment(text: &str) -> String {
    textwrap::fill(text, textwrap::Options::new(100).initial_indent("# ").subsequent_indent("# "))
}

/// A value without the password that an address may have.
fn masked(text: &str) -> Cow<'_, str> {
    let Some((scheme, rest)) = text.split_once("://") else { return text.into() };
    let authority = &rest[..rest.find(['/', '?']).unwrap_or(rest.len())];
    match authority.rsplit_once('@').and_then(|(user, _)| user.split_once(':')) {
        Some((user, password)) => {
            format!("{scheme}://{user}:***{}", &rest[user.len() + 1 + password.len()..]).into()
        }
        None => text.into(),
    }
}

/// A value as TOML has it.
fn quoted(text: &str) -> String {
    match text.parse::<toml::Value>() {
        Ok(value @ (toml::Value::Integer(_) | toml::Value::Boolean(_))) => value.to_string(),
        _ => toml::Value::String(text.to_owned()).to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_is_not_shown() {
        for (address, shown) in [
            ("postgres://lab:se:cr@t@db/palpate", "postgres://lab:***@db/palpate"),
            ("postgres://lab@db:5432/palpate", "postgres://lab@db:5432/palpate"),
            ("postgres://db:5432/palpate?a=b:c@d", "postgres://db:5432/palpate?a=b:c@d"),
            ("palpate.db", "palpate.db"),
        ] {
            assert_eq!(masked(address), shown);
        }
    }
}
