//! Tokens beside the log: the server reads them, and the command line writes them, also while the server runs.

use std::path::Path;

use sqlx::{ConnectOptions, FromRow};

use super::apply::Failure;
use super::engine::{Connection, Pool, Statement, sql};
use super::location::Location;
use super::witness::Witness;
use super::{OpenError, Store, StoreError, files, open, postgres};

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

pub(super) const ROWS: &str = "select id, name, secret_sha256, scope, experiments, created_us, expires_us, revoked_us, \
    most_sessions, most_bytes, compute_share from tokens order by created_us, id";

/// Reads the tokens of an open log.
#[derive(Clone, Debug)]
pub(crate) struct TokenReader {
    readers: Pool,
}

impl TokenReader {
    /// All of them, also those that are no longer in force.
    pub(crate) async fn rows(&self) -> Result<Vec<TokenRow>, StoreError> {
        Ok(self.readers.all(sql(ROWS)).await?)
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
    connection: Connection,
    /// Keeps a server from starting meanwhile, where none runs.
    _held: Option<Witness>,
}

impl TokenFile {
    /// Opens them, whether a server holds the database or not; where none does, its tables are brought up to date.
    ///
    /// # Errors
    /// The file cannot be opened, or is held by a server of a version that knows no tokens.
    pub(crate) async fn open(database: &Location) -> Result<Self, OpenError> {
        match database {
            Location::File(path) => Self::in_file(path).await,
            Location::Postgres(address) => {
                Ok(Self { connection: postgres::connection(address).await?, _held: None })
            }
        }
    }

    async fn in_file(database: &Path) -> Result<Self, OpenError> {
        let failed = |source| OpenError::Open { path: database.into(), source };
        if database.is_dir() {
            return Err(failed(sqlx::Error::Io(std::io::ErrorKind::IsADirectory.into())));
        }
        if let Some(held) = Witness::open(database).map_err(|error| failed(error.into()))? {
            files::create_private(database).map_err(|error| failed(error.into()))?;
            let opened = open::writer(database).await;
            held.remove_if_new();
            return Ok(Self { connection: Connection::Sqlite(opened?), _held: Some(held) });
        }
        let mut connection = Connection::Sqlite(open::options(database).connect().await.map_err(failed)?);
        let query = sql("select count(*) from sqlite_schema where name = 'tokens'");
        if query.scalar::<i64>(&mut connection).await? == Some(0) {
            Err(OpenError::InUse { path: database.into() })
        } else {
            Ok(Self { connection, _held: None })
        }
    }

    /// All of them, also those that are no longer in force.
    pub(crate) async fn rows(&mut self) -> Result<Vec<TokenRow>, sqlx::Error> {
        sql(ROWS).all(&mut self.connection).await
    }

    /// Adds one.
    pub(crate) async fn insert(&mut self, row: &TokenRow) -> Result<(), sqlx::Error> {
        insert(row, "").execute(&mut self.connection).await.map(drop)
    }

    /// Takes the one with this id out of force; false where there is none, or it is out already.
    pub(crate) async fn revoke(&mut self, id: &str, now_us: i64) -> Result<bool, sqlx::Error> {
        let query = sql("update tokens set revoked_us = $1 where id = $2 and revoked_us is null");
        let revoked = query.bind(now_us).bind(id).execute(&mut self.connection).await?;
        Ok(revoked == 1)
    }

    /// Writes what is left to write.
    pub(crate) async fn close(self) -> Result<(), sqlx::Error> {
        self.connection.close().await
    }
}

/// Adds a token; `otherwise` says what to do where there is one of its id.
pub(super) fn insert(row: &TokenRow, otherwise: &str) -> Statement {
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
    sql(format!(
        "insert into tokens (id, name, secret_sha256, scope, experiments, created_us, expires_us, revoked_us,
                             most_sessions, most_bytes, compute_share)
         values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11) {otherwise}"
    ))
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
}

/// Counts a session for the token that made it, and its first events.
///
/// # Errors
/// [`StoreError::Share`]: the token has as much as it may.
pub(super) async fn own(
    connection: &mut Connection,
    session_id: &str,
    token_id: &str,
    bytes: u64,
) -> Result<(), Failure> {
    sql("insert into session_owners (session_id, token_id, bytes) values ($1, $2, $3)")
        .bind(session_id)
        .bind(token_id)
        .bind(bytes as i64)
        .execute(connection)
        .await?;
    if connection.is_shared() {
        // The sessions of a token are on many shards, and were counted before.
        return Ok(());
    }
    let counted: Option<(i64, i64)> = sql(COUNTED).bind(token_id).optional(connection).await?;
    check_sessions(counted)?;
    Ok(check_bytes(summed(session_id).optional(connection).await?)?)
}

/// Counts bytes of events for the token that made their session, if one did.
///
/// # Errors
/// [`StoreError::Share`]: the token has as much as it may.
pub(super) async fn grow(connection: &mut Connection, session_id: &str, bytes: u64) -> Result<(), Failure> {
    let query = sql("update session_owners set bytes = bytes + $1 where session_id = $2");
    let grown = query.bind(bytes as i64).bind(session_id).execute(connection).await?;
    if grown == 0 || connection.is_shared() {
        return Ok(());
    }
    Ok(check_bytes(summed(session_id).optional(connection).await?)?)
}

/// Sessions that a token may have made, and that it has.
const COUNTED: &str = "select t.most_sessions, (select count(*) from session_owners where token_id = t.id)
    from tokens t where t.id = $1 and t.most_sessions is not null";

fn check_sessions(counted: Option<(i64, i64)>) -> Result<(), StoreError> {
    match counted {
        Some((most, count)) if count > most => {
            Err(StoreError::Share { what: "sessions of this token", most: most as u64 })
        }
        _ => Ok(()),
    }
}

/// Bytes that the sessions of a session's token may take, and that they take.
fn summed(session_id: &str) -> Statement {
    sql("select t.most_bytes, (select cast(sum(bytes) as bigint) from session_owners where token_id = t.id)
         from session_owners o join tokens t on t.id = o.token_id
         where o.session_id = $1 and t.most_bytes is not null")
    .bind(session_id)
}

fn check_bytes(summed: Option<(i64, i64)>) -> Result<(), StoreError> {
    match summed {
        Some((most, bytes)) if bytes > most => {
            Err(StoreError::Share { what: "bytes of the sessions of this token", most: most as u64 })
        }
        _ => Ok(()),
    }
}

/// Where the sessions of a token are on many shards: whether it may have one more, of so many bytes. What is written at
/// the same moment by other servers is not counted.
///
/// # Errors
/// [`StoreError::Share`]: the token has as much as it may.
pub(super) async fn check_new(readers: &Pool, token_id: &str, bytes: u64) -> Result<(), StoreError> {
    let counted: Option<(i64, i64)> = readers.optional(sql(COUNTED).bind(token_id)).await?;
    check_sessions(counted.map(|(most, count)| (most, count + 1)))?;
    let query = sql("select t.most_bytes,
             (select cast(coalesce(sum(bytes), 0) as bigint) from session_owners where token_id = t.id)
         from tokens t where t.id = $1 and t.most_bytes is not null");
    let summed: Option<(i64, i64)> = readers.optional(query.bind(token_id)).await?;
    check_bytes(summed.map(|(most, taken)| (most, taken.saturating_add(bytes as i64))))
}

/// The same for so many bytes more of a session that is there.
///
/// # Errors
/// The same.
pub(super) async fn check_growth(readers: &Pool, session_id: &str, bytes: u64) -> Result<(), StoreError> {
    let summed: Option<(i64, i64)> = readers.optional(summed(session_id)).await?;
    check_bytes(summed.map(|(most, taken)| (most, taken.saturating_add(bytes as i64))))
}
