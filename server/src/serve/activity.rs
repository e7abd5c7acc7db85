//! What a connection is busy with: requests whose answers, streams included, are not over.

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::{Body, Bytes};
use hyper::body::{Body as HttpBody, Frame, SizeHint};
use tokio::time::{Instant, sleep_until};

/// Counts the open requests of one connection.
#[derive(Clone, Debug)]
pub(super) struct Activity(Arc<Mutex<State>>);

#[derive(Debug)]
struct State {
    open: usize,
    quiet_since: Instant,
}

impl Activity {
    pub(super) fn new() -> Self {
        Self(Arc::new(Mutex::new(State { open: 0, quiet_since: Instant::now() })))
    }

    /// A request that is open until what is returned is dropped.
    pub(super) fn begin(&self) -> Open {
        self.lock().open += 1;
        Open(self.clone())
    }

    /// Waits until no request has been open for this long.
    pub(super) async fn quiet_for(&self, time: Duration) {
        loop {
            let now = Instant::now();
            let until = {
                let state = self.lock();
                if state.open == 0 { state.quiet_since + time } else { now + time }
            };
            if until <= now {
                return;
            }
            sleep_until(until).await;
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An open request.
#[derive(Debug)]
pub(super) struct Open(Activity);

impl Open {
    /// The same body, with which the request ends.
    pub(super) fn until_sent(self, body: Body) -> Body {
        Body::new(Sent { body, _open: self })
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        let mut state = self.0.lock();
        state.open -= 1;
        state.quiet_since = Instant::now();
    }
}

#[derive(Debug)]
struct Sent {
    body: Body,
    _open: Open,
}

impl HttpBody for Sent {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.get_mut().body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn an_open_request_is_no_idleness_and_the_time_begins_when_it_ends() {
        let (activity, began) = (Activity::new(), Instant::now());
        let limit = Duration::from_millis(40);
        let request = activity.begin();
        let ends = async {
            tokio::time::sleep(Duration::from_millis(100)).await;
            drop(request);
        };
        tokio::join!(activity.quiet_for(limit), ends);
        assert!(began.elapsed() >= Duration::from_millis(140));
    }
}
