//! What a stream has for its reader: bounded in messages and in bytes, and in how long it is kept.
//!
//! A producer waits for its reader, but not for ever: one who takes nothing for a while loses what
//! waits and the stream ends, so that a reader who sleeps costs neither memory nor a place.

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio_stream::Stream;

use crate::error::Error;
use crate::limits::Limits;

/// Messages that wait for a slow reader; the producer then waits too.
const STREAM_BUFFER: usize = 16;

/// A stream of replies; an error ends it.
#[derive(Debug)]
pub(crate) struct Replies<T> {
    inbox: Arc<Mutex<Inbox<T>>>,
}

/// Where a producer puts its messages.
#[derive(Debug)]
pub(super) struct Outbox<T> {
    messages: mpsc::Sender<Waiting<T>>,
    /// Bytes that there is room for.
    room: Arc<Semaphore>,
    most_bytes: u32,
    patience: Duration,
    inbox: Arc<Mutex<Inbox<T>>>,
}

/// The reader is gone, or asleep.
#[derive(Debug)]
pub(super) struct Gone;

#[derive(Debug)]
struct Waiting<T> {
    message: T,
    _bytes: OwnedSemaphorePermit,
}

/// The reader's side, which the producer empties when the reader sleeps.
#[derive(Debug)]
struct Inbox<T> {
    messages: Option<mpsc::Receiver<Waiting<T>>>,
    /// How many messages the reader has taken.
    taken: u64,
    /// Why the stream ends; comes after all messages.
    end: Option<Error>,
}

/// A stream and the place where its messages come from.
pub(super) fn stream<T>(limits: &Limits) -> (Outbox<T>, Replies<T>) {
    let most_bytes = u32::try_from(limits.stream_bytes.max(1)).unwrap_or(u32::MAX);
    let (messages, receiver) = mpsc::channel(STREAM_BUFFER);
    let inbox = Arc::new(Mutex::new(Inbox { messages: Some(receiver), taken: 0, end: None }));
    let room = Arc::new(Semaphore::new(most_bytes as usize));
    let outbox = Outbox { messages, room, most_bytes, patience: limits.stream_stall, inbox: inbox.clone() };
    (outbox, Replies { inbox })
}

impl<T> Outbox<T> {
    /// Waits until there is room for a message of so many bytes.
    ///
    /// # Errors
    /// The reader has left, or takes nothing.
    pub(super) async fn send(&self, message: T, bytes: usize) -> Result<(), Gone> {
        // A message that is larger than all the room waits until it is alone.
        let bytes = u32::try_from(bytes).unwrap_or(u32::MAX).min(self.most_bytes);
        let send = async {
            let room = self.room.clone().acquire_many_owned(bytes).await.map_err(|_closed| Gone)?;
            self.messages.send(Waiting { message, _bytes: room }).await.map_err(|_left| Gone)
        };
        tokio::pin!(send);
        let mut taken = lock(&self.inbox).taken;
        loop {
            if let Ok(sent) = tokio::time::timeout(self.patience, &mut send).await {
                return sent;
            }
            let mut inbox = lock(&self.inbox);
            if inbox.taken == taken {
                tracing::info!("a reader takes nothing: its stream ends");
                inbox.messages = None;
                inbox.end = Some(asleep(self.patience));
                return Err(Gone);
            }
            taken = inbox.taken;
        }
    }

    /// The error that the stream ends with, after all that waits, once nobody puts more into it.
    pub(super) fn end(&self, error: Error) {
        lock(&self.inbox).end.get_or_insert(error);
    }

    /// Waits until the reader leaves.
    pub(super) async fn closed(&self) {
        self.messages.closed().await;
    }
}

fn lock<T>(inbox: &Mutex<Inbox<T>>) -> MutexGuard<'_, Inbox<T>> {
    inbox.lock().unwrap_or_else(PoisonError::into_inner)
}

fn asleep(patience: Duration) -> Error {
    Error::Quota {
        what: "milliseconds that a stream waits for its reader",
        limit: u64::try_from(patience.as_millis()).unwrap_or(u64::MAX),
        hint: "read faster, or open it again after the last revision that came",
    }
}

impl<T> Stream for Replies<T> {
    type Item = Result<T, Error>;

    fn poll_next(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let mut inbox = lock(&self.inbox);
        if let Some(messages) = &mut inbox.messages {
            match messages.poll_recv(context) {
                Poll::Pending => return Poll::Pending,
                Poll::Ready(Some(Waiting { message, _bytes })) => {
                    inbox.taken += 1;
                    return Poll::Ready(Some(Ok(message)));
                }
                Poll::Ready(None) => inbox.messages = None,
            }
        }
        Poll::Ready(inbox.end.take().map(Err))
    }
}

impl<T> Drop for Replies<T> {
    fn drop(&mut self) {
        lock(&self.inbox).messages = None;
    }
}

#[cfg(test)]
mod tests {
    use tokio_stream::StreamExt;

    use super::*;

    fn limits() -> Limits {
        Limits { stream_bytes: 100, stream_stall: Duration::from_millis(20), ..Limits::default() }
    }

    #[tokio::test]
    async fn what_waits_is_bounded_in_bytes_and_a_large_message_waits_alone() {
        let (outbox, mut replies) = stream(&limits());
        outbox.send("large", 1_000_000).await.unwrap();
        let next = tokio::spawn(async move {
            outbox.send("small", 60).await.unwrap();
            outbox.send("small", 40).await.unwrap();
            outbox.room.available_permits()
        });
        assert_eq!(replies.next().await, Some(Ok("large")));
        assert_eq!(next.await.unwrap(), 0, "there is room for no byte more");
        assert_eq!((replies.next().await, replies.next().await), (Some(Ok("small")), Some(Ok("small"))));
        assert_eq!(replies.next().await, None);
    }

    #[tokio::test]
    async fn a_reader_who_takes_nothing_loses_the_stream_and_what_waited() {
        let (outbox, mut replies) = stream(&limits());
        let held = Arc::new(());
        outbox.send(held.clone(), 100).await.unwrap();
        assert!(outbox.send(held.clone(), 1).await.is_err());
        assert_eq!(Arc::strong_count(&held), 1, "nothing waits in memory");
        let end = replies.next().await.unwrap().unwrap_err();
        assert!(end.to_string().contains("20 milliseconds"), "{end}");
        assert!(replies.next().await.is_none());
    }

    #[tokio::test]
    async fn a_slow_reader_is_waited_for_as_long_as_it_reads() {
        let limits = Limits { stream_stall: Duration::from_millis(200), ..limits() };
        let (outbox, mut replies) = stream(&limits);
        for _ in 0..10 {
            outbox.send("small", 10).await.unwrap();
        }
        // Ten messages give way to the large one, which takes longer than a reader may sleep.
        let large = tokio::spawn(async move { outbox.send("large", 100).await.is_ok() });
        for _ in 0..10 {
            tokio::time::sleep(Duration::from_millis(50)).await;
            assert_eq!(replies.next().await, Some(Ok("small")));
        }
        assert!(large.await.unwrap());
        assert_eq!(replies.next().await, Some(Ok("large")));
    }

    #[tokio::test]
    async fn the_error_that_ends_a_stream_comes_last_and_is_never_lost() {
        let (outbox, mut replies) = stream(&limits());
        for _ in 0..STREAM_BUFFER {
            outbox.send("full", 1).await.unwrap();
        }
        outbox.end(Error::Draining);
        drop(outbox);
        for _ in 0..STREAM_BUFFER {
            assert_eq!(replies.next().await, Some(Ok("full")));
        }
        assert_eq!(replies.next().await, Some(Err(Error::Draining)));
        assert_eq!(replies.next().await, None);
    }

    #[tokio::test]
    async fn a_producer_is_told_that_its_reader_left() {
        let (outbox, replies) = stream::<()>(&limits());
        drop(replies);
        outbox.closed().await;
        assert!(outbox.send((), 1).await.is_err());
    }
}
