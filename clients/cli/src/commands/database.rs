//! Which database a command is about: a file of SQLite, or an address of PostgreSQL.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use palpate_server::Location;

use crate::failure::Failure;
use crate::writable;

/// The database.
#[derive(Clone, Debug, clap::Args)]
#[group(skip)]
pub(crate) struct DatabaseArgs {
    /// Where all sessions are: a file of SQLite, which is made where it does not exist, or the address of a database of
    /// PostgreSQL, such as postgres://palpate@db.lab/palpate, which several servers may share. Hosts of which one takes
    /// writes are separated by commas.
    #[arg(long, env = "PALPATE_DATABASE", hide_env_values = true, value_name = "FILE|ADDRESS")]
    #[arg(default_value = "palpate.db", global = true)]
    database: OsString,

    /// A file that holds the address, so that its password is seen neither in a list of processes nor in the
    /// environment. It goes before --database.
    #[arg(long, env = "PALPATE_DATABASE_FILE", value_name = "FILE", global = true)]
    database_file: Option<PathBuf>,
}

impl DatabaseArgs {
    /// Where the database is.
    ///
    /// # Errors
    /// The address is none, or its file cannot be read.
    pub(crate) fn location(&self) -> Result<Location, Failure> {
        let text = match &self.database_file {
            None => self.database.clone(),
            Some(file) => {
                let text = std::fs::read_to_string(file);
                let text = text.map_err(|error| format!("--database-file {}: {error}", file.display()))?;
                text.trim().into()
            }
        };
        location(&text)
    }

    /// The file, for a command that is about files only.
    ///
    /// # Errors
    /// It is an address; `instead` says what to do.
    pub(crate) fn file(&self, instead: &str) -> Result<PathBuf, Failure> {
        match self.location()? {
            Location::File(path) => Ok(path),
            Location::Postgres(address) => Err(format!("{address} is no file: {instead}").into()),
        }
    }
}

/// The place that a text names.
///
/// # Errors
/// It begins like an address and is none.
pub(crate) fn location(text: &std::ffi::OsStr) -> Result<Location, Failure> {
    Location::parse(text).map_err(|error| format!("the address of the database: {error}").into())
}

/// Refuses a file that cannot be written, in the words of the flag that names it.
///
/// # Errors
/// It is a folder, or may not be changed.
pub(crate) fn check_writable(flag: &str, location: &Location) -> Result<(), Failure> {
    location.file().map_or(Ok(()), |path: &Path| writable::check(flag, path))
}
