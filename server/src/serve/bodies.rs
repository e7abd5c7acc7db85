//! What is received of request bodies: each in a limited time, and not too many bytes of all of them together.
//!
//! A body counts until its request is answered, because until then something of it is held. A stream of messages
//! counts by the message that is arriving, and takes as long as it likes.

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::Request;
use axum::middleware::Next;
use axum::response::Response;
use http::header::{CONNECTION, CONTENT_LENGTH, TRANSFER_ENCODING};
use http::request::Parts;
use http::{HeaderValue, Version};
use hyper::body::{Body as HttpBody, Frame, SizeHint};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Sleep, sleep};

use crate::error::Error;
use crate::limits::Limits;

/// How a body comes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    /// One after the other, and all of it within this time or the server's, whichever is shorter.
    Whole(Option<Duration>),
    /// A file that is taken piece by piece, for as long as its pieces come.
    Pieces,
    /// gRPC messages, each after a prefix with its length, for as long as the caller likes.
    Messages,
}

/// The bounds on bodies, shared by all routes of a server.
#[derive(Clone, Debug)]
pub(crate) struct Bodies {
    room: Arc<Semaphore>,
    limit_bytes: usize,
    timeout: Duration,
}

impl Bodies {
    pub(crate) fn new(limits: &Limits) -> Self {
        let limit_bytes = limits.body_bytes.min(Semaphore::MAX_PERMITS);
        Self { room: Arc::new(Semaphore::new(limit_bytes)), limit_bytes, timeout: limits.body_timeout }
    }

    /// Answers a request whose body is received within the bounds; `render` writes the refusal of one that is not.
    pub(crate) async fn run(
        self,
        request: Request,
        kind: Kind,
        next: Next,
        render: impl FnOnce(&Error) -> Response,
    ) -> Response {
        if request.body().is_end_stream() {
            return next.run(request).await;
        }
        let version = request.version();
        let held = Arc::new(Mutex::new(Held::default()));
        let response = next.run(request.map(|body| self.watched(body, kind, held.clone()))).await;
        let Some(refusal) = lock(&held).refusal.take() else {
            return response;
        };
        tracing::info!(error = %refusal, "refused");
        closing(version, render(&refusal))
    }

    fn watched(self, body: Body, kind: Kind, held: Arc<Mutex<Held>>) -> Body {
        let (limit, framing) = match kind {
            Kind::Whole(deadline) => (deadline.map_or(self.timeout, |wish| wish.min(self.timeout)), None),
            Kind::Pieces => (Duration::MAX, None),
            Kind::Messages => (Duration::MAX, Some(Framing::default())),
        };
        let is_whole = matches!(kind, Kind::Whole(_));
        let timer = is_whole.then(|| Box::pin(sleep(limit)));
        Body::new(Watched { body, bodies: self, held, limit, timer, framing, is_whole })
    }
}

/// The answer to a request of which nobody reads the body, if it has one.
pub(crate) fn unread(request: &Parts, response: Response) -> Response {
    let headers = &request.headers;
    let is_sized = headers.get(CONTENT_LENGTH).is_some_and(|length| length != "0");
    if is_sized || headers.contains_key(TRANSFER_ENCODING) {
        return closing(request.version, response);
    }
    response
}

/// The answer, after which the connection ends where it carries one request after the other: what is left of a body would
/// be in the way of the next, which its caller is not to send.
fn closing(version: Version, mut response: Response) -> Response {
    if version < Version::HTTP_2 {
        response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

/// What a request holds of the room for all bodies, and why it was refused, if it was.
#[derive(Debug, Default)]
struct Held {
    permit: Option<OwnedSemaphorePermit>,
    refusal: Option<Error>,
}

fn lock(held: &Mutex<Held>) -> MutexGuard<'_, Held> {
    held.lock().unwrap_or_else(PoisonError::into_inner)
}

#[derive(Debug)]
struct Watched {
    body: Body,
    bodies: Bodies,
    held: Arc<Mutex<Held>>,
    limit: Duration,
    timer: Option<Pin<Box<Sleep>>>,
    framing: Option<Framing>,
    /// All of it is held until the request is answered.
    is_whole: bool,
}

impl Watched {
    /// Takes room for what has arrived.
    fn take(&mut self, data: &Bytes) -> Result<(), Error> {
        let overloaded = Error::Overloaded { limit: self.bodies.limit_bytes };
        let count = u32::try_from(data.len()).map_err(|_| overloaded.clone())?;
        let taken = self.bodies.room.clone().try_acquire_many_owned(count).map_err(|_| overloaded)?;
        let mut held = lock(&self.held);
        match &mut held.permit {
            Some(permit) => permit.merge(taken),
            none => *none = Some(taken),
        }
        if let Some(framing) = &mut self.framing {
            framing.advance(data);
        }
        Ok(())
    }

    /// Gives back the room of messages or pieces that were read: whoever asks for more has taken what was complete.
    fn release_read(&mut self) {
        if self.is_whole {
            return;
        }
        let open = self.framing.as_ref().map_or(0, |framing| framing.open);
        if let Some(permit) = &mut lock(&self.held).permit {
            drop(permit.split(permit.num_permits().saturating_sub(open)));
        }
    }

    fn refuse(&self, refusal: Error) -> Poll<Option<Result<Frame<Bytes>, Error>>> {
        let mut held = lock(&self.held);
        held.permit = None;
        held.refusal = Some(refusal.clone());
        Poll::Ready(Some(Err(refusal)))
    }
}

impl HttpBody for Watched {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let this = self.get_mut();
        this.release_read();
        let Poll::Ready(frame) = Pin::new(&mut this.body).poll_frame(context) else {
            let Some(timer) = &mut this.timer else { return Poll::Pending };
            if timer.as_mut().poll(context).is_pending() {
                return Poll::Pending;
            }
            return this.refuse(Error::BodyTooSlow { limit: this.limit }).map_err(axum::Error::new);
        };
        if let Some(Ok(frame)) = &frame
            && let Some(data) = frame.data_ref()
            && let Err(refusal) = this.take(data)
        {
            return this.refuse(refusal).map_err(axum::Error::new);
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// Where the messages of a stream end: each comes after a byte of flags and four of its length.
#[derive(Debug, Default)]
struct Framing {
    prefix: Vec<u8>,
    left: usize,
    /// Bytes since the last message ended.
    open: usize,
}

impl Framing {
    fn advance(&mut self, mut data: &[u8]) {
        while let Some((&byte, rest)) = data.split_first() {
            if self.left == 0 {
                self.prefix.push(byte);
                self.open += 1;
                data = rest;
                let [_, a, b, c, d] = self.prefix[..] else { continue };
                self.prefix.clear();
                self.left = u32::from_be_bytes([a, b, c, d]) as usize;
            } else {
                let (message, rest) = data.split_at(self.left.min(data.len()));
                self.left -= message.len();
                self.open += message.len();
                data = rest;
            }
            if self.left == 0 && self.prefix.is_empty() {
                self.open = 0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_counts_by_the_message_that_is_arriving() {
        let mut framing = Framing::default();
        let message = [&[0, 0, 0, 0, 3][..], b"abc"].concat();
        let mut stream = message.repeat(2);
        stream.extend([0, 0, 0, 0, 0]);
        stream.extend([0, 0, 0]);
        for cut in 0..stream.len() {
            let mut pieces = Framing::default();
            pieces.advance(&stream[..cut]);
            let arriving = if cut < 16 {
                cut % 8
            } else if cut < 21 {
                cut - 16
            } else {
                cut - 21
            };
            assert_eq!(pieces.open, arriving, "after {cut} bytes");
            pieces.advance(&stream[cut..]);
            assert_eq!(pieces.open, 3, "cut at {cut}");
        }
        framing.advance(&stream);
        assert_eq!((framing.open, framing.left), (3, 0));
    }
}
