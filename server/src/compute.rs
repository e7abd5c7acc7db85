//! Where the method runs: off the async executor, on as many threads as there are cores.
//!
//! A job waits as long as its deadline allows, and is refused at once only where what waits before it is known, by
//! measured cost, to take longer; so is one whose deadline can no longer be met, before it costs anything. Sessions
//! take turns, robots before readers. What is decided about that is in [`schedule`]; here it is carried out.
//! A panic ends one job only.

mod invitations;
mod measured;
mod schedule;
mod shares;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::time::Instant;
use tracing::Instrument;

use crate::access::Account;
use crate::error::Error;
use crate::limits::Limits;
use crate::metrics::Metrics;
pub(crate) use invitations::Invitations;
pub(crate) use measured::Measured;
use schedule::{Next, Schedule, Started, Wanted};

/// Whose work a job is, and whether it may be refused before its deadline.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Queue {
    is_reading: bool,
    is_patient: bool,
}

impl Queue {
    /// What moves a robot on: contacts, views, proposals.
    pub(crate) const ROBOTS: Self = Self { is_reading: false, is_patient: false };
    /// The same on a stream, which is not worth less because it is busy.
    pub(crate) const EXPLORERS: Self = Self { is_reading: false, is_patient: true };
    /// What somebody wants to look at: meshes, earlier revisions.
    pub(crate) const READERS: Self = Self { is_reading: true, is_patient: false };
    /// The same on a stream.
    pub(crate) const WATCHERS: Self = Self { is_reading: true, is_patient: true };

    /// The same queue, for a job that is never refused when it comes.
    pub(crate) fn patient(self) -> Self {
        Self { is_patient: true, ..self }
    }

    /// Whether a job is never refused when it comes.
    pub(crate) fn is_patient(self) -> bool {
        self.is_patient
    }

    /// Whether it is one of the robots' queues.
    pub(crate) fn is_of_robots(self) -> bool {
        !self.is_reading
    }
}

tokio::task_local! {
    /// On whose account jobs go that are asked for now.
    static ACCOUNT: Account;
}

/// Does work whose jobs go on this account; whatever it spawns has to say so again.
pub(crate) fn on_account<T>(account: Account, work: impl Future<Output = T>) -> impl Future<Output = T> {
    ACCOUNT.scope(account, work)
}

/// On whose account jobs go here; nobody's, where nobody calls.
pub(crate) fn account() -> Account {
    ACCOUNT.try_with(Account::clone).unwrap_or_default()
}

/// What a job does: each kind is measured for itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    /// Takes in what became of an approach.
    Contact,
    /// Takes in a view.
    View,
    /// Changes what does not touch the surface: names, labels, leases, the end.
    Edit,
    /// Looks for the next candidates.
    Proposal,
    /// Folds a page of a log, or carries it over into another one.
    Fold,
    /// Makes a mesh in one of its forms.
    Mesh,
    /// Compares a surface with a true one.
    Comparison,
    /// Reads a file, or writes a part of one.
    File,
    /// Makes a table of a whole session.
    Table,
}

impl Work {
    const KINDS: usize = Self::Table as usize + 1;
}

/// A pool for computation.
#[derive(Clone, Debug)]
pub(crate) struct Pool {
    schedule: Arc<Mutex<Schedule<Result<Turn, Error>>>>,
    metrics: Metrics,
}

/// The right to use a thread; the next in line has it when this is dropped.
#[derive(Debug)]
struct Turn {
    pool: Pool,
    started: Started,
    has_begun: bool,
}

impl Pool {
    /// A pool of `threads`, with queues as long as `limits` has them.
    pub(crate) fn new(threads: usize, limits: &Limits, metrics: Metrics) -> Self {
        Self { schedule: Arc::new(Mutex::new(Schedule::new(threads, limits))), metrics }
    }

    /// How many computations of this queue wait, and how many have a thread.
    pub(crate) fn load(&self, queue: Queue) -> (usize, usize) {
        self.lock().load(queue)
    }

    /// Runs `job`, which is about this session, to its end, even if the caller stops waiting for it.
    ///
    /// # Errors
    /// The deadline cannot be met or passed before the job began, too many wait, or the job panicked.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        queue: Queue,
        work: Work,
        session_id: &str,
        deadline: Instant,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Error> {
        let account = &account();
        let asked = Instant::now();
        let wait = self.turn(Wanted { queue, work, session_id, account, deadline });
        let turn = wait.instrument(tracing::debug_span!("wait", ?work)).await?;
        self.metrics.waited(queue, work, asked.elapsed());
        let (metrics, span) = (self.metrics.clone(), tracing::debug_span!("compute", ?work));
        let running = tokio::task::spawn_blocking(move || {
            // The thread is the job's as long as it runs, also when the caller stops waiting.
            let _turn = turn.begin();
            let begun = Instant::now();
            let done = span.in_scope(job);
            metrics.computed(work, begun.elapsed());
            done
        });
        running.await.map_err(|failure| Error::internal(format!("a computation failed: {failure}")))
    }

    /// Notes how long after a job of this kind its caller was answered: later ones then begin in time for that.
    pub(crate) fn answered(&self, work: Work, after: Duration) {
        self.lock().answered(work, after);
    }

    async fn turn(&self, wanted: Wanted<'_>) -> Result<Turn, Error> {
        let turn = self.lock().enter(Instant::now(), wanted)?;
        self.hand_on();
        let turn = tokio::time::timeout_at(wanted.deadline, turn).await;
        turn.map_err(|_elapsed| Error::DeadlineExceeded)?.map_err(|_closed| Error::Draining)?
    }

    /// Gives free threads to those whose turn it is.
    fn hand_on(&self) {
        loop {
            let next = self.lock().next(Instant::now());
            // A caller who has gone meanwhile gives the thread back by dropping the turn, so nothing is locked here.
            match next {
                Some(Next::Start(caller, started)) => {
                    drop(caller.send(Ok(Turn { pool: self.clone(), started, has_begun: false })));
                }
                Some(Next::Late(caller, refusal)) => drop(caller.send(Err(refusal))),
                None => return,
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, Schedule<Result<Turn, Error>>> {
        // Nothing panics while it is held.
        self.schedule.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Turn {
    fn begin(mut self) -> Self {
        self.has_begun = true;
        self
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        self.pool.lock().ended(Instant::now(), &self.started, self.has_begun);
        self.pool.hand_on();
    }
}

#[cfg(test)]
mod tests;
