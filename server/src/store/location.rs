//! Where a log is: in a file, or on PostgreSQL.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::postgres::{Address, AddressError};

/// Where a log is. What is shown of it has no password.
#[derive(Clone)]
pub enum Location {
    /// A file of SQLite, which one server holds.
    File(PathBuf),
    /// PostgreSQL, or what speaks its protocol, which any number of servers share.
    Postgres(Address),
}

impl Location {
    /// The place that a text names: an address that begins with `postgres:`, or else a file.
    ///
    /// # Errors
    /// It begins like an address and is none.
    pub fn parse(text: &OsStr) -> Result<Self, AddressError> {
        match text.to_str() {
            Some(text) if Address::is_meant(text) => Ok(Self::Postgres(Address::from_str(text)?)),
            _ => Ok(Self::File(text.into())),
        }
    }

    /// The file, where it is one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Postgres(_) => None,
        }
    }
}

impl FromStr for Location {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        Self::parse(OsStr::new(text))
    }
}

impl From<PathBuf> for Location {
    fn from(path: PathBuf) -> Self {
        Self::File(path)
    }
}

impl From<&Path> for Location {
    fn from(path: &Path) -> Self {
        Self::File(path.into())
    }
}

impl fmt::Display for Location {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(formatter, "{}", path.display()),
            Self::Postgres(address) => write!(formatter, "{address}"),
        }
    }
}

impl fmt::Debug for Location {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(formatter, "{path:?}"),
            Self::Postgres(address) => write!(formatter, "{address:?}"),
        }
    }
}
