//! When a call is tried again, and after which wait.
//!
//! A call is sent again only if the server may accept it later without any change (see [`Error::is_transient`]), and
//! only with the `request_id` of its first attempt. Waits double from one attempt to the next; if the server asks for
//! a longer wait it gets it, and if it asks for more than the policy allows the caller gets the refusal to decide.

use std::future::Future;
use std::time::Duration;

use tokio::time::sleep;
use uuid::Uuid;

use crate::Error;

/// How often and how patiently a call is tried again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RetryPolicy {
    /// How often a call is tried in all, the first time included; 0 means once, as 1 does.
    pub max_attempts: u32,
    /// Wait before the second attempt; it doubles with each further one.
    pub first_wait: Duration,
    /// The longest wait before an attempt. A server that asks for more is not asked again.
    pub longest_wait: Duration,
}

impl Default for RetryPolicy {
    /// Five attempts with waits of 0.1, 0.2, 0.4 and 0.8 s, at most 5 s if the server asks for more.
    fn default() -> Self {
        Self { max_attempts: 5, first_wait: Duration::from_millis(100), longest_wait: Duration::from_secs(5) }
    }
}

impl RetryPolicy {
    /// How long to wait before the next attempt after `attempts` failed ones, or `None` to give up.
    fn wait_after(&self, error: &Error, attempts: u32) -> Option<Duration> {
        if attempts >= self.max_attempts || !error.is_transient() {
            return None;
        }
        let doublings = attempts.saturating_sub(1).min(31);
        let backoff = self.first_wait.saturating_mul(1 << doublings);
        let asked_for = error.refusal().and_then(|refusal| refusal.retry_after);
        let asked_for = asked_for.unwrap_or_default();
        (asked_for <= self.longest_wait).then(|| backoff.min(self.longest_wait).max(asked_for))
    }

    /// Waits before the next attempt after `attempts` failed ones, or gives the error back when there is to be none.
    pub(crate) async fn pause(&self, error: Error, attempts: u32) -> Result<(), Error> {
        match self.wait_after(&error, attempts) {
            Some(wait) => {
                sleep(wait).await;
                Ok(())
            }
            None => Err(error),
        }
    }

    /// Runs `attempt` with its number, from 1, until it succeeds or is not to be tried again.
    pub(crate) async fn run<T, F>(&self, attempt: impl Fn(u32) -> F) -> Result<T, Error>
    where
        F: Future<Output = Result<T, Error>>,
    {
        let mut attempts = 1;
        loop {
            match attempt(attempts).await {
                Ok(value) => return Ok(value),
                Err(error) => self.pause(error, attempts).await?,
            }
            attempts += 1;
        }
    }
}

/// Gives a mutating request its `request_id`, once for all attempts, unless the caller chose one.
pub(crate) fn ensure_request_id(request_id: &mut String) {
    if request_id.is_empty() {
        *request_id = Uuid::now_v7().to_string();
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tonic::{Code, Status};
    use tonic_types::{ErrorDetails, StatusExt};

    use super::RetryPolicy;
    use crate::Error;

    fn refused(code: Code, details: ErrorDetails) -> Error {
        Error::from_status(&Status::with_error_details(code, "no", details), 1)
    }

    fn wait_after(error: &Error, attempts: u32) -> Option<Duration> {
        RetryPolicy::default().wait_after(error, attempts)
    }

    #[test]
    fn waits_double_up_to_the_longest_and_end_with_the_last_attempt() {
        let unavailable = refused(Code::Unavailable, ErrorDetails::new());
        let policy = RetryPolicy { longest_wait: Duration::from_millis(300), ..RetryPolicy::default() };
        let waits: Vec<_> = (1..=5).map(|attempts| policy.wait_after(&unavailable, attempts)).collect();
        let expected = [Some(100), Some(200), Some(300), Some(300), None];
        assert_eq!(waits, expected.map(|ms| ms.map(Duration::from_millis)));
    }

    #[test]
    fn a_wait_that_the_server_asks_for_is_kept_unless_it_is_too_long() {
        let busy = |wait| {
            let details = ErrorDetails::with_retry_info(Some(Duration::from_millis(wait)));
            refused(Code::ResourceExhausted, details)
        };
        let asked = wait_after(&busy(1500), 1);
        assert_eq!(asked, Some(Duration::from_millis(1500)));
        assert_eq!(wait_after(&busy(3), 1), Some(Duration::from_millis(100)));
        assert_eq!(wait_after(&busy(60_000), 1), None);
    }

    #[test]
    fn only_what_may_pass_by_itself_is_tried_again() {
        let plain = |code| wait_after(&refused(code, ErrorDetails::new()), 1).is_some();
        assert!(plain(Code::Unavailable));
        assert!(plain(Code::DeadlineExceeded));
        assert!(plain(Code::Aborted));
        assert!(!plain(Code::ResourceExhausted));
        assert!(!plain(Code::InvalidArgument));
        assert!(!plain(Code::NotFound));
        assert!(!plain(Code::Internal));

        let mut details = ErrorDetails::new();
        details.set_error_info("REVISION_MISMATCH", "palpate.v1", []);
        assert_eq!(wait_after(&refused(Code::Aborted, details), 1), None);
    }
}
