//! Which job runs next, and which cannot run in time: decided from what jobs were measured to take, without a clock.
//!
//! ```text
//! enter ── nobody waits and a thread is free, or its end is expected before its deadline ──► waits ──► next ──► ended
//!   │                                                                                          │
//!   └── refused, and told when to come back ◄── too late by now, and others wait who are not ◄─┘
//! ```
//! Robots come before readers, who have a small part of the threads where robots would take all, and never more than
//! half. Among robots, and among readers, sessions take turns ([`super::shares`]).

use std::time::Duration;

use tokio::sync::oneshot;
use tokio::time::Instant;

use super::invitations::Invitations;
use super::measured::Measured;
use super::shares::{GUESSED_COST, Shares, Waiting};
use super::{Queue, Work};
use crate::access::Account;
use crate::error::Error;
use crate::limits::Limits;

/// Robots get this many times as much of the threads as readers, where both wait.
const ROBOTS_TO_READERS: f64 = 8.0;

/// What readers may have had beyond that while no robot waited, in seconds: it is not held against them for long.
const MOST_AHEAD_S: f64 = 0.1;

/// The queues and threads of one pool; `C` is what a caller is told when its turn has come.
#[derive(Debug)]
pub(super) struct Schedule<C> {
    robots: Line<C>,
    readers: Line<C>,
    threads: usize,
    /// What readers are owed, in seconds of a thread; negative where they have had more.
    owed_to_readers_s: f64,
    costs: [Cost; Work::KINDS],
    jobs: u64,
}

/// What a kind of work costs.
#[derive(Clone, Copy, Debug)]
struct Cost {
    of_thread: Measured,
    /// What comes after it before the caller has its answer, such as the commit.
    afterwards: Measured,
}

impl Cost {
    fn until_answered_s(&self) -> f64 {
        self.of_thread.cautious_s() + self.afterwards.cautious_s()
    }
}

/// One of the two queues.
#[derive(Debug)]
struct Line<C> {
    name: &'static str,
    shares: Shares<C>,
    running: Vec<Running>,
    invitations: Invitations,
    /// Threads that its jobs may have at once.
    threads: usize,
    most: usize,
    most_of_session: usize,
}

#[derive(Debug)]
struct Running {
    job: u64,
    ends: Instant,
}

/// What is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted<'a> {
    pub(super) queue: Queue,
    pub(super) work: Work,
    pub(super) session_id: &'a str,
    pub(super) account: &'a Account,
    pub(super) deadline: Instant,
}

/// What becomes of the job whose turn it is.
#[derive(Debug)]
pub(super) enum Next<C> {
    /// It begins.
    Start(oneshot::Sender<C>, Started),
    /// It would end too late.
    Late(oneshot::Sender<C>, Error),
}

/// A job that has a thread, until it is given back with [`Schedule::ended`].
#[derive(Debug)]
pub(super) struct Started {
    is_reading: bool,
    work: Work,
    session_id: String,
    job: u64,
    /// What it was expected to take, in seconds.
    cost_s: f64,
    since: Instant,
}

impl<C> Schedule<C> {
    pub(super) fn new(threads: usize, limits: &Limits) -> Self {
        let line = |name, threads, most| Line {
            name,
            shares: Shares::new(),
            running: Vec::new(),
            invitations: Invitations::default(),
            threads,
            most,
            most_of_session: limits.session_queue,
        };
        let cost = Cost {
            of_thread: Measured::guessed(GUESSED_COST),
            afterwards: Measured::guessed(Duration::ZERO),
        };
        Self {
            robots: line("compute", threads, limits.compute_queue),
            readers: line("reader", threads.div_ceil(2), limits.reader_queue),
            threads,
            owed_to_readers_s: 0.0,
            costs: [cost; Work::KINDS],
            jobs: 0,
        }
    }

    /// Puts a job into its queue: what is received is sent to when its turn has come.
    ///
    /// # Errors
    /// The deadline has passed or cannot be met, or too many wait.
    pub(super) fn enter(&mut self, now: Instant, wanted: Wanted<'_>) -> Result<oneshot::Receiver<C>, Error> {
        let Wanted { queue, work, session_id, account, deadline } = wanted;
        if now >= deadline {
            return Err(Error::DeadlineExceeded);
        }
        if !queue.is_patient() && !self.is_free_for(queue) {
            self.check_room(now, wanted)?;
            let answered_s =
                self.wait_s(now, queue, session_id, account) + self.cost(work).until_answered_s();
            if now + seconds(answered_s) > deadline {
                return Err(self.refuse(now, wanted, answered_s));
            }
        }
        let (caller, turn) = oneshot::channel();
        let cost_s = self.cost(work).of_thread.mean_s();
        let waiting = Waiting { caller, work, deadline, cost_s };
        self.line_mut(queue).shares.enter(session_id, account, waiting, now);
        Ok(turn)
    }

    /// The job whose turn it is, where a thread is free for one.
    pub(super) fn next(&mut self, now: Instant) -> Option<Next<C>> {
        self.robots.shares.sweep(now);
        self.readers.shares.sweep(now);
        let queue = self.turn()?;
        let line = self.line_mut(queue);
        let (session_id, account, Waiting { caller, work, deadline, cost_s }) = line.shares.pop()?;
        let is_alone = line.shares.is_empty();
        let answered_s = self.cost(work).until_answered_s();
        if now >= deadline {
            return Some(Next::Late(caller, Error::DeadlineExceeded));
        }
        // Where nobody else wants the thread it is tried: the estimate may be wrong.
        if now + seconds(answered_s) > deadline && !is_alone {
            let wanted = Wanted { queue, work, session_id: &session_id, account: &account, deadline };
            let refusal = self.refuse(now, wanted, answered_s);
            return Some(Next::Late(caller, refusal));
        }
        self.jobs += 1;
        let job = self.jobs;
        let line = self.line_mut(queue);
        line.shares.started(&session_id, cost_s);
        line.running.push(Running { job, ends: now + seconds(cost_s) });
        self.owe_readers(queue, cost_s);
        let is_reading = !queue.is_of_robots();
        Some(Next::Start(caller, Started { is_reading, work, session_id, job, cost_s, since: now }))
    }

    /// Gives a thread back; `ran` says whether the job was begun at all.
    pub(super) fn ended(&mut self, now: Instant, started: &Started, ran: bool) {
        let took = now.saturating_duration_since(started.since);
        if ran {
            self.costs[started.work as usize].of_thread.add(took);
        }
        let queue = if started.is_reading { Queue::READERS } else { Queue::ROBOTS };
        let line = self.line_mut(queue);
        line.running.retain(|running| running.job != started.job);
        line.shares.ended(&started.session_id, started.cost_s, took, now);
    }

    /// Notes how long after a job of this kind its caller was answered.
    pub(super) fn answered(&mut self, work: Work, after: Duration) {
        self.costs[work as usize].afterwards.add(after);
    }

    /// How many jobs of this queue wait, and how many run.
    pub(super) fn load(&self, queue: Queue) -> (usize, usize) {
        let line = self.lines(queue).0;
        (line.shares.len(), line.running.len())
    }

    /// Whose turn it is; nobody's where there is no thread for those who wait.
    fn turn(&self) -> Option<Queue> {
        let robot_waits = !self.robots.shares.is_empty() && self.has_thread(Queue::ROBOTS);
        let reader_waits = !self.readers.shares.is_empty() && self.has_thread(Queue::READERS);
        match (robot_waits, reader_waits) {
            (false, false) => None,
            (true, false) => Some(Queue::ROBOTS),
            (false, true) => Some(Queue::READERS),
            (true, true) if self.owed_to_readers_s > 0.0 => Some(Queue::READERS),
            (true, true) => Some(Queue::ROBOTS),
        }
    }

    fn owe_readers(&mut self, served: Queue, cost_s: f64) {
        if !served.is_of_robots() {
            self.owed_to_readers_s = (self.owed_to_readers_s - cost_s).max(-MOST_AHEAD_S.max(cost_s));
        } else if self.readers.shares.is_empty() {
            self.owed_to_readers_s = self.owed_to_readers_s.min(0.0);
        } else if self.readers.running.len() < self.readers.threads {
            self.owed_to_readers_s += cost_s / ROBOTS_TO_READERS;
        }
    }

    fn has_thread(&self, queue: Queue) -> bool {
        let (line, other) = self.lines(queue);
        line.running.len() < line.threads && line.running.len() + other.running.len() < self.threads
    }

    /// Whether a job would begin at once.
    fn is_free_for(&self, queue: Queue) -> bool {
        self.lines(queue).0.shares.is_empty() && self.has_thread(queue)
    }

    /// How long a job of this session is expected to wait, in seconds.
    fn wait_s(&self, now: Instant, queue: Queue, session_id: &str, account: &Account) -> f64 {
        let (line, other) = self.lines(queue);
        let ahead_s = line.shares.ahead_s(session_id, account, now);
        let own_s = (ahead_s + line.running_s(now)) / line.threads as f64;
        if queue.is_of_robots() {
            return own_s + other.running_s(now) / self.threads as f64;
        }
        let robots_s = (other.shares.waiting_s() + other.running_s(now)) / self.threads as f64;
        // However many robots wait, readers have their part.
        (own_s + robots_s).min(ahead_s * (1.0 + ROBOTS_TO_READERS) / self.threads as f64 + own_s)
    }

    fn check_room(&mut self, now: Instant, wanted: Wanted<'_>) -> Result<(), Error> {
        let line = self.line_mut(wanted.queue);
        if line.shares.len() < line.most && line.shares.len_of(wanted.session_id) < line.most_of_session {
            return Ok(());
        }
        let name = line.name;
        let (_, retry_after) = self.invite(now, wanted, now);
        Err(Error::QueueFull { queue: name, retry_after })
    }

    /// The refusal of a call that would be answered this many seconds from now.
    fn refuse(&mut self, now: Instant, wanted: Wanted<'_>, answered_s: f64) -> Error {
        let answered = seconds(answered_s);
        let late = (now + answered).saturating_duration_since(wanted.deadline);
        let (queue, retry_after) = self.invite(now, wanted, now + late);
        Error::Busy { queue, answered, retry_after }
    }

    /// Keeps a place for a session that is refused, and says when it should come back.
    fn invite(&mut self, now: Instant, wanted: Wanted<'_>, earliest: Instant) -> (&'static str, Duration) {
        let Wanted { queue, work, session_id, account, deadline: _ } = wanted;
        let apart = seconds(self.cost(work).of_thread.mean_s() / self.lines(queue).0.threads as f64);
        let line = self.line_mut(queue);
        // One place for each session, however many of its calls are refused.
        let place = line.shares.invited(session_id, now).unwrap_or_else(|| {
            let place = line.invitations.next(earliest, apart);
            line.shares.invite(session_id, account, place);
            place
        });
        (line.name, line.invitations.hint(now, place))
    }

    fn cost(&self, work: Work) -> &Cost {
        &self.costs[work as usize]
    }

    fn lines(&self, queue: Queue) -> (&Line<C>, &Line<C>) {
        if queue.is_of_robots() { (&self.robots, &self.readers) } else { (&self.readers, &self.robots) }
    }

    fn line_mut(&mut self, queue: Queue) -> &mut Line<C> {
        if queue.is_of_robots() { &mut self.robots } else { &mut self.readers }
    }
}

impl<C> Line<C> {
    /// What its running jobs are expected to take from now on, in seconds.
    fn running_s(&self, now: Instant) -> f64 {
        self.running.iter().map(|job| job.ends.saturating_duration_since(now).as_secs_f64()).sum()
    }
}

/// Seconds that are no more than anybody waits.
fn seconds(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds.clamp(0.0, 1e6))
}

#[cfg(test)]
mod tests;
