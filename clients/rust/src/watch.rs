//! Following a session across broken connections: every event arrives once and in order.

use palpate_proto::v1::watch_session_response::Update;
use palpate_proto::v1::{WatchSessionRequest, WatchSessionResponse};
use tonic::Streaming;

use crate::routing::routed;
use crate::{Client, Error};

/// A stream of a session's updates that survives broken connections.
///
/// When the connection breaks it is opened again after the last event that arrived. A mesh that was lost on the way
/// is not sent again; the next event brings a newer one.
#[derive(Debug)]
pub struct Watch {
    client: Client,
    /// What to ask when the stream is opened again: `after_revision` is the last event that arrived.
    request: WatchSessionRequest,
    stream: Option<Streaming<WatchSessionResponse>>,
    /// Failures since the last update; a connection that works now and then is never given up.
    failures: u32,
}

impl Watch {
    pub(crate) async fn open(client: Client, request: WatchSessionRequest) -> Result<Self, Error> {
        let mut watch = Self { client, request, stream: None, failures: 0 };
        // The first opening tells the caller at once that, for instance, there is no such session.
        while watch.stream.is_none() {
            if let Err(error) = watch.reopen().await {
                watch.pause(error).await?;
            }
        }
        Ok(watch)
    }

    /// Waits for the next update; `None` when the server ended the stream because nothing more will come.
    ///
    /// # Errors
    /// [`Error::Refused`] when the server refuses to go on, [`Error::NoAnswer`] when it cannot be reached again.
    pub async fn next(&mut self) -> Result<Option<WatchSessionResponse>, Error> {
        loop {
            match self.attempt().await {
                Ok(update) => {
                    self.failures = 0;
                    if let Some(Update::Event(event)) =
                        update.as_ref().and_then(|update| update.update.as_ref())
                    {
                        self.request.after_revision = event.seq;
                    }
                    return Ok(update);
                }
                Err(error) => {
                    self.stream = None;
                    self.pause(error).await?;
                }
            }
        }
    }

    async fn attempt(&mut self) -> Result<Option<WatchSessionResponse>, Error> {
        let attempts = self.failures + 1;
        let stream = match &mut self.stream {
            Some(stream) => stream,
            None => self.reopen().await?,
        };
        let update = stream.message().await;
        update.map_err(|status| Error::from_status(&status, attempts))
    }

    async fn reopen(&mut self) -> Result<&mut Streaming<WatchSessionResponse>, Error> {
        let mut service = self.client.reconstruction();
        let opening = service.watch_session(routed(self.request.clone()));
        let response = self.client.in_time(opening, self.failures + 1).await?;
        Ok(self.stream.insert(response.into_inner()))
    }

    async fn pause(&mut self, error: Error) -> Result<(), Error> {
        self.failures += 1;
        self.client.retry().pause(error, self.failures).await
    }
}

#[cfg(test)]
mod tests {
    use palpate_proto::v1::watch_session_response::Update;
    use palpate_proto::v1::{WatchSessionRequest, WatchSessionResponse};
    use tonic::{Code, Status};

    use crate::test_server::{Scripted, Step};

    fn seq(update: Option<WatchSessionResponse>) -> Option<i64> {
        match update?.update? {
            Update::Event(event) => Some(event.seq),
            Update::Mesh(_) | Update::Heartbeat(_) => None,
        }
    }

    #[tokio::test]
    async fn a_watch_goes_on_after_the_last_event_when_the_connection_breaks() {
        let broken = || Step::Fail(Status::unavailable("going down"));
        let server =
            Scripted::start(vec![Step::Answer, Step::Answer, broken(), broken(), Step::Answer]).await;
        let client = server.client().await;
        let mut watch = client.watch_session(WatchSessionRequest::default()).await.unwrap();
        for expected in 1..=3 {
            assert_eq!(seq(watch.next().await.unwrap()), Some(expected));
        }
        assert_eq!(watch.next().await.unwrap(), None);
        assert_eq!(server.resumed_after(), vec![0, 2, 2]);
    }

    #[tokio::test]
    async fn a_watch_of_nothing_fails_at_once() {
        let missing = Step::Fail(Status::not_found("no such session"));
        let server = Scripted::start(vec![missing]).await;
        let client = server.client().await;
        let mut watch = client.watch_session(WatchSessionRequest::default()).await.unwrap();
        let error = watch.next().await.unwrap_err();
        assert_eq!(error.code(), Code::NotFound);
        assert_eq!(server.resumed_after(), vec![0]);
    }
}
