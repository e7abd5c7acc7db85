//! Where the method runs: off the async executor, on as many threads as there are cores.
//!
//! The queue is bounded and fair. A full queue refuses at once and says when to try again, work
//! whose deadline has passed is dropped before it costs anything, and a panic ends one job only.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Semaphore;
use tokio::time::Instant;

use crate::error::Error;

/// What a typical job takes; only the advice on when to try again rests on it.
const TYPICAL_JOB: Duration = Duration::from_millis(15);

/// A bounded pool for computation.
#[derive(Debug)]
pub(crate) struct Pool {
    /// Bounds how many jobs run or wait.
    slots: Arc<Semaphore>,
    /// Bounds how many jobs run; handed out in the order of arrival.
    threads: Arc<Semaphore>,
    retry_after: Duration,
}

impl Pool {
    /// A pool of `threads` that lets `queue_per_thread` further jobs wait for each of them.
    pub(crate) fn new(threads: usize, queue_per_thread: usize) -> Self {
        let retry_after = TYPICAL_JOB * u32::try_from(queue_per_thread.max(1)).unwrap_or(u32::MAX);
        Self {
            slots: Arc::new(Semaphore::new(threads * (1 + queue_per_thread))),
            threads: Arc::new(Semaphore::new(threads)),
            retry_after,
        }
    }

    /// Runs `job` to its end, even if the caller stops waiting for it.
    ///
    /// # Errors
    /// The queue is full, the deadline passed before the job began, or the job panicked.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        deadline: Instant,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Error> {
        let Ok(slot) = self.slots.clone().try_acquire_owned() else {
            return Err(Error::QueueFull { queue: "compute", retry_after: self.retry_after });
        };
        let waiting = tokio::time::timeout_at(deadline, self.threads.clone().acquire_owned());
        let thread =
            waiting.await.map_err(|_elapsed| Error::DeadlineExceeded)?.map_err(|_closed| Error::Draining)?;
        if Instant::now() >= deadline {
            return Err(Error::DeadlineExceeded);
        }
        let running = tokio::task::spawn_blocking(move || {
            // The permits live as long as the job, also when the caller stops waiting.
            let _held = (slot, thread);
            job()
        });
        running.await.map_err(|failure| Error::internal(format!("a computation failed: {failure}")))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    fn soon() -> Instant {
        Instant::now() + Duration::from_secs(20)
    }

    #[tokio::test]
    async fn a_full_queue_refuses_at_once_and_says_when_to_try_again() {
        let pool = Arc::new(Pool::new(1, 1));
        let (release, held) = mpsc::channel::<()>();
        let running = tokio::spawn({
            let pool = pool.clone();
            async move { pool.run(soon(), move || held.recv().is_ok()).await }
        });
        while pool.threads.available_permits() > 0 {
            tokio::task::yield_now().await;
        }
        let waiting = tokio::spawn({
            let pool = pool.clone();
            async move { pool.run(soon(), || 7).await }
        });
        while pool.slots.available_permits() > 0 {
            tokio::task::yield_now().await;
        }
        let refused = pool.run(soon(), || 8).await.unwrap_err();
        assert_eq!(refused.reason(), "QUEUE_FULL");
        assert!(refused.retry_after().is_some_and(|after| after > Duration::ZERO));
        release.send(()).unwrap();
        assert_eq!(running.await.unwrap(), Ok(true));
        assert_eq!(waiting.await.unwrap(), Ok(7));
    }

    #[tokio::test]
    async fn a_panic_ends_one_job_and_leaves_the_pool_usable() {
        let pool = Pool::new(1, 1);
        let failed = pool.run(soon(), || assert_eq!(1, 2, "on purpose")).await.unwrap_err();
        assert_eq!(failed.reason(), "INTERNAL");
        assert_eq!(pool.run(soon(), || 5).await, Ok(5));
    }

    #[tokio::test]
    async fn a_job_whose_deadline_has_passed_never_runs() {
        let pool = Pool::new(1, 1);
        let (ran, observed) = mpsc::channel();
        let late = pool.run(Instant::now(), move || ran.send(())).await;
        assert_eq!(late.unwrap_err(), Error::DeadlineExceeded);
        assert!(observed.recv().is_err(), "the job was dropped, and its channel with it");
    }
}
