//! Where the method runs: off the async executor, on as many threads as there are cores.
//!
//! Robots and readers stand in queues of their own, each with a bound, and in each a session has a
//! bound too. Readers have at most half of the threads, so nobody who looks at the past keeps a robot
//! waiting. A full queue refuses at once and says when to try again, or lets a stream wait for room;
//! work whose deadline has passed is dropped before it costs anything, and a panic ends one job only.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use tokio::sync::{AcquireError, OwnedSemaphorePermit, Semaphore};
use tokio::time::Instant;

use crate::error::Error;
use crate::limits::Limits;

/// What a typical job takes; only the advice on when to try again rests on it.
const TYPICAL_JOB: Duration = Duration::from_millis(15);

/// Whose work a job is, and what happens when too much of it waits already.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Queue {
    is_reading: bool,
    waits_for_room: bool,
}

impl Queue {
    /// What moves a robot on: contacts, views, proposals.
    pub(crate) const ROBOTS: Self = Self { is_reading: false, waits_for_room: false };
    /// The same on a stream, which is not worth less because it is busy.
    pub(crate) const EXPLORERS: Self = Self { is_reading: false, waits_for_room: true };
    /// What somebody wants to look at: meshes, earlier revisions.
    pub(crate) const READERS: Self = Self { is_reading: true, waits_for_room: false };
    /// The same on a stream.
    pub(crate) const WATCHERS: Self = Self { is_reading: true, waits_for_room: true };

    /// The same queue, where a job waits for room.
    pub(crate) fn patient(self) -> Self {
        Self { waits_for_room: true, ..self }
    }

    /// Whether a job waits for room.
    pub(crate) fn is_patient(self) -> bool {
        self.waits_for_room
    }

    /// Whether it is one of the robots' queues.
    pub(crate) fn is_of_robots(self) -> bool {
        !self.is_reading
    }
}

/// A bounded pool for computation.
#[derive(Debug)]
pub(crate) struct Pool {
    robots: Line,
    readers: Line,
    /// Bounds how many jobs run; handed out in the order of arrival.
    threads: Arc<Semaphore>,
}

impl Pool {
    /// A pool of `threads`, with queues as long as `limits` has them.
    pub(crate) fn new(threads: usize, limits: &Limits) -> Self {
        let (robots, readers) = (limits.compute_queue_per_core, limits.reader_queue_per_core);
        let half = threads.div_ceil(2);
        Self {
            robots: Line::new(threads * (1 + robots), threads, limits.compute_queue_per_session, ROBOT_NAMES),
            readers: Line::new(half + threads * readers, half, limits.reader_queue_per_session, READER_NAMES),
            threads: Arc::new(Semaphore::new(threads)),
        }
    }

    /// Runs `job`, which is about this session, to its end, even if the caller stops waiting for it.
    ///
    /// # Errors
    /// The queue is full, the deadline passed before the job began, or the job panicked.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        queue: Queue,
        session_id: &str,
        deadline: Instant,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Error> {
        let line = if queue.is_reading { &self.readers } else { &self.robots };
        let places = line.enter(session_id, queue.waits_for_room, deadline).await?;
        // First the line's own threads, so that a reader who has to wait for one keeps none from a robot.
        let turn = in_time(deadline, line.threads.clone().acquire_owned()).await?;
        let thread = in_time(deadline, self.threads.clone().acquire_owned()).await?;
        if Instant::now() >= deadline {
            return Err(Error::DeadlineExceeded);
        }
        let running = tokio::task::spawn_blocking(move || {
            // The permits live as long as the job, also when the caller stops waiting.
            let _held = (places, turn, thread);
            job()
        });
        running.await.map_err(|failure| Error::internal(format!("a computation failed: {failure}")))
    }
}

/// What refusals call a line, and the part of it that one session may have.
type Names = [&'static str; 2];
const ROBOT_NAMES: Names = ["compute", "session's compute"];
const READER_NAMES: Names = ["reader", "session's reader"];

/// One of the two queues.
#[derive(Debug)]
struct Line {
    /// Bounds how many jobs run or wait.
    slots: Arc<Semaphore>,
    /// Bounds how many run.
    threads: Arc<Semaphore>,
    /// The same bound as `slots` has, for each session that has jobs here.
    of_sessions: Mutex<HashMap<String, Weak<Semaphore>>>,
    per_session: usize,
    retry_after: Duration,
    names: Names,
}

impl Line {
    fn new(slots: usize, threads: usize, per_session: usize, names: Names) -> Self {
        let waiting = u32::try_from((slots / threads).max(1)).unwrap_or(u32::MAX);
        Self {
            slots: Arc::new(Semaphore::new(slots)),
            threads: Arc::new(Semaphore::new(threads)),
            of_sessions: Mutex::default(),
            per_session,
            retry_after: TYPICAL_JOB * waiting,
            names,
        }
    }

    /// A place for one job: of its session first, so that those who wait there take no place from others.
    async fn enter(
        &self,
        session_id: &str,
        waits: bool,
        deadline: Instant,
    ) -> Result<[OwnedSemaphorePermit; 2], Error> {
        let [whole, part] = self.names;
        let of_session = self.place(self.of_session(session_id), part, waits, deadline).await?;
        let slot = self.place(self.slots.clone(), whole, waits, deadline).await?;
        Ok([of_session, slot])
    }

    async fn place(
        &self,
        places: Arc<Semaphore>,
        queue: &'static str,
        waits: bool,
        deadline: Instant,
    ) -> Result<OwnedSemaphorePermit, Error> {
        if waits {
            return in_time(deadline, places.acquire_owned()).await;
        }
        let full = |_| Error::QueueFull { queue, retry_after: self.retry_after };
        places.try_acquire_owned().map_err(full)
    }

    /// The places of this session, which are forgotten when nobody has one or waits for one.
    fn of_session(&self, session_id: &str) -> Arc<Semaphore> {
        let mut by_id = self.of_sessions.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(places) = by_id.get(session_id).and_then(Weak::upgrade) {
            return places;
        }
        by_id.retain(|_, places| places.strong_count() > 0);
        let places = Arc::new(Semaphore::new(self.per_session));
        by_id.insert(session_id.to_owned(), Arc::downgrade(&places));
        places
    }
}

async fn in_time(
    deadline: Instant,
    permit: impl Future<Output = Result<OwnedSemaphorePermit, AcquireError>>,
) -> Result<OwnedSemaphorePermit, Error> {
    let permit = tokio::time::timeout_at(deadline, permit).await;
    permit.map_err(|_elapsed| Error::DeadlineExceeded)?.map_err(|_closed| Error::Draining)
}

#[cfg(test)]
mod tests;
