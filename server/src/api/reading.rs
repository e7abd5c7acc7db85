//! The log of a session, in pages.

use palpate_proto::v1;

use super::{Api, Call, bad_page_token, page_size};
use crate::error::Error;
use crate::wire::event;

/// Events read from the log at once, because clouds may be large.
const CHUNK: u32 = 16;

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
            self.events_after(session_id, after, count, include_points).await
        })
        .await
    }

    async fn events_after(
        &self,
        session_id: String,
        after: i64,
        count: u32,
        include_points: bool,
    ) -> Result<v1::ListEventsResponse, Error> {
        let row = self.sessions.store.session(&session_id).await?;
        let head = row.ok_or(Error::SessionNotFound { session_id: session_id.clone() })?.head;
        let (mut events, mut last, mut bytes) = (Vec::new(), after, 0);
        while events.len() < count as usize && last < head && bytes < self.limits.message_bytes {
            let chunk = CHUNK.min(count - events.len() as u32);
            for row in self.sessions.store.events(&session_id, last, chunk.into()).await? {
                let size = if include_points { row.payload.len() } else { 0 };
                if bytes > 0 && bytes + size > self.limits.message_bytes {
                    bytes += size;
                    break;
                }
                bytes += size;
                last = row.seq;
                events.push(
                    event::decode(row, include_points).map_err(|error| Error::internal(error.to_string()))?,
                );
            }
        }
        let next_page_token = if last < head { last.to_string() } else { String::new() };
        Ok(v1::ListEventsResponse { events, next_page_token })
    }
}
