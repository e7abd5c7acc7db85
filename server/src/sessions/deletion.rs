//! Deleting a session, for good: it waits for its permit like any change, and a retry is answered as before.

use tokio::time::Instant;

use super::{ATTEMPTS, Aggregate, RequestKey, Sessions, contended};
use crate::error::Error;
use crate::session::etag;
use crate::store::{Deletion, StoreError};

impl<S: Aggregate> Sessions<S> {
    pub(super) async fn delete_in_order(
        &self,
        session_id: &str,
        wanted_etag: &str,
        request: &RequestKey,
        deadline: Instant,
    ) -> Result<(), Error> {
        self.refuse_while_stopping()?;
        let live = self.live.get(session_id);
        let _permit = live.permit(deadline).await?;
        if !request.id.is_empty() {
            match self.store.deleted_by(session_id, &request.id).await? {
                None => {}
                Some(digest) if digest == request.digest => return Ok(()),
                Some(_) => return Err(Error::RequestIdReused { request_id: request.id.clone() }),
            }
        }
        for _ in 0..ATTEMPTS {
            // The row and not the snapshot: also a log that cannot be replayed can be removed.
            let Some(row) = self.store.session(session_id).await? else {
                live.mark_gone();
                self.live.forget(session_id, &live);
                return Err(Error::SessionNotFound { session_id: session_id.to_owned() });
            };
            let actual = etag(row.created_us, row.head);
            if !wanted_etag.is_empty() && wanted_etag.trim_matches('"') != actual {
                return Err(Error::EtagMismatch { expected: wanted_etag.to_owned(), actual });
            }
            let deletion = Deletion {
                session_id: row.session_id,
                created_us: row.created_us,
                head: Some(row.head),
                request: (!request.id.is_empty()).then(|| (request.id.clone(), request.digest.clone())),
            };
            match self.store.delete(deletion).await {
                Ok(()) => {
                    self.store.checkpoints.forget(session_id);
                    live.mark_gone();
                    self.live.forget(session_id, &live);
                    return Ok(());
                }
                Err(StoreError::Conflict) => {}
                Err(failure) => return Err(failure.into()),
            }
        }
        Err(contended())
    }
}
