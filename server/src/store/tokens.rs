//! Tokens beside the log: the server reads them, and the command line writes them, also while the server runs.

use std::path::Path;

use sqlx::{ConnectOptions, Connection, FromRow, SqliteConnection, SqlitePool};

use super::witness::Witness;
use super::{OpenError, Store, StoreError, files, open};

/// A token as the database has it.
#[derive(Clone, Debug, PartialEq, FromRow)]
pub(crate) struct TokenRow {
    pub(crate) id: String,
    pub(crate) name: String,
    pub(crate) secret_sha256: Vec<u8>,
    pub(crate) scope: String,
    pub(crate) experiments: Option<String>,
    pub(crate) created_us: i64,
    pub(crate) expires_us: Option<i64>,
    pub(crate) revoked_us: Option<i64>,
    pub(crate) most_sessions: Option<i64>,
    pub(crate) most_bytes: Option<i64>,
    pub(crate) compute_share: f64,
}

const ROWS: &str = "select id, name, secret_sha256, scope, experiments, created_us, expires_us, revoked_us, \
    most_sessions, most_bytes, compute_share from tokens order by created_us, id";

/// Reads the tokens of an open log.
#[derive(Clone, Debug)]
pub(crate) struct TokenReader {
    readers: SqlitePool,
}

impl TokenReader {
    /// All of them, also those that are no longer in force.
    pub(crate) async fn rows(&self) -> Result<Vec<TokenRow>, StoreError> {
        Ok(sqlx::query_as(ROWS).fetch_all(&self.readers).await?)
    }
}

impl Store {
    /// Reads tokens as long as the log is open.
    pub(crate) fn token_reader(&self) -> TokenReader {
        TokenReader { readers: self.readers.clone() }
    }
}

/// The tokens of a database, for the one who may write its file.
#[derive(Debug)]
pub(crate) struct TokenFile {
    connection: SqliteConnection,
    /// Keeps a server from starting meanwhile, where none runs.
    _held: Option<Witness>,
}

impl TokenFile {
    /// Opens them, whether a server holds the database or not; where none does, its tables are brought up to date.
    ///
    /// # Errors
    /// The file cannot be opened, or is held by a server of a version that knows no tokens.
    pub(crate) async fn open(database: &Path) -> Result<Self, OpenError> {
        let failed = |source| OpenError::Open { path: database.into(), source };
        if database.is_dir() {
            return Err(failed(sqlx::Error::Io(std::io::ErrorKind::IsADirectory.into())));
        }
        if let Some(held) = Witness::open(database).map_err(|error| failed(error.into()))? {
            files::create_private(database).map_err(|error| failed(error.into()))?;
            let opened = open::writer(database).await;
            held.remove_if_new();
            return Ok(Self { connection: opened?, _held: Some(held) });
        }
        let mut connection = open::options(database).connect().await.map_err(failed)?;
        let query = sqlx::query_scalar("select count(*) from sqlite_schema where name = 'tokens'");
        let tables: i64 = query.fetch_one(&mut connection).await?;
        if tables == 0 {
            Err(OpenError::InUse { path: database.into() })
        } else {
            Ok(Self { connection, _held: None })
        }
    }

    /// All of them, also those that are no longer in force.
    pub(crate) async fn rows(&mut self) -> Result<Vec<TokenRow>, sqlx::Error> {
        sqlx::query_as(ROWS).fetch_all(&mut self.connection).await
    }

    /// Adds one.
    pub(crate) async fn insert(&mut self, row: &TokenRow) -> Result<(), sqlx::Error> {
        let TokenRow {
            id,
            name,
            secret_sha256,
            scope,
            experiments,
            created_us,
            expires_us,
            revoked_us,
            most_sessions,
            most_bytes,
            compute_share,
        } = row;
        sqlx::query(
            "insert into tokens (id, name, secret_sha256, scope, experiments, created_us, expires_us, revoked_us,
                                 most_sessions, most_bytes, compute_share)
             values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11)",
        )
        .bind(id)
        .bind(name)
        .bind(secret_sha256)
        .bind(scope)
        .bind(experiments)
        .bind(created_us)
        .bind(expires_us)
        .bind(revoked_us)
        .bind(most_sessions)
        .bind(most_bytes)
        .bind(compute_share)
        .execute(&mut self.connection)
        .await?;
        Ok(())
    }

    /// Takes the one with this id out of force; false where there is none, or it is out already.
    pub(crate) async fn revoke(&mut self, id: &str, now_us: i64) -> Result<bool, sqlx::Error> {
        let query = sqlx::query("update tokens set revoked_us = $1 where id = $2 and revoked_us is null");
        let revoked = query.bind(now_us).bind(id).execute(&mut self.connection).await?;
        Ok(revoked.rows_affected() == 1)
    }

    /// Writes what is left to write.
    pub(crate) async fn close(self) -> Result<(), sqlx::Error> {
        self.connection.close().await
    }
}

/// Counts a session for the token that made it, and its first events.
///
/// # Errors
/// [`StoreError::Share`]: the token has as much as it may.
pub(super) async fn own(
    connection: &mut SqliteConnection,
    session_id: &str,
    token_id: &str,
    bytes: u64,
) -> Result<(), StoreError> {
    sqlx::query("insert into session_owners (session_id, token_id, bytes) values ($1, $2, $3)")
        .bind(session_id)
        .bind(token_id)
        .bind(bytes as i64)
        .execute(&mut *connection)
        .await?;
    let query = "select t.most_sessions, (select count(*) from session_owners where token_id = t.id)
                 from tokens t where t.id = $1 and t.most_sessions is not null";
    let counted: Option<(i64, i64)> =
        sqlx::query_as(query).bind(token_id).fetch_optional(&mut *connection).await?;
    match counted {
        Some((most, count)) if count > most => {
            Err(StoreError::Share { what: "sessions of this token", most: most as u64 })
        }
        _ => check_bytes(connection, session_id).await,
    }
}

/// Counts bytes of events for the token that made their session, if one did.
///
/// # Errors
/// [`StoreError::Share`]: the token has as much as it may.
pub(super) async fn grow(
    connection: &mut SqliteConnection,
    session_id: &str,
    bytes: u64,
) -> Result<(), StoreError> {
    let query = sqlx::query("update session_owners set bytes = bytes + $1 where session_id = $2");
    let grown = query.bind(bytes as i64).bind(session_id).execute(&mut *connection).await?;
    if grown.rows_affected() == 0 { Ok(()) } else { check_bytes(connection, session_id).await }
}

async fn check_bytes(connection: &mut SqliteConnection, session_id: &str) -> Result<(), StoreError> {
    let query = "select t.most_bytes, (select sum(bytes) from session_owners where token_id = t.id)
                 from session_owners o join tokens t on t.id = o.token_id
                 where o.session_id = $1 and t.most_bytes is not null";
    let counted: Option<(i64, i64)> =
        sqlx::query_as(query).bind(session_id).fetch_optional(connection).await?;
    match counted {
        Some((most, bytes)) if bytes > most => {
            Err(StoreError::Share { what: "bytes of the sessions of this token", most: most as u64 })
        }
        _ => Ok(()),
    }
}
