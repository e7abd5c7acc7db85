//! Fair turns: sessions take them one after the other, and within a session whoever came first has it.
//!
//! A turn is one job, and worth three times what a job takes on average: a session whose jobs take more owes the rest,
//! and lets others go first until it is made good (deficit round robin). Less is not counted, nor is a single job, so
//! that robots whose jobs take sometimes more and sometimes less keep their order, and wait for one round each.

use std::collections::{HashMap, VecDeque};
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::time::Instant;

use super::Work;
use super::measured::{INTO_MEAN, Measured};

/// How long it is remembered what the jobs of a session take, and that it was told to come back.
const KEPT: Duration = Duration::from_secs(30);

/// Average jobs in a turn.
const TURN: f64 = 3.0;

/// What a job is taken to cost until one was measured.
pub(super) const GUESSED_COST: Duration = Duration::from_millis(15);

/// A job that waits for its turn, and the caller who is told when it comes.
#[derive(Debug)]
pub(super) struct Waiting<C> {
    pub(super) caller: oneshot::Sender<C>,
    pub(super) work: Work,
    pub(super) deadline: Instant,
    /// What it is expected to take of a thread, in seconds.
    pub(super) cost_s: f64,
}

/// The jobs of one session.
#[derive(Debug)]
struct Share<C> {
    place: Place,
    waiting: VecDeque<Waiting<C>>,
    running: usize,
    /// What its jobs take on average, in seconds.
    job_s: f64,
    /// What they took beyond their turns, in seconds.
    owed_s: f64,
    last_ended: Option<Instant>,
    /// When it was told to come back, having been refused.
    invited: Option<Instant>,
}

/// Where a session stands in line: who was told to come now is before all others.
type Place = (bool, u64);

impl<C> Share<C> {
    fn new(job_s: f64) -> Self {
        let waiting = VecDeque::new();
        Self { place: (true, 0), waiting, running: 0, job_s, owed_s: 0.0, last_ended: None, invited: None }
    }

    /// Whether it was told to come at about this time.
    fn is_invited(&self, now: Instant) -> bool {
        self.invited.is_some_and(|at| at <= now && now < at + KEPT)
    }

    /// Whether anything has to be known of it.
    fn is_needed(&self, now: Instant) -> bool {
        let recently = |at: Option<Instant>| at.is_some_and(|at| now < at + KEPT);
        !self.waiting.is_empty()
            || self.running > 0
            || recently(self.last_ended)
            || recently(self.invited)
    }
}

/// The sessions that have jobs, had some just now, or were told to come back.
#[derive(Debug)]
pub(super) struct Shares<C> {
    by_session: HashMap<String, Share<C>>,
    /// The last place that was taken.
    last_place: u64,
    /// What a job takes, whatever it does.
    job: Measured,
}

impl<C> Shares<C> {
    pub(super) fn new() -> Self {
        Self { by_session: HashMap::new(), last_place: 0, job: Measured::guessed(GUESSED_COST) }
    }

    /// How many jobs wait.
    pub(super) fn len(&self) -> usize {
        self.by_session.values().map(|share| share.waiting.len()).sum()
    }

    /// How many jobs of this session wait.
    pub(super) fn len_of(&self, session_id: &str) -> usize {
        self.by_session.get(session_id).map_or(0, |share| share.waiting.len())
    }

    pub(super) fn is_empty(&self) -> bool {
        self.by_session.values().all(|share| share.waiting.is_empty())
    }

    /// What all that waits is expected to take, in seconds of a thread.
    pub(super) fn waiting_s(&self) -> f64 {
        self.by_session.values().flat_map(|share| &share.waiting).map(|job| job.cost_s).sum()
    }

    /// What a job of this session would have before it, in seconds of a thread.
    pub(super) fn ahead_s(&self, session_id: &str, now: Instant) -> f64 {
        let own = self.by_session.get(session_id);
        let turns = match own {
            Some(own) if own.waiting.is_empty() && own.is_invited(now) => 0,
            Some(own) => own.waiting.len() + 1 + (own.owed_s / self.turn_s()).ceil() as usize,
            None => 1,
        };
        let before = self.by_session.iter().flat_map(|(id, share)| {
            let count = if id == session_id { share.waiting.len() } else { turns };
            share.waiting.iter().take(count)
        });
        before.map(|job| job.cost_s).sum()
    }

    /// Puts a job behind those of its session.
    pub(super) fn enter(&mut self, session_id: &str, job: Waiting<C>, now: Instant) {
        let (place, job_s) = (self.next_place(), self.job.mean_s());
        let share = self.by_session.entry(session_id.to_owned()).or_insert_with(|| Share::new(job_s));
        let is_invited = share.is_invited(now);
        if share.waiting.is_empty() {
            share.place = (!is_invited, place);
        }
        if is_invited {
            share.invited = None;
            share.owed_s = 0.0;
        }
        share.waiting.push_back(job);
    }

    /// Forgets callers who have gone, and sessions of which nothing need be known.
    pub(super) fn sweep(&mut self, now: Instant) {
        self.by_session.retain(|_, share| {
            share.waiting.retain(|job| !job.caller.is_closed());
            share.is_needed(now)
        });
    }

    /// Takes the job whose turn it is.
    pub(super) fn pop(&mut self) -> Option<(String, Waiting<C>)> {
        self.forgive_what_all_owe();
        let able =
            self.by_session.iter().filter(|(_, share)| !share.waiting.is_empty() && share.owed_s <= 0.0);
        let (session_id, place) = able
            .min_by_key(|(_, share)| share.place)
            .map(|(session_id, share)| (session_id.clone(), share.place))?;
        let turn_s = self.turn_s();
        for share in self.by_session.values_mut() {
            // Whoever owes lets this turn pass.
            if !share.waiting.is_empty() && share.place < place {
                share.owed_s = (share.owed_s - turn_s).max(0.0);
                self.last_place += 1;
                share.place = (true, self.last_place);
            }
        }
        let place = self.next_place();
        let share = self.by_session.get_mut(&session_id)?;
        share.place = (true, place);
        share.waiting.pop_front().map(|job| (session_id, job))
    }

    /// Counts a job that begins.
    pub(super) fn started(&mut self, session_id: &str) {
        if let Some(share) = self.by_session.get_mut(session_id) {
            share.running += 1;
        }
    }

    /// Counts what a job took.
    pub(super) fn ended(&mut self, session_id: &str, took: Duration, now: Instant) {
        self.job.add(took);
        let (turn_s, place) = (self.turn_s(), self.next_place());
        if let Some(share) = self.by_session.get_mut(session_id) {
            // Whoever came while it had a thread is before it.
            share.place = (true, place);
            share.running -= 1;
            share.job_s += INTO_MEAN * (took.as_secs_f64() - share.job_s);
            share.owed_s += (share.job_s - turn_s).max(0.0);
            share.last_ended = Some(now);
        }
    }

    /// When this session was told to come back, if that is still to be.
    pub(super) fn invited(&self, session_id: &str, now: Instant) -> Option<Instant> {
        self.by_session.get(session_id).and_then(|share| share.invited).filter(|&at| at >= now)
    }

    /// Keeps a place for a session that was refused.
    pub(super) fn invite(&mut self, session_id: &str, at: Instant) {
        let job_s = self.job.mean_s();
        let share = self.by_session.entry(session_id.to_owned()).or_insert_with(|| Share::new(job_s));
        share.invited = Some(at);
    }

    /// Where all who wait owe something, nobody is there to go first.
    fn forgive_what_all_owe(&mut self) {
        let owed_s = |share: &Share<C>| if share.waiting.is_empty() { f64::INFINITY } else { share.owed_s };
        let least_s = self.by_session.values().map(owed_s).fold(f64::INFINITY, f64::min);
        if least_s > 0.0 {
            self.by_session.values_mut().for_each(|share| share.owed_s = (share.owed_s - least_s).max(0.0));
        }
    }

    fn turn_s(&self) -> f64 {
        TURN * self.job.mean_s()
    }

    fn next_place(&mut self) -> u64 {
        self.last_place += 1;
        self.last_place
    }
}
