//! The tokens of a server: read from its database again and again, so that one that is made, revoked or expired counts
//! within a second; and their making, for the one who may write the database.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use subtle::ConstantTimeEq;
use tokio::sync::{Mutex, watch};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

use super::caller::{Account, Caller};
use super::scope::Scope;
use super::token::Token;
use crate::error::Error;
use crate::session::now_us;
use crate::store::{Location, OpenError, StoreError, TokenFile, TokenReader, TokenRow};

/// How often the tokens are read again.
const REFRESH: Duration = Duration::from_secs(1);
/// A token that is not known has them read before it is refused, but not more often than this.
const SOONEST: Duration = Duration::from_millis(100);
/// Tokens of one database: all are held in memory.
const MOST: usize = 1000;

type ById = Arc<HashMap<String, TokenRow>>;

/// The tokens as they were a moment ago; cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Registry {
    reader: TokenReader,
    known: Arc<watch::Sender<ById>>,
    read_at: Arc<Mutex<Instant>>,
}

impl Registry {
    /// Reads the tokens, and goes on doing so until `stopping`.
    ///
    /// # Errors
    /// They cannot be read.
    pub(crate) async fn start(reader: TokenReader, stopping: CancellationToken) -> Result<Self, StoreError> {
        let known = by_id(reader.rows().await?);
        let read_at = Arc::new(Mutex::new(Instant::now()));
        let registry = Self { reader, known: Arc::new(watch::Sender::new(known)), read_at };
        let (refreshing, mut rounds) = (registry.clone(), tokio::time::interval(REFRESH));
        tokio::spawn(async move {
            while stopping.run_until_cancelled(rounds.tick()).await.is_some() {
                refreshing.refresh().await;
            }
        });
        Ok(registry)
    }

    /// Whose token this text is.
    ///
    /// # Errors
    /// It is none of this server's, or no longer in force.
    pub(super) async fn caller(&self, text: &str) -> Result<Caller, Error> {
        let token = Token::parse(text).ok_or(Error::TokenInvalid)?;
        if !self.known.borrow().contains_key(&token.id) {
            self.refresh().await;
        }
        let known = self.known.borrow().clone();
        // A token of an id that does not exist takes as long to refuse as one with a wrong secret.
        let row = known.get(&token.id);
        let expected = row.map_or([0; 32].as_slice(), |row| row.secret_sha256.as_slice());
        let is_right = bool::from(token.digest().as_slice().ct_eq(expected));
        match row {
            Some(row) if is_right => in_force(row, now_us()).and_then(|()| caller(row)),
            _ => Err(Error::TokenInvalid),
        }
    }

    /// Ends when the token of this id is no longer in force.
    pub(super) async fn ended(&self, token_id: &str) -> Error {
        let mut changes = self.known.subscribe();
        loop {
            let state = match changes.borrow_and_update().get(token_id) {
                Some(row) => in_force(row, now_us()),
                None => Err(Error::TokenInvalid),
            };
            if let Err(ended) = state {
                return ended;
            }
            // What expires does not change.
            let _ = tokio::time::timeout(REFRESH, changes.changed()).await;
        }
    }

    /// Whether there is a token that somebody could call with.
    pub(crate) fn has_usable(&self) -> bool {
        self.known.borrow().values().any(|row| in_force(row, now_us()).is_ok())
    }

    /// Reads the tokens as they are now or later; who asks while others do shares what they read.
    async fn refresh(&self) {
        let asked_at = Instant::now();
        let mut read_at = self.read_at.lock().await;
        if *read_at > asked_at {
            return;
        }
        tokio::time::sleep_until(*read_at + SOONEST).await;
        *read_at = Instant::now();
        match self.reader.rows().await {
            Ok(rows) => {
                let rows = by_id(rows);
                self.known.send_if_modified(|known| {
                    let is_new = *known != rows;
                    *known = rows;
                    is_new
                });
            }
            // Those that were in force stay so: a disk that does not answer is no reason to lock robots out.
            Err(error) => tracing::warn!(%error, "the tokens cannot be read again: those of before count"),
        }
    }
}

fn by_id(rows: Vec<TokenRow>) -> ById {
    Arc::new(rows.into_iter().map(|row| (row.id.clone(), row)).collect())
}

fn in_force(row: &TokenRow, now_us: i64) -> Result<(), Error> {
    if row.revoked_us.is_some() {
        Err(Error::TokenInvalid)
    } else if row.expires_us.is_some_and(|expires| expires <= now_us) {
        Err(Error::TokenExpired)
    } else {
        Ok(())
    }
}

fn caller(row: &TokenRow) -> Result<Caller, Error> {
    let scope = row.scope.parse().map_err(|_| Error::TokenInvalid)?;
    let account = Account { token_id: row.id.as_str().into(), share: row.compute_share };
    Ok(Caller::new(format!("{}/{}", row.name, row.id), scope, row.experiments.clone(), account))
}

/// A token to make.
#[derive(Clone, Debug, PartialEq)]
pub struct NewToken {
    /// What people call the caller; it is in lists and in each event.
    pub name: String,
    /// What it may do.
    pub scope: Scope,
    /// Keeps it to experiments whose names begin with this.
    pub experiments: Option<String>,
    /// How long it is in force; `None` until it is revoked.
    pub lasts: Option<Duration>,
    /// Sessions that it may have created at a time.
    pub most_sessions: Option<u64>,
    /// Bytes that their events may take.
    pub most_bytes: Option<u64>,
    /// Its part of the threads where all want them, as others have 1.
    pub compute_share: f64,
}

/// A token that was just made.
#[derive(Clone, Debug)]
pub struct Issued {
    /// Names it.
    pub id: String,
    /// The token itself, which nobody can read again.
    pub token: String,
}

/// What can be told of a token.
#[derive(Clone, Debug, PartialEq)]
pub struct TokenInfo {
    /// Names it.
    pub id: String,
    /// What people call the caller.
    pub name: String,
    /// What it may do.
    pub scope: String,
    /// The experiments that it is kept to.
    pub experiments: Option<String>,
    /// `in force`, `expired` or `revoked`.
    pub state: &'static str,
    /// When it was made, in microseconds since 1970, UTC.
    pub created_us: i64,
    /// When it expires.
    pub expires_us: Option<i64>,
    /// Sessions that it may have created at a time.
    pub most_sessions: Option<u64>,
    /// Bytes that their events may take.
    pub most_bytes: Option<u64>,
    /// Its part of the threads where all want them.
    pub compute_share: f64,
}

/// Why a token was not made, listed or revoked.
#[derive(Debug, thiserror::Error)]
pub enum IssueError {
    /// The database cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// It was not written or read.
    #[error("the tokens cannot be written or read: {0}")]
    Database(#[from] sqlx::Error),
    /// The system gives no random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(getrandom::Error),
    /// Something about the token cannot be so.
    #[error("{0}")]
    Invalid(String),
}

/// The tokens of a database, for the one who may write its file; a server that runs on it need not be stopped.
#[derive(Debug)]
pub struct Tokens(TokenFile);

impl Tokens {
    /// Opens those of this database, which is made where it does not exist.
    ///
    /// # Errors
    /// It cannot be opened.
    pub async fn open(database: &Location) -> Result<Self, IssueError> {
        Ok(Self(TokenFile::open(database).await?))
    }

    /// Makes a token; a server that runs knows it at once.
    ///
    /// # Errors
    /// Something about it cannot be so, or it cannot be written.
    pub async fn create(&mut self, new: &NewToken) -> Result<Issued, IssueError> {
        let now = now_us();
        let rows = self.0.rows().await?;
        check(new, &rows, now)?;
        let token = Token::random().map_err(IssueError::Random)?;
        let micros = |lasts: Duration| i64::try_from(lasts.as_micros()).unwrap_or(i64::MAX);
        let bound = |bound: Option<u64>| bound.map(|bound| i64::try_from(bound).unwrap_or(i64::MAX));
        let row = TokenRow {
            id: token.id.clone(),
            name: new.name.clone(),
            secret_sha256: token.digest().to_vec(),
            scope: new.scope.name().to_owned(),
            experiments: new.experiments.clone(),
            created_us: now,
            expires_us: new.lasts.map(|lasts| now.saturating_add(micros(lasts))),
            revoked_us: None,
            most_sessions: bound(new.most_sessions),
            most_bytes: bound(new.most_bytes),
            compute_share: new.compute_share,
        };
        self.0.insert(&row).await?;
        Ok(Issued { id: token.id.clone(), token: token.text() })
    }

    /// All tokens, the oldest first.
    ///
    /// # Errors
    /// They cannot be read.
    pub async fn list(&mut self) -> Result<Vec<TokenInfo>, IssueError> {
        let now = now_us();
        Ok(self.0.rows().await?.into_iter().map(|row| info(row, now)).collect())
    }

    /// Takes a token out of force, by its id or by its name; what it has open ends within seconds.
    ///
    /// # Errors
    /// There is no such token in force.
    pub async fn revoke(&mut self, id_or_name: &str) -> Result<TokenInfo, IssueError> {
        let now = now_us();
        let rows = self.0.rows().await?;
        let mut named = rows.into_iter().filter(|row| row.revoked_us.is_none());
        let row = named.find(|row| row.id == id_or_name || row.name == id_or_name);
        let row = row.ok_or_else(|| {
            IssueError::Invalid(format!(
                "no token {id_or_name:?} is in force: `palpate token list` shows all"
            ))
        })?;
        self.0.revoke(&row.id, now).await?;
        Ok(info(TokenRow { revoked_us: Some(now), ..row }, now))
    }

    /// Writes what is left to write.
    ///
    /// # Errors
    /// It cannot be written.
    pub async fn close(self) -> Result<(), IssueError> {
        Ok(self.0.close().await?)
    }
}

fn check(new: &NewToken, rows: &[TokenRow], now: i64) -> Result<(), IssueError> {
    let invalid = |text: String| Err(IssueError::Invalid(text));
    let is_plain = |text: &str| {
        !text.is_empty() && text.len() <= 64 && text.chars().all(|c| c.is_alphanumeric() || "._-".contains(c))
    };
    if !is_plain(&new.name) {
        return invalid(format!(
            "the name {:?} has to be of up to 64 letters, digits, dots, dashes and underscores",
            new.name
        ));
    }
    if rows.iter().any(|row| row.name == new.name && in_force(row, now).is_ok()) {
        return invalid(format!(
            "a token {:?} is in force already: revoke it first, or choose another name",
            new.name
        ));
    }
    if rows.len() >= MOST {
        return invalid(format!("the database has {MOST} tokens, as many as it may"));
    }
    if new.experiments.as_ref().is_some_and(|prefix| prefix.is_empty() || prefix.len() > 256) {
        return invalid("the beginning of the experiments' names has to have 1 to 256 bytes".to_owned());
    }
    if !(0.01..=100.0).contains(&new.compute_share) {
        return invalid(format!("the compute share {} is not between 0.01 and 100", new.compute_share));
    }
    Ok(())
}

fn info(row: TokenRow, now: i64) -> TokenInfo {
    let state = match in_force(&row, now) {
        Ok(()) => "in force",
        Err(Error::TokenExpired) => "expired",
        Err(_) => "revoked",
    };
    let bound = |bound: Option<i64>| bound.map(|bound| u64::try_from(bound).unwrap_or(0));
    TokenInfo {
        id: row.id,
        name: row.name,
        scope: row.scope,
        experiments: row.experiments,
        state,
        created_us: row.created_us,
        expires_us: row.expires_us,
        most_sessions: bound(row.most_sessions),
        most_bytes: bound(row.most_bytes),
        compute_share: row.compute_share,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Limits;
    use crate::store::Store;

    fn new(name: &str) -> NewToken {
        NewToken {
            name: name.to_owned(),
            scope: Scope::Robot,
            experiments: None,
            lasts: None,
            most_sessions: None,
            most_bytes: None,
            compute_share: 1.0,
        }
    }

    #[tokio::test]
    async fn a_token_counts_at_once_while_a_server_holds_the_database_and_not_after_it_was_revoked() {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("palpate.db");
        let store = Store::open(&database.as_path().into(), "", &Limits::default()).await.unwrap();
        let stopping = CancellationToken::new();
        let registry = Registry::start(store.token_reader(), stopping.clone()).await.unwrap();
        assert!(!registry.has_usable());
        let mut tokens = Tokens::open(&database.as_path().into()).await.unwrap();
        // The tokens were read a moment ago, and without this one.
        let issued = tokens.create(&new("arm")).await.unwrap();
        let caller = registry.caller(&issued.token).await.unwrap();
        assert_eq!((caller.actor(), caller.scope()), (format!("arm/{}", issued.id).as_str(), Scope::Robot));
        let forged = format!("{}0", &issued.token[..issued.token.len() - 1]);
        let other = if forged == issued.token { format!("{}1", &forged[..forged.len() - 1]) } else { forged };
        assert_eq!(registry.caller(&other).await.unwrap_err(), Error::TokenInvalid);
        let ended = tokio::spawn({
            let (registry, id) = (registry.clone(), issued.id.clone());
            async move { registry.ended(&id).await }
        });
        assert_eq!(tokens.revoke("arm").await.unwrap().state, "revoked");
        assert_eq!(ended.await.unwrap(), Error::TokenInvalid);
        assert_eq!(registry.caller(&issued.token).await.unwrap_err(), Error::TokenInvalid);
        assert!(tokens.revoke("arm").await.is_err());
        stopping.cancel();
        store.close().await;
    }

    #[tokio::test]
    async fn a_token_expires_and_its_name_is_then_free() {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("palpate.db");
        let mut tokens = Tokens::open(&database.as_path().into()).await.unwrap();
        let short = NewToken { lasts: Some(Duration::from_millis(1)), ..new("arm") };
        let issued = tokens.create(&short).await.unwrap();
        tokio::time::sleep(Duration::from_millis(5)).await;
        assert_eq!(tokens.list().await.unwrap()[0].state, "expired");
        tokens.create(&new("arm")).await.unwrap();
        let refused = tokens.create(&new("arm")).await.unwrap_err().to_string();
        assert!(refused.contains("in force already"), "{refused}");
        tokens.close().await.unwrap();
        let store = Store::open(&database.as_path().into(), "", &Limits::default()).await.unwrap();
        let registry = Registry::start(store.token_reader(), CancellationToken::new()).await.unwrap();
        assert!(registry.has_usable());
        assert_eq!(registry.caller(&issued.token).await.unwrap_err(), Error::TokenExpired);
        store.close().await;
    }

    #[tokio::test]
    async fn what_cannot_be_is_refused_in_words() {
        let folder = tempfile::tempdir().unwrap();
        let mut tokens = Tokens::open(&folder.path().join("palpate.db").into()).await.unwrap();
        for (wrong, named) in [
            (new("two words"), "name"),
            (new(""), "name"),
            (NewToken { experiments: Some(String::new()), ..new("a") }, "experiments"),
            (NewToken { compute_share: 0.0, ..new("a") }, "share"),
            (NewToken { compute_share: f64::NAN, ..new("a") }, "share"),
        ] {
            let refused = tokens.create(&wrong).await.unwrap_err().to_string();
            assert!(refused.contains(named), "{refused}");
        }
        assert!(tokens.list().await.unwrap().is_empty());
    }
}
