//! Fair turns: sessions take them one after the other, and within a session whoever came first has it.
//!
//! A turn is one job, and worth three times what a job takes on average: whoever takes more owes the rest, and lets others
//! go first until it is made good (deficit round robin). What is owed is counted only beyond that, so that robots
//! whose jobs take a little more or less keep their order, and wait for one round each.
//!
//! Above the sessions are accounts, one for each token: where several want the threads, each has its part of them,
//! however many sessions it has.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::time::Instant;

use super::{Measured, Work};
use crate::access::Account;

/// How long it is remembered what a session owes, and that it was told to come back.
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
    account: Arc<str>,
    place: Place,
    waiting: VecDeque<Waiting<C>>,
    running: usize,
    /// What it took beyond its turns, in seconds.
    owed_s: f64,
    last_ended: Option<Instant>,
    /// When it was told to come back, having been refused.
    invited: Option<Instant>,
}

/// Where a session stands in line: who was told to come now is before all others.
type Place = (bool, u64);

impl<C> Share<C> {
    fn of(account: &Account) -> Self {
        let (account, waiting) = (account.token_id.clone(), VecDeque::new());
        Self { account, place: (true, 0), waiting, running: 0, owed_s: 0.0, last_ended: None, invited: None }
    }

    /// Whether it was told to come at about this time.
    fn is_invited(&self, now: Instant) -> bool {
        self.invited.is_some_and(|at| at <= now && now < at + KEPT)
    }

    /// Whether anything has to be known of it.
    fn is_needed(&self, now: Instant) -> bool {
        let recently = |at: Option<Instant>| at.is_some_and(|at| now < at + KEPT);
        let owes = self.owed_s > 0.0 && recently(self.last_ended);
        !self.waiting.is_empty() || self.running > 0 || owes || recently(self.invited)
    }
}

/// What an account has had.
#[derive(Debug)]
struct Used {
    /// Its part of the threads, as others have 1.
    share: f64,
    /// Seconds of a thread for each 1 of that; whoever has had least is next.
    seconds: f64,
    last_entered: Instant,
}

/// The sessions that have jobs, owe something, or were told to come back.
#[derive(Debug)]
pub(super) struct Shares<C> {
    by_session: HashMap<String, Share<C>>,
    accounts: HashMap<Arc<str>, Used>,
    /// The last place that was taken.
    last_place: u64,
    /// What a job takes, whatever it does.
    job: Measured,
}

impl<C> Shares<C> {
    pub(super) fn new() -> Self {
        Self {
            by_session: HashMap::new(),
            accounts: HashMap::new(),
            last_place: 0,
            job: Measured::guessed(GUESSED_COST),
        }
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
    pub(super) fn ahead_s(&self, session_id: &str, account: &Account, now: Instant) -> f64 {
        let own = self.by_session.get(session_id);
        let turns = match own {
            Some(own) if own.waiting.is_empty() && own.is_invited(now) => 0,
            Some(own) => own.waiting.len() + 1 + (own.owed_s / self.turn_s()).ceil() as usize,
            None => 1,
        };
        let before = self.by_session.iter().filter(|(_, share)| share.account == account.token_id);
        let before = before.flat_map(|(id, share)| {
            let count = if id == session_id { share.waiting.len() } else { turns };
            share.waiting.iter().take(count)
        });
        let before_s: f64 = before.map(|job| job.cost_s).sum();
        before_s + self.others_s(account, before_s + self.job.mean_s())
    }

    /// What other accounts have until this one has had so much, in seconds of a thread.
    fn others_s(&self, account: &Account, own_s: f64) -> f64 {
        let others = self.accounts.iter().filter(|(id, _)| **id != account.token_id);
        let until = |(id, used): (&Arc<str>, &Used)| {
            let waiting = self.by_session.values().filter(|share| share.account == *id);
            let waiting_s: f64 = waiting.flat_map(|share| &share.waiting).map(|job| job.cost_s).sum();
            waiting_s.min(own_s * used.share / account.share)
        };
        others.map(until).sum()
    }

    /// Puts a job behind those of its session.
    pub(super) fn enter(&mut self, session_id: &str, account: &Account, job: Waiting<C>, now: Instant) {
        self.open_account(account, now);
        let place = self.next_place();
        let share = self.by_session.entry(session_id.to_owned()).or_insert_with(|| Share::of(account));
        // A session that nobody waits for is on the account of whoever calls next.
        if share.waiting.is_empty() {
            share.account = account.token_id.clone();
        }
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
        let by_session = &self.by_session;
        self.accounts.retain(|id, used| {
            let has_sessions = by_session.values().any(|share| share.account == *id);
            has_sessions || now < used.last_entered + KEPT
        });
    }

    /// Takes the job whose turn it is.
    pub(super) fn pop(&mut self) -> Option<(String, Account, Waiting<C>)> {
        let account = self.next_account()?;
        self.forgive_what_all_owe(&account);
        let waiting = self.by_session.iter().filter(|(_, share)| !share.waiting.is_empty());
        let able = waiting.filter(|(_, share)| share.account == account && share.owed_s <= 0.0);
        let (session_id, place) = able
            .min_by_key(|(_, share)| share.place)
            .map(|(session_id, share)| (session_id.clone(), share.place))?;
        let turn_s = self.turn_s();
        for share in self.by_session.values_mut() {
            // Whoever owes lets this turn pass.
            if !share.waiting.is_empty() && share.account == account && share.place < place {
                share.owed_s = (share.owed_s - turn_s).max(0.0);
                self.last_place += 1;
                share.place = (true, self.last_place);
            }
        }
        let place = self.next_place();
        let share = self.by_session.get_mut(&session_id)?;
        share.place = (true, place);
        let job = share.waiting.pop_front()?;
        let share = self.accounts.get(&account).map_or(1.0, |used| used.share);
        Some((session_id, Account { token_id: account, share }, job))
    }

    /// Counts a job that begins, and what it is expected to take.
    pub(super) fn started(&mut self, session_id: &str, cost_s: f64) {
        if let Some(share) = self.by_session.get_mut(session_id) {
            share.running += 1;
            if let Some(used) = self.accounts.get_mut(&share.account) {
                used.seconds += cost_s / used.share;
            }
        }
    }

    /// Counts what a job took that was expected to take this many seconds.
    pub(super) fn ended(&mut self, session_id: &str, cost_s: f64, took: Duration, now: Instant) {
        self.job.add(took);
        let (turn_s, place) = (self.turn_s(), self.next_place());
        if let Some(share) = self.by_session.get_mut(session_id) {
            // Whoever came while it had a thread is before it.
            share.place = (true, place);
            share.running -= 1;
            share.owed_s = (share.owed_s + took.as_secs_f64() - turn_s).max(0.0);
            share.last_ended = Some(now);
            if let Some(used) = self.accounts.get_mut(&share.account) {
                used.seconds += (took.as_secs_f64() - cost_s) / used.share;
            }
        }
    }

    /// When this session was told to come back, if that is still to be.
    pub(super) fn invited(&self, session_id: &str, now: Instant) -> Option<Instant> {
        self.by_session.get(session_id).and_then(|share| share.invited).filter(|&at| at >= now)
    }

    /// Keeps a place for a session that was refused.
    pub(super) fn invite(&mut self, session_id: &str, account: &Account, at: Instant) {
        let share = self.by_session.entry(session_id.to_owned()).or_insert_with(|| Share::of(account));
        share.invited = Some(at);
    }

    /// An account that was away has no more to make up for than whoever has had least of those that wait.
    fn open_account(&mut self, account: &Account, now: Instant) {
        let is_away = !self.is_waiting(&account.token_id);
        let least = self.accounts.iter().filter(|(id, _)| self.is_waiting(id)).map(|(_, used)| used.seconds);
        let least = least.min_by(f64::total_cmp);
        let new = Used { share: account.share, seconds: 0.0, last_entered: now };
        let used = self.accounts.entry(account.token_id.clone()).or_insert(new);
        (used.share, used.last_entered) = (account.share, now);
        if is_away && let Some(least) = least {
            used.seconds = used.seconds.max(least);
        }
    }

    fn is_waiting(&self, account: &str) -> bool {
        self.by_session.values().any(|share| *share.account == *account && !share.waiting.is_empty())
    }

    /// The account that has had least of those that wait.
    fn next_account(&self) -> Option<Arc<str>> {
        let waiting = self.accounts.iter().filter(|(id, _)| self.is_waiting(id));
        waiting.min_by(|(_, a), (_, b)| a.seconds.total_cmp(&b.seconds)).map(|(id, _)| id.clone())
    }

    /// Where all of an account who wait owe something, nobody is there to go first.
    fn forgive_what_all_owe(&mut self, account: &Arc<str>) {
        let mut sessions: Vec<&mut Share<C>> =
            self.by_session.values_mut().filter(|share| share.account == *account).collect();
        let owed_s =
            |share: &&mut Share<C>| if share.waiting.is_empty() { f64::INFINITY } else { share.owed_s };
        let least_s = sessions.iter().map(owed_s).fold(f64::INFINITY, f64::min);
        if least_s > 0.0 {
            sessions.iter_mut().for_each(|share| share.owed_s = (share.owed_s - least_s).max(0.0));
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
