//! Creating a session: an id is taken once, and a request id too, whatever session it is used for.

use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::{
    ATTEMPTS, Aggregate, Created, Creation, Reply, RequestKey, Sessions, answered_before, contended, recorded,
};
use crate::error::Error;
use crate::session::now_us;
use crate::store::{FirstRequest, NewSession, StoreError, first_link};

impl<S: Aggregate> Sessions<S> {
    pub(super) async fn create_now(&self, creation: &Creation<S>) -> Result<Reply, Error> {
        let Creation { session_id: wanted, request, actor, owner, create } = creation;
        self.refuse_while_stopping()?;
        let session_id = chosen_id(wanted, request);
        for _ in 0..ATTEMPTS {
            if let Some(first) = self.first_creation(wanted, &session_id, request).await? {
                return Ok(first);
            }
            self.check_quota().await?;
            let Created { event, computed, experiment, labels } = create(&session_id, now_us())?;
            let (_, head, event) = recorded(computed, request, event, actor, &first_link(&session_id));
            let owner = owner.clone();
            let session =
                NewSession { head, experiment, labels, imported_by: None, owner, reference_of: None };
            let reply = event.reply.clone();
            match self.store.create(session, vec![event]).await {
                Ok(()) => return Ok(Reply { bytes: reply, duplicate: false }),
                Err(StoreError::Conflict) if self.store.session(&session_id).await?.is_some() => {
                    // The same request may have won the race against itself.
                    let first = self.first_creation(wanted, &session_id, request).await?;
                    return first.ok_or(Error::SessionExists { session_id });
                }
                Err(StoreError::Conflict) => {}
                Err(failure) => return Err(failure.into()),
            }
        }
        Err(contended())
    }

    /// The reply to an earlier creation under the same request id, whatever session it asked for; this one is for the
    /// session `wanted`, or for the one that is `chosen` where it wants none.
    pub(super) async fn first_creation(
        &self,
        wanted: &str,
        chosen: &str,
        request: &RequestKey,
    ) -> Result<Option<Reply>, Error> {
        if request.id.is_empty() {
            return Ok(None);
        }
        let Some(made) = self.store.created_by(chosen, &request.id).await? else {
            // The id may have come with another kind of request, or with a creation from before all were noted.
            return if wanted.is_empty() { Ok(None) } else { self.first_reply(wanted, request).await };
        };
        let FirstRequest { session_id, request_digest, reply } = made;
        let first = match (request_digest, reply) {
            // An import, which no event of the session tells of.
            (Some(digest), Some(reply)) => {
                let exists = self.store.session(&session_id).await?.is_some();
                exists.then(|| answered_before(request, &digest, reply)).transpose()?
            }
            _ => self.first_reply(&session_id, request).await?,
        };
        if first.is_some() {
            return Ok(first);
        }
        // The session was deleted since, and its log with it.
        let request_id = request.id.clone();
        if wanted.is_empty() || wanted == session_id {
            // A late retry must not bring it back.
            return Err(Error::SessionDeleted { session_id, request_id });
        }
        Err(Error::RequestIdReused { request_id })
    }

    pub(super) async fn check_quota(&self) -> Result<(), Error> {
        let count = self.store.session_count().await?;
        if u64::try_from(count).unwrap_or(0) < self.limits.sessions {
            return Ok(());
        }
        let hint = "delete sessions that are no longer needed";
        Err(Error::Quota { what: "sessions", limit: self.limits.sessions, hint })
    }
}

/// The id of a new session: the one that is wanted, or else one that follows from the request, so that a retry of which
/// nothing is known yet comes to the same session.
pub(super) fn chosen_id(wanted: &str, request: &RequestKey) -> String {
    if !wanted.is_empty() {
        return wanted.to_owned();
    }
    if request.id.is_empty() {
        return Uuid::now_v7().to_string();
    }
    let digest: [u8; 32] =
        Sha256::new().chain_update("palpate session ").chain_update(&request.id).finalize().into();
    let (id, _) = digest.split_at(16);
    Uuid::new_v8(id.try_into().unwrap_or_default()).to_string()
}
