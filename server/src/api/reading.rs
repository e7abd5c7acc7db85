//! The log of a session, in pages; each is read a bounded number of bytes at a time.

use palpate_proto::v1;

use super::{Api, Call, bad_page_token, page_size};
use crate::error::Error;
use crate::store::{SessionRow, StoreError};
use crate::wire::event;

/// Events read from the log at once, if they are not large.
const CHUNK: u32 = 64;

impl Api {
    /// A page of events, oldest first. It ends early where its clouds would make it too large.
    ///
    /// # Errors
    /// No such session, or the page cannot be named so.
    pub(crate) async fn list_events(
        &self,
        request: v1::ListEventsRequest,
        call: Call,
    ) -> Result<v1::ListEventsResponse, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("ListEvents", &session_id, &call, async |_| {
            let v1::ListEventsRequest { session_id, page_size: wanted, page_token, include_points } = request;
            let count = page_size(wanted, &self.limits)?;
            let after = if page_token.is_empty() {
                0
            } else {
                page_token.parse().ok().filter(|&seq: &i64| seq >= 0).ok_or_else(bad_page_token)?
            };
            let session = self.sessions.store.session(&session_id).await?;
            let session = session.ok_or(Error::SessionNotFound { session_id })?;
            self.events_after(session, after, count, include_points).await
        })
        .await
    }

    /// The events of a session as it was when it was looked up.
    pub(super) async fn events_after(
        &self,
        session: SessionRow,
        after: i64,
        count: u32,
        include_points: bool,
    ) -> Result<v1::ListEventsResponse, Error> {
        let store = &self.sessions.store;
        let (session_id, created_us, head) = (&session.session_id, session.created_us, session.head);
        let not_found = || Error::SessionNotFound { session_id: session_id.clone() };
        let retractions = self.sessions.retractions(session_id, head).await?;
        let (mut events, mut last, mut bytes) = (Vec::new(), after, 0);
        while events.len() < count as usize && last < head && bytes < self.limits.message_bytes {
            let chunk = i64::from(CHUNK.min(count - events.len() as u32)).min(head - last);
            let read = store.events_within(session_id, last, chunk, self.limits.read_bytes).await;
            let rows = match read {
                // What is sound is told; the next page says what is wrong.
                Err(StoreError::Damaged(_)) if !events.is_empty() => break,
                rows => rows?,
            };
            if rows.is_empty() {
                // Removed since it was looked up, or its head is wrong: either way nothing more will come.
                let now = store.session(session_id).await?.ok_or_else(not_found)?;
                if now.created_us != created_us {
                    return Err(not_found());
                }
                last = head;
            }
            for row in rows {
                let size = if include_points { row.payload.len() } else { 0 };
                if bytes > 0 && bytes + size > self.limits.message_bytes {
                    bytes += size;
                    break;
                }
                bytes += size;
                last = row.seq;
                let event = event::decode(row, include_points, retractions.of(last));
                events.push(event.map_err(|error| Error::internal(error.to_string()))?);
            }
        }
        let next_page_token = if last < head { last.to_string() } else { String::new() };
        Ok(v1::ListEventsResponse { events, next_page_token })
    }
}
