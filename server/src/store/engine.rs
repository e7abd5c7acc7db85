//! The two engines behind one kind of statement: SQLite in a file, and PostgreSQL or what speaks its protocol.
//!
//! The text of a statement is the same for both (`$1` for the first value), and so is what a row is read into; the few
//! that differ ask [`Connection::is_shared`]. sqlx's own `Any` driver is not used: it knows neither SQLite's settings, on
//! which durability rests, nor which host of PostgreSQL takes writes, and it hides which row on disk is damaged.

use std::borrow::Cow;

use sqlx::pool::PoolConnection;
use sqlx::postgres::{PgArguments, PgRow};
use sqlx::sqlite::{SqliteArguments, SqliteRow};
use sqlx::{
    Arguments, AssertSqlSafe, Connection as _, Decode, Encode, FromRow, Postgres, Sqlite, SqliteConnection,
    SqlitePool, Type,
};

use super::postgres::Hosts;

/// A connection of its own.
#[derive(Debug)]
pub(super) enum Connection {
    Sqlite(SqliteConnection),
    Postgres(PoolConnection<Postgres>),
}

/// Connections that are shared by those who read.
#[derive(Clone, Debug)]
pub(super) enum Pool {
    Sqlite(SqlitePool),
    Postgres(Hosts),
}

/// How often a read is tried where a connection turns out to be broken, which it may be without anybody's fault.
const READ_ATTEMPTS: usize = 4;

/// What a row of either engine is read into.
pub(super) trait Record:
    for<'r> FromRow<'r, SqliteRow> + for<'r> FromRow<'r, PgRow> + Send + Unpin
{
}

impl<T: for<'r> FromRow<'r, SqliteRow> + for<'r> FromRow<'r, PgRow> + Send + Unpin> Record for T {}

/// What a row of one column is read into.
pub(super) trait Scalar:
    for<'r> Decode<'r, Sqlite> + Type<Sqlite> + for<'r> Decode<'r, Postgres> + Type<Postgres> + Send + Unpin
{
}

impl<T> Scalar for T where
    T: for<'r> Decode<'r, Sqlite>
        + Type<Sqlite>
        + for<'r> Decode<'r, Postgres>
        + Type<Postgres>
        + Send
        + Unpin
{
}

/// A value of a statement; each may be absent, and has a type all the same.
#[derive(Clone, Debug)]
pub(super) enum Value {
    Integer(Option<i64>),
    Real(Option<f64>),
    Text(Option<String>),
    Bytes(Option<Vec<u8>>),
}

macro_rules! values {
    ($($from:ty => $kind:ident($value:ident) $made:expr;)*) => {$(
        impl From<$from> for Value {
            fn from($value: $from) -> Self {
                Self::$kind($made)
            }
        }
    )*};
}

values! {
    i64 => Integer(value) Some(value);
    &i64 => Integer(value) Some(*value);
    i32 => Integer(value) Some(value.into());
    &i32 => Integer(value) Some((*value).into());
    &u32 => Integer(value) Some((*value).into());
    Option<i64> => Integer(value) value;
    &Option<i64> => Integer(value) *value;
    f64 => Real(value) Some(value);
    &f64 => Real(value) Some(*value);
    &Option<f64> => Real(value) *value;
    &str => Text(value) Some(value.to_owned());
    String => Text(value) Some(value);
    &String => Text(value) Some(value.clone());
    Option<&str> => Text(value) value.map(str::to_owned);
    Option<&String> => Text(value) value.cloned();
    &Option<String> => Text(value) value.clone();
    &[u8] => Bytes(value) Some(value.to_vec());
    &Vec<u8> => Bytes(value) Some(value.clone());
    Vec<u8> => Bytes(value) Some(value);
    Option<Vec<u8>> => Bytes(value) value;
    &Option<Vec<u8>> => Bytes(value) value.clone();
}

/// A statement with its values.
#[derive(Clone, Debug)]
pub(super) struct Statement {
    sql: Cow<'static, str>,
    values: Vec<Value>,
}

/// A statement of this text.
pub(super) fn sql(text: impl Into<Cow<'static, str>>) -> Statement {
    Statement { sql: text.into(), values: Vec::new() }
}

impl Statement {
    /// Gives the next value.
    pub(super) fn bind(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// Adds to the text, which is never of what a caller sent.
    pub(super) fn push(&mut self, text: &str) -> &mut Self {
        self.sql.to_mut().push_str(text);
        self
    }

    /// Adds the place of a value to the text, and gives the value.
    pub(super) fn push_bind(&mut self, value: impl Into<Value>) -> &mut Self {
        self.values.push(value.into());
        let place = format!("${}", self.values.len());
        self.push(&place)
    }

    /// Carries it out, and says how many rows it changed.
    pub(super) async fn execute(self, on: &mut Connection) -> Result<u64, sqlx::Error> {
        let Self { sql, values } = self;
        match on {
            Connection::Sqlite(connection) => {
                let query = sqlx::query_with(AssertSqlSafe(sql.into_owned()), sqlite(values)?);
                Ok(query.execute(connection).await?.rows_affected())
            }
            Connection::Postgres(connection) => {
                let query = sqlx::query_with(AssertSqlSafe(sql.into_owned()), postgres(values)?);
                Ok(query.execute(&mut **connection).await?.rows_affected())
            }
        }
    }

    /// All rows that it gives.
    pub(super) async fn all<T: Record>(self, on: &mut Connection) -> Result<Vec<T>, sqlx::Error> {
        let Self { sql, values } = self;
        match on {
            Connection::Sqlite(connection) => {
                let query = sqlx::query_as_with(AssertSqlSafe(sql.into_owned()), sqlite(values)?);
                query.fetch_all(connection).await
            }
            Connection::Postgres(connection) => {
                let query = sqlx::query_as_with(AssertSqlSafe(sql.into_owned()), postgres(values)?);
                query.fetch_all(&mut **connection).await
            }
        }
    }

    /// Its first row, if it gives one.
    pub(super) async fn optional<T: Record>(self, on: &mut Connection) -> Result<Option<T>, sqlx::Error> {
        Ok(self.all(on).await?.into_iter().next())
    }

    /// The one value that it gives, if it gives one.
    pub(super) async fn scalar<T: Scalar>(self, on: &mut Connection) -> Result<Option<T>, sqlx::Error> {
        Ok(self.optional::<(T,)>(on).await?.map(|(value,)| value))
    }
}

impl Pool {
    /// All rows that a reading statement gives.
    pub(super) async fn all<T: Record>(&self, statement: Statement) -> Result<Vec<T>, sqlx::Error> {
        let Statement { sql, values } = statement;
        match self {
            Self::Sqlite(pool) => {
                let query = sqlx::query_as_with(AssertSqlSafe(sql.into_owned()), sqlite(values)?);
                query.fetch_all(pool).await
            }
            Self::Postgres(hosts) => {
                let mut attempts = 0;
                loop {
                    let mut connection = Connection::Postgres(hosts.acquire().await?);
                    let statement = Statement { sql: sql.clone(), values: values.clone() };
                    attempts += 1;
                    match hosts.in_time(statement.all(&mut connection)).await {
                        Err(error) if is_broken(&error) => {
                            self.discard(connection);
                            if attempts == READ_ATTEMPTS {
                                return Err(error);
                            }
                        }
                        other => return other,
                    }
                }
            }
        }
    }

    /// The first row, if there is one.
    pub(super) async fn optional<T: Record>(&self, statement: Statement) -> Result<Option<T>, sqlx::Error> {
        Ok(self.all(statement).await?.into_iter().next())
    }

    /// The one value that a statement gives, if it gives one.
    pub(super) async fn scalar<T: Scalar>(&self, statement: Statement) -> Result<Option<T>, sqlx::Error> {
        Ok(self.optional::<(T,)>(statement).await?.map(|(value,)| value))
    }

    /// The one value that a statement always gives.
    pub(super) async fn one<T: Scalar>(&self, statement: Statement) -> Result<T, sqlx::Error> {
        self.scalar(statement).await?.ok_or(sqlx::Error::RowNotFound)
    }

    /// A connection of the caller's own, for as long as he needs it.
    ///
    /// # Errors
    /// None could be had in time.
    pub(super) async fn acquire(&self) -> Result<Connection, sqlx::Error> {
        match self {
            Self::Sqlite(pool) => Ok(Connection::Sqlite(pool.acquire().await?.detach())),
            Self::Postgres(hosts) => hosts.acquire().await.map(Connection::Postgres),
        }
    }

    /// Closes a connection of which nothing is known any more.
    pub(super) fn discard(&self, connection: Connection) {
        if let (Self::Postgres(hosts), Connection::Postgres(connection)) = (self, connection) {
            drop(connection.detach());
            hosts.suspect();
        }
    }

    /// Whether other servers may write the same log.
    pub(super) fn is_shared(&self) -> bool {
        matches!(self, Self::Postgres(_))
    }

    /// Ends once no connection is in use.
    pub(super) async fn close(&self) {
        match self {
            Self::Sqlite(pool) => pool.close().await,
            Self::Postgres(hosts) => hosts.close().await,
        }
    }
}

impl Connection {
    /// Whether other servers may write the same log: it is PostgreSQL.
    pub(super) fn is_shared(&self) -> bool {
        matches!(self, Self::Postgres(_))
    }

    /// Begins a transaction that sees one state of the log and changes nothing; `rollback` ends it.
    pub(super) async fn begin_snapshot(&mut self) -> Result<(), sqlx::Error> {
        let begin = match self {
            Self::Sqlite(_) => "begin",
            Self::Postgres(_) => "begin transaction isolation level repeatable read, read only",
        };
        sql(begin).execute(self).await.map(drop)
    }

    /// Closes it, with what is left to write.
    pub(super) async fn close(self) -> Result<(), sqlx::Error> {
        match self {
            Self::Sqlite(connection) => connection.close().await,
            Self::Postgres(connection) => connection.detach().close().await,
        }
    }
}

/// Whether an error says that the connection is of no use any more, and nothing of the statement.
pub(super) fn is_broken(error: &sqlx::Error) -> bool {
    match error {
        sqlx::Error::Io(_) | sqlx::Error::Protocol(_) => true,
        // 57P01 to 57P03: the server stops, has crashed, or starts; 08: the connection; 25006: it takes no writes.
        sqlx::Error::Database(error) => error
            .code()
            .is_some_and(|code| code.starts_with("57P0") || code.starts_with("08") || code == "25006"),
        _ => false,
    }
}

fn sqlite(values: Vec<Value>) -> Result<SqliteArguments, sqlx::Error> {
    let mut arguments = SqliteArguments::default();
    for value in values {
        add(&mut arguments, value)?;
    }
    Ok(arguments)
}

fn postgres(values: Vec<Value>) -> Result<PgArguments, sqlx::Error> {
    let mut arguments = PgArguments::default();
    for value in values {
        add(&mut arguments, value)?;
    }
    Ok(arguments)
}

fn add<A: Arguments>(arguments: &mut A, value: Value) -> Result<(), sqlx::Error>
where
    Option<i64>: for<'q> Encode<'q, A::Database> + Type<A::Database>,
    Option<f64>: for<'q> Encode<'q, A::Database> + Type<A::Database>,
    Option<String>: for<'q> Encode<'q, A::Database> + Type<A::Database>,
    Option<Vec<u8>>: for<'q> Encode<'q, A::Database> + Type<A::Database>,
{
    let added = match value {
        Value::Integer(value) => arguments.add(value),
        Value::Real(value) => arguments.add(value),
        Value::Text(value) => arguments.add(value),
        Value::Bytes(value) => arguments.add(value),
    };
    added.map_err(sqlx::Error::Encode)
}
