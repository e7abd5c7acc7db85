//! The life of sessions: create, get, list, delete.

use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use palpate_proto::v1;
use palpate_proto::v1::event::Kind;
use tokio::time::Instant;

use super::{Api, Call, bad_page_token, computed, page_size, request_key, stored};
use crate::error::Error;
use crate::limits::OPAQUE_BYTES;
use crate::session::{Snapshot, etag};
use crate::sessions::{Created, Creation};
use crate::store::{Filter, PageEnd, SessionRow, StateFilter};
use crate::wire::{event, from_proto, to_proto};

impl Api {
    /// Creates a session that awaits its visual prior.
    ///
    /// # Errors
    /// A field cannot be used, the id is taken, or the request id came with another body.
    pub(crate) async fn create_session(
        &self,
        request: v1::CreateSessionRequest,
        call: Call,
    ) -> Result<v1::Session, Error> {
        let session_id = request.session_id.clone();
        self.run("CreateSession", &session_id, &call, async |_| {
            if !session_id.is_empty() {
                from_proto::check_session_id(&session_id)?;
            }
            call.caller.check_experiment(&request.experiment)?;
            // Checked before the store is asked; the second check, at the creation, is cheap.
            from_proto::definition(&request, 0, &self.limits)?;
            let limits = self.limits.clone();
            let creation = Creation {
                session_id: session_id.clone(),
                request: request_key(&request.request_id, &request, &self.limits)?,
                actor: call.caller.actor().to_owned(),
                owner: call.caller.owner(),
                create: Arc::new(move |session_id, now_us| {
                    let mut request =
                        v1::CreateSessionRequest { session_id: session_id.to_owned(), ..request.clone() };
                    let definition = from_proto::definition(&request, now_us, &limits)?;
                    // The log keeps the defaults of today, so that those of tomorrow change nothing.
                    request.config = Some(to_proto::session_config(&definition));
                    request.frame_id.clone_from(&definition.frame_id);
                    let experiment = definition.experiment.clone();
                    let labels = definition.labels.clone();
                    let created = Snapshot::created(Arc::new(definition));
                    let session = to_proto::session(&created);
                    let event = event::encode(Kind::Created(request));
                    Ok(Created { event, computed: computed(created, &session), experiment, labels })
                }),
            };
            stored(&self.sessions.create(creation).await?.bytes)
        })
        .await
    }

    /// One session at its newest revision.
    ///
    /// # Errors
    /// There is no such session.
    pub(crate) async fn get_session(
        &self,
        request: v1::GetSessionRequest,
        call: Call,
    ) -> Result<v1::Session, Error> {
        let v1::GetSessionRequest { session_id } = request;
        self.run_on_session("GetSession", &session_id, &call, async |deadline| {
            // Where other servers write as well, the table knows better.
            let loaded = self.sessions.loaded(&session_id).filter(|_| !self.sessions.store.is_shared());
            if let Some(snapshot) = loaded {
                return Ok(to_proto::session(&snapshot));
            }
            let row = self.sessions.store.session(&session_id).await?;
            let row = row.ok_or_else(|| Error::SessionNotFound { session_id: session_id.clone() })?;
            self.session_of(&row, deadline).await
        })
        .await
    }

    /// A session as its row says, where that can be trusted; otherwise as its log says.
    pub(super) async fn session_of(&self, row: &SessionRow, deadline: Instant) -> Result<v1::Session, Error> {
        if let Some(summary) = self.sessions.trusted_summary(row).await?
            && let Ok(session) = stored(summary)
        {
            return Ok(session);
        }
        match self.sessions.newest(&row.session_id, deadline).await {
            Ok(snapshot) => Ok(to_proto::session(&snapshot)),
            Err(Error::SessionQuarantined { session_id, sound, reason }) => {
                let quarantine = Some(v1::Quarantine { reason, sound_revision: sound, head: row.head });
                let etag = etag(row.created_us, row.head);
                let mut session =
                    v1::Session { session_id, revision: sound, etag, quarantine, ..Default::default() };
                session.set_state(v1::SessionState::Quarantined);
                Ok(session)
            }
            Err(other) => Err(other),
        }
    }

    /// A page of sessions, newest first.
    ///
    /// # Errors
    /// A filter or the page token cannot be used.
    pub(crate) async fn list_sessions(
        &self,
        request: v1::ListSessionsRequest,
        call: Call,
    ) -> Result<v1::ListSessionsResponse, Error> {
        self.run("ListSessions", "", &call, async |deadline| {
            let v1::ListSessionsRequest { page_size: wanted, page_token, experiment, labels, state } =
                request;
            from_proto::check_labels(&labels, &self.limits)?;
            from_proto::check_name("experiment", &experiment, &self.limits)?;
            from_proto::check_text("page_token", &page_token, OPAQUE_BYTES)?;
            let count = page_size(wanted, &self.limits)? as usize;
            let after = (!page_token.is_empty()).then(|| decode_token(&page_token)).transpose()?;
            let filter = Filter {
                experiments: call.caller.experiments().map(str::to_owned),
                experiment: (!experiment.is_empty()).then_some(experiment),
                state: state_filter(state)?,
                labels,
            };
            // One more than requested shows whether there is a next page.
            let wanted = i64::try_from(count + 1).unwrap_or(i64::MAX);
            let mut rows = self.sessions.store.list(&filter, after.as_ref(), wanted).await?;
            let has_more = rows.len() > count;
            rows.truncate(count);
            let next_page_token =
                rows.last().filter(|_| has_more).map(|row| encode_token(&row.page_end())).unwrap_or_default();
            let mut sessions = Vec::with_capacity(rows.len());
            for row in &rows {
                sessions.push(self.session_of(row, deadline).await?);
            }
            Ok(v1::ListSessionsResponse { sessions, next_page_token })
        })
        .await
    }

    /// Removes a session with all its events, for good.
    ///
    /// # Errors
    /// There is no such session, or its etag is another one.
    pub(crate) async fn delete_session(
        &self,
        request: v1::DeleteSessionRequest,
        call: Call,
    ) -> Result<v1::DeleteSessionResponse, Error> {
        let session_id = request.session_id.clone();
        self.run("DeleteSession", &session_id, &call, async |deadline| {
            from_proto::check_session_named("session_id", &session_id)?;
            from_proto::check_text("etag", &request.etag, OPAQUE_BYTES)?;
            let key = request_key(&request.request_id, &request, &self.limits)?;
            let v1::DeleteSessionRequest { session_id, etag, request_id: _ } = request;
            // One that is gone is not refused here: this may be a retry.
            if self.sees(&session_id, &call.caller).await? == Some(false) {
                return Err(Error::SessionNotFound { session_id });
            }
            self.sessions.delete(session_id, etag, key, deadline).await?;
            Ok(v1::DeleteSessionResponse {})
        })
        .await
    }
}

fn state_filter(state: i32) -> Result<Option<StateFilter>, Error> {
    match v1::SessionState::try_from(state) {
        Ok(v1::SessionState::Unspecified) => Ok(None),
        Ok(v1::SessionState::Quarantined) => Ok(Some(StateFilter::SetAside)),
        Ok(_) => Ok(Some(StateFilter::Is(state))),
        Err(_) => Err(Error::field("state", format!("{state} is no state"))),
    }
}

fn encode_token(last: &PageEnd) -> String {
    let PageEnd { created_us, session_id } = last;
    URL_SAFE_NO_PAD.encode(format!("{created_us}/{session_id}"))
}

fn decode_token(token: &str) -> Result<PageEnd, Error> {
    let decode = || {
        let text = String::from_utf8(URL_SAFE_NO_PAD.decode(token).ok()?).ok()?;
        let (created_us, session_id) = text.split_once('/')?;
        Some(PageEnd { created_us: created_us.parse().ok()?, session_id: session_id.to_owned() })
    };
    decode().ok_or_else(bad_page_token)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_token_is_read_back_and_a_foreign_one_refused() {
        let end = PageEnd { created_us: 17, session_id: "a-mug".into() };
        assert_eq!(decode_token(&encode_token(&end)).unwrap(), end);
        for foreign in ["x", "!!!", "MTc"] {
            assert_eq!(decode_token(foreign), Err(bad_page_token()));
        }
    }
}
