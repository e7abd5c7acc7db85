//! A server that asks its callers for tokens.

use std::collections::BTreeMap;
use std::time::Duration;

use palpate_client::Client;
use palpate_server::access::{NewToken, Scope, Tokens};
use palpate_server::{Limits, ServeOptions};
use tempfile::TempDir;

use super::{Http, Server, database};

/// A server, and the tokens of those who may call it, by their names.
pub(crate) struct Guarded {
    pub(crate) server: Server,
    pub(crate) tokens: BTreeMap<String, String>,
}

/// A token without bounds.
pub(crate) fn new_token(name: &str, scope: Scope) -> NewToken {
    NewToken {
        name: name.to_owned(),
        scope,
        experiments: None,
        lasts: None,
        most_sessions: None,
        most_bytes: None,
        compute_share: 1.0,
    }
}

/// The tokens of a new database in this folder.
pub(crate) async fn issue(folder: &TempDir, new: &[NewToken]) -> BTreeMap<String, String> {
    let mut file = Tokens::open(&database::location(&folder.path().join("palpate.db")).await).await.unwrap();
    let mut tokens = BTreeMap::new();
    for new in new {
        tokens.insert(new.name.clone(), file.create(new).await.unwrap().token);
    }
    file.close().await.unwrap();
    tokens
}

impl Guarded {
    /// A server whose refusals do not wait, and these tokens.
    pub(crate) async fn start(new: &[NewToken]) -> Self {
        let limits = Limits { refused_wait: Duration::ZERO, ..Limits::default() };
        Self::with_options(new, ServeOptions { limits, ..ServeOptions::default() }).await
    }

    pub(crate) async fn with_options(new: &[NewToken], options: ServeOptions) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let tokens = issue(&folder, new).await;
        let server = Server::over(folder, ServeOptions { require_tokens: true, ..options }).await;
        Self { server, tokens }
    }

    /// Revokes a token while the server runs.
    pub(crate) async fn revoke(&self, name: &str) {
        let mut tokens =
            Tokens::open(&database::location(&self.server.folder().join("palpate.db")).await).await.unwrap();
        tokens.revoke(name).await.unwrap();
        tokens.close().await.unwrap();
    }

    /// The client that robots use, with this token.
    pub(crate) async fn client(&self, name: &str) -> Client {
        Client::builder(&self.server.url()).token(&self.tokens[name]).connect().await.unwrap()
    }

    /// A caller over HTTP with this token.
    pub(crate) fn http(&self, name: &str) -> Http {
        self.anonymous().with_token(&self.tokens[name])
    }

    /// A caller over HTTP without any.
    pub(crate) fn anonymous(&self) -> Http {
        self.server.http()
    }
}
