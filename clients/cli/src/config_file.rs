//! The configuration file of a server: what its flags say, and the limits under `[limits]`.
//!
//! ```text
//! flag, else environment variable, else the file, else the default
//! ```
//! A setting of the file is given to the arguments as their default, so each flag of `serve` is a setting of the same
//! name, is checked in the same way, and says in the help what it means.

use std::path::{Path, PathBuf};

use clap::{Arg, ArgMatches, Command};
use toml::{Table, Value};

use crate::failure::Failure;
use crate::near::nearest;

/// The commands that read the file.
const READERS: [&str; 3] = ["serve", "config", "doctor"];
/// Arguments that are no settings: what finds the file, what has a table of its own, and what all programs have.
const NO_SETTINGS: [&str; 6] = ["config", "limits", "show", "help", "version", "command"];

/// What a file says.
#[derive(Debug)]
pub(crate) struct ConfigFile {
    path: PathBuf,
    settings: Vec<(String, Vec<String>)>,
    /// Names and values as they are written.
    pub(crate) limits: Vec<(String, String)>,
}

impl ConfigFile {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, or is no TOML; whether there are such settings is not looked at.
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        let named = |what: &dyn std::fmt::Display| format!("{}: {what}", path.display());
        let text = std::fs::read_to_string(path).map_err(|error| named(&error))?;
        let table: Table = text.parse().map_err(|error| named(&error))?;
        let mut file = Self { path: path.to_owned(), settings: Vec::new(), limits: Vec::new() };
        for (name, value) in table {
            match value {
                Value::Table(limits) if name == "limits" => {
                    for (name, value) in limits {
                        let one = one_text(value).map_err(|what| named(&format!("limits.{name} {what}")))?;
                        file.limits.push((name, one));
                    }
                }
                value => {
                    let texts = texts(value).map_err(|what| named(&format!("{name} {what}")))?;
                    file.settings.push((name, texts));
                }
            }
        }
        Ok(file)
    }

    /// Whether the file says something about a setting.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.settings.iter().any(|(known, _)| known == name)
    }

    /// The program with the file's settings as the defaults of its arguments.
    ///
    /// # Errors
    /// There is no such setting.
    pub(crate) fn as_defaults_of(&self, mut program: Command) -> Result<Command, Failure> {
        for (name, texts) in &self.settings {
            let is_it = |arg: &&Arg| setting_name(arg).as_deref() == Some(name);
            let of_all = program.get_arguments().find(is_it).map(|arg| arg.get_id().clone());
            if let Some(id) = of_all {
                program = program.mut_arg(id, |arg| arg.default_values(texts.clone()));
                continue;
            }
            let of_serve =
                program.find_subcommand("serve").and_then(|serve| serve.get_arguments().find(is_it));
            let Some(id) = of_serve.map(|arg| arg.get_id().clone()) else {
                return Err(self.unknown(name, &program));
            };
            for reader in READERS {
                let (id, texts) = (id.clone(), texts.clone());
                program = program
                    .mut_subcommand(reader, |command| command.mut_arg(id, |arg| arg.default_values(texts)));
            }
        }
        Ok(program)
    }

    /// Says which file a refusal is about.
    pub(crate) fn blame(&self, refusal: impl std::fmt::Display) -> Failure {
        format!("{}: {refusal}", self.path.display()).into()
    }

    fn unknown(&self, name: &str, program: &Command) -> Failure {
        let names: Vec<String> = settings(program).filter_map(setting_name).collect();
        let advice = match nearest(name, names.iter().map(String::as_str)) {
            _ if crate::limits::is_limit(name) => "it is a limit: write it under [limits]".to_owned(),
            Some(near) => format!("did you mean {near}?"),
            None => "`palpate config --show` prints all settings".to_owned(),
        };
        self.blame(format!("there is no setting {name}; {advice}"))
    }
}

/// The file that the arguments or the environment name, if they name one.
pub(crate) fn named_by(matches: &ArgMatches) -> Option<PathBuf> {
    let (command, arguments) = matches.subcommand()?;
    READERS.contains(&command).then(|| arguments.get_one::<PathBuf>("config").cloned())?
}

/// The arguments that are settings, as `serve` has them.
pub(crate) fn settings(program: &Command) -> impl Iterator<Item = &Arg> {
    let of_serve = program.find_subcommand("serve").into_iter().flat_map(Command::get_arguments);
    of_serve.chain(program.get_arguments()).filter(|arg| setting_name(arg).is_some())
}

/// What an argument is called in the file: its flag, with `_` for `-`.
pub(crate) fn setting_name(arg: &Arg) -> Option<String> {
    if NO_SETTINGS.contains(&arg.get_id().as_str()) {
        return None;
    }
    Some(arg.get_long()?.replace('-', "_"))
}

/// A value, or each of a list, as it would be typed.
fn texts(value: Value) -> Result<Vec<String>, String> {
    match value {
        Value::Array(values) => values.into_iter().map(one_text).collect(),
        value => Ok(vec![one_text(value)?]),
    }
}

fn one_text(value: Value) -> Result<String, String> {
    match value {
        Value::String(text) => Ok(text),
        Value::Integer(number) => Ok(number.to_string()),
        Value::Float(number) => Ok(number.to_string()),
        Value::Boolean(yes) => Ok(yes.to_string()),
        Value::Datetime(_) => Err("is a date: write a text in quotation marks".to_owned()),
        Value::Array(_) | Value::Table(_) => Err("has several values where one is meant".to_owned()),
    }
}
