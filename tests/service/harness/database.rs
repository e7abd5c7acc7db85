//! Where a test's sessions are: in a file, or, where `PALPATE_TEST_POSTGRES` names a server of PostgreSQL
//! (`postgres://postgres@127.0.0.1:5432`), in a database of the test's own there.

use std::path::Path;

use palpate_server::Location;
use sha2::{Digest, Sha256};
use sqlx::postgres::PgConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions, PgConnection};

/// Names the server.
const VARIABLE: &str = "PALPATE_TEST_POSTGRES";

/// Whether the tests run on PostgreSQL.
pub(crate) fn is_shared() -> bool {
    std::env::var_os(VARIABLE).is_some()
}

/// The place that stands for a file: the file itself, or a database for it, which is made where there is none.
pub(crate) async fn location(file: &Path) -> Location {
    match std::env::var(VARIABLE) {
        Err(_) => Location::File(file.into()),
        Ok(server) => address(&server, &name(file)).await.parse().unwrap(),
    }
}

/// The same as an argument of the program.
pub(crate) async fn argument(file: &Path) -> std::ffi::OsString {
    match std::env::var(VARIABLE) {
        // A test with a server of PostgreSQL of its own gives the address itself.
        _ if file.to_str().is_some_and(|text| text.starts_with("postgres://")) => file.into(),
        Err(_) => file.into(),
        Ok(server) => address(&server, &name(file)).await.into(),
    }
}

/// A name for the database of a file: each test has a folder of its own.
fn name(file: &Path) -> String {
    let digest = Sha256::digest(file.as_os_str().as_encoded_bytes());
    let hex: String = digest[..12].iter().map(|byte| format!("{byte:02x}")).collect();
    format!("test_{hex}")
}

/// The address of a database, which is made where there is none.
pub(crate) async fn address(server: &str, name: &str) -> String {
    let options: PgConnectOptions = format!("{server}/postgres").parse().unwrap();
    let mut connection = options.connect().await.unwrap();
    let is_there: Option<i32> = sqlx::query_scalar("select 1 from pg_database where datname = $1")
        .bind(name)
        .fetch_optional(&mut connection)
        .await
        .unwrap();
    if is_there.is_none() {
        let create = AssertSqlSafe(format!("create database {name}"));
        sqlx::query(create).execute(&mut connection).await.unwrap();
    }
    format!("{server}/{name}")
}

/// What a query counts in the database that stands for `palpate.db` in a folder.
pub(crate) async fn count(folder: &Path, query: &'static str) -> i64 {
    let mut connection = connect(&folder.join("palpate.db")).await;
    sqlx::query_scalar(query).fetch_one(&mut connection).await.unwrap()
}

/// Carries out a statement in the database that stands for a file.
pub(crate) async fn run(file: &Path, statement: &'static str) {
    sqlx::query(statement).execute(&mut connect(file).await).await.unwrap();
}

async fn connect(file: &Path) -> PgConnection {
    let server = std::env::var(VARIABLE).unwrap();
    let options: PgConnectOptions = address(&server, &name(file)).await.parse().unwrap();
    options.connect().await.unwrap()
}

/// The texts that a query gives.
pub(crate) async fn texts(address: &str, query: impl Into<String>) -> Vec<String> {
    let options: PgConnectOptions = address.parse().unwrap();
    let mut connection = options.connect().await.unwrap();
    sqlx::query_scalar(AssertSqlSafe(query.into())).fetch_all(&mut connection).await.unwrap()
}
