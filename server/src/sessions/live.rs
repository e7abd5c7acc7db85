//! Sessions in memory: who may change one next, and its newest state for everybody else.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{OnceCell, OwnedSemaphorePermit, watch};
use tokio::time::Instant;

use super::States;
use super::gate::{Gate, Pass};
use crate::error::Error;
use crate::store::{Link, first_link};

/// Where the log of a session ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    /// The link of the last event.
    pub(super) link: Link,
    /// What the events take, roughly, in bytes.
    pub(super) bytes: u64,
}

impl Head {
    /// That of a log without events.
    pub(super) fn empty(session_id: &str) -> Self {
        Self { link: first_link(session_id), bytes: 0 }
    }
}

/// A state, and where the log ends that it was folded from.
#[derive(Debug)]
pub(super) struct Replayed<S> {
    pub(super) state: Arc<S>,
    pub(super) head: Head,
}

/// A session in memory.
#[derive(Debug)]
pub(super) struct Live<S> {
    /// Whoever is in may change it.
    permit: Arc<Gate>,
    newest: OnceCell<watch::Sender<Arc<S>>>,
    /// Whoever is in may compute an earlier state.
    pub(super) past: Arc<Gate>,
    /// Where its log ends; whoever holds the permit reads and writes it.
    head: Mutex<Option<Head>>,
    gone: AtomicBool,
    /// When it was last known to be what the log says.
    looked_at: Mutex<Instant>,
    /// Whoever holds it compares it with the log.
    pub(super) looking: tokio::sync::Mutex<()>,
    /// When it was last asked for, in nanoseconds of the life of all.
    last_used: AtomicU64,
}

impl<S> Live<S> {
    fn new(queue: usize) -> Self {
        Self {
            permit: Gate::new("session", queue),
            newest: OnceCell::new(),
            past: Gate::new("session's reader", queue),
            head: Mutex::new(None),
            gone: AtomicBool::new(false),
            looked_at: Mutex::new(Instant::now()),
            looking: tokio::sync::Mutex::default(),
            last_used: AtomicU64::new(0),
        }
    }

    /// Waits until the caller may change the session.
    ///
    /// # Errors
    /// The deadline cannot be met or passed, or too many wait.
    pub(super) async fn permit(&self, deadline: Instant) -> Result<Pass, Error> {
        self.permit.enter(false, deadline).await
    }

    /// The same for who only brings it up to what the log says.
    ///
    /// # Errors
    /// The deadline passed.
    pub(super) async fn permit_to_catch_up(&self, deadline: Instant) -> Result<OwnedSemaphorePermit, Error> {
        self.permit.step_in(deadline).await
    }

    /// When it was last known to be what the log says.
    pub(super) fn looked_at(&self) -> Instant {
        *self.looked_at.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// It was what the log said at this moment.
    pub(super) fn look(&self, at: Instant) {
        let mut looked_at = self.looked_at.lock().unwrap_or_else(PoisonError::into_inner);
        *looked_at = at.max(*looked_at);
    }

    /// The newest state and those to come, computed by `replay` where there is none yet.
    pub(super) async fn load<Replay: Future<Output = Result<Replayed<S>, Error>>>(
        &self,
        replay: impl FnOnce() -> Replay,
    ) -> Result<States<S>, Error> {
        let load = async || {
            let begun = Instant::now();
            let Replayed { state, head } = replay().await?;
            self.look(begun);
            self.set_head(head);
            Ok::<_, Error>(watch::Sender::new(state))
        };
        Ok(self.newest.get_or_try_init(load).await?.subscribe())
    }

    /// The newest state and those to come, if there is one yet.
    pub(super) fn states(&self) -> Option<States<S>> {
        self.newest.get().map(watch::Sender::subscribe)
    }

    /// Makes a state the newest; whoever holds the permit calls this.
    pub(super) fn publish(&self, Replayed { state, head }: Replayed<S>) {
        self.set_head(head);
        if let Some(newest) = self.newest.get() {
            newest.send_replace(state);
        }
    }

    /// Where the log ends that the newest state was folded from.
    pub(super) fn head(&self) -> Option<Head> {
        *self.head.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set_head(&self, head: Head) {
        *self.head.lock().unwrap_or_else(PoisonError::into_inner) = Some(head);
    }

    /// Whether the session was removed while the caller waited.
    pub(super) fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Acquire)
    }

    pub(super) fn mark_gone(&self) {
        self.gone.store(true, Ordering::Release);
    }

    pub(super) fn state(&self) -> Option<Arc<S>> {
        self.newest.get().map(|newest| newest.borrow().clone())
    }

    fn is_watched(&self) -> bool {
        self.newest.get().is_some_and(|newest| newest.receiver_count() > 0)
    }
}

/// The sessions in memory, of which the least recently used give way to others.
#[derive(Debug)]
pub(super) struct LiveSessions<S> {
    by_id: Mutex<HashMap<String, Arc<Live<S>>>>,
    since: std::time::Instant,
    room: Room<S>,
    queue: usize,
}

/// How many sessions may be in memory, and how many bytes they may take, roughly.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room<S> {
    pub(super) sessions: usize,
    pub(super) bytes: usize,
    /// What a state takes.
    pub(super) size: fn(&S) -> usize,
}

impl<S> LiveSessions<S> {
    /// Sessions that have so much room, in each of which `queue` calls may wait for the permit.
    pub(super) fn new(room: Room<S>, queue: usize) -> Self {
        Self { by_id: Mutex::default(), since: std::time::Instant::now(), room, queue }
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.lock().len()
    }

    /// The session's entry in memory, made where there is none.
    pub(super) fn get(&self, session_id: &str) -> Arc<Live<S>> {
        let mut by_id = self.lock();
        if let Some(live) = by_id.get(session_id) {
            self.touch(live);
            return live.clone();
        }
        while self.room.is_full(&by_id) && evict(&mut by_id) {}
        let live = Arc::new(Live::new(self.queue));
        self.touch(&live);
        by_id.insert(session_id.to_owned(), live.clone());
        live
    }

    /// The newest state, if it is in memory.
    pub(super) fn loaded(&self, session_id: &str) -> Option<Arc<S>> {
        let live = self.lock().get(session_id).cloned()?;
        self.touch(&live);
        live.state()
    }

    /// Those that somebody watches.
    pub(super) fn watched(&self) -> Vec<(String, Arc<Live<S>>)> {
        let by_id = self.lock();
        let watched = by_id.iter().filter(|(_, live)| live.is_watched());
        watched.map(|(session_id, live)| (session_id.clone(), live.clone())).collect()
    }

    /// Removes this entry, unless a new one has replaced it.
    pub(super) fn forget(&self, session_id: &str, live: &Arc<Live<S>>) {
        let mut by_id = self.lock();
        if by_id.get(session_id).is_some_and(|present| Arc::ptr_eq(present, live)) {
            by_id.remove(session_id);
        }
    }

    /// Drops the sessions that nobody uses or watches and that nobody has asked for in `idle`.
    pub(super) fn forget_idle(&self, idle: Duration) {
        let now = self.now();
        let is_idle =
            |live: &Live<S>| now.saturating_sub(live.last_used.load(Ordering::Relaxed)) > nanoseconds(idle);
        // What they held is freed when the others may go on.
        let _idle: Vec<_> = self.lock().extract_if(|_, live| is_free(live) && is_idle(live)).collect();
    }

    fn touch(&self, live: &Live<S>) {
        live.last_used.store(self.now(), Ordering::Relaxed);
    }

    fn now(&self) -> u64 {
        nanoseconds(self.since.elapsed())
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, Arc<Live<S>>>> {
        // Nothing panics while it is held, and the map is sound between any two statements.
        self.by_id.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<S> Room<S> {
    fn is_full(&self, by_id: &HashMap<String, Arc<Live<S>>>) -> bool {
        let taken =
            || by_id.values().filter_map(|live| live.state()).map(|state| (self.size)(&state)).sum::<usize>();
        by_id.len() >= self.sessions || taken() >= self.bytes
    }
}

/// Drops the session that was used least recently and that nobody uses now; whether there is one.
fn evict<S>(by_id: &mut HashMap<String, Arc<Live<S>>>) -> bool {
    let free = by_id.iter().filter(|(_, live)| is_free(live));
    let oldest = free.min_by_key(|(_, live)| live.last_used.load(Ordering::Relaxed));
    oldest
        .map(|(session_id, _)| session_id.clone())
        .and_then(|session_id| by_id.remove(&session_id))
        .is_some()
}

/// Whether nobody uses a session now; asked while the map is held, so that nobody begins to.
fn is_free<S>(live: &Arc<Live<S>>) -> bool {
    Arc::strong_count(live) == 1 && !live.is_watched()
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn sessions_that_nobody_asks_for_or_watches_leave_memory() {
        let room = Room { sessions: 100, bytes: usize::MAX, size: |_: &()| 0 };
        let sessions = LiveSessions::new(room, 8);
        let replayed = async || Ok(Replayed { state: Arc::new(()), head: Head::empty("watched") });
        let _watch = sessions.get("watched").load(replayed).await.unwrap();
        let _in_use = sessions.get("in-use");
        sessions.get("idle");
        sessions.forget_idle(Duration::from_secs(60));
        assert_eq!(sessions.lock().len(), 3, "all were asked for just now");
        std::thread::sleep(Duration::from_millis(2));
        sessions.forget_idle(Duration::from_millis(1));
        let mut left: Vec<String> = sessions.lock().keys().cloned().collect();
        left.sort_unstable();
        assert_eq!(left, ["in-use", "watched"]);
    }

    #[test]
    fn the_least_recently_used_session_gives_way_unless_it_is_in_use() {
        let room = Room { sessions: 2, bytes: usize::MAX, size: |_: &()| 0 };
        let sessions = LiveSessions::new(room, 8);
        let in_use = sessions.get("aaa");
        sessions.get("bbb");
        sessions.get("ccc");
        assert!(Arc::ptr_eq(&in_use, &sessions.get("aaa")));
        assert!(!sessions.lock().contains_key("bbb"));
    }

    #[tokio::test]
    async fn sessions_give_way_until_there_is_room_for_the_bytes_of_another() {
        let room = Room { sessions: 100, bytes: 30, size: |bytes: &usize| *bytes };
        let sessions = LiveSessions::new(room, 8);
        for (session_id, bytes) in [("aaa", 5), ("bbb", 10), ("ccc", 10), ("ddd", 25)] {
            let replayed = Replayed { state: Arc::new(bytes), head: Head::empty(session_id) };
            sessions.get(session_id).load(async || Ok(replayed)).await.unwrap();
        }
        sessions.get("eee");
        let mut left: Vec<String> = sessions.lock().keys().cloned().collect();
        left.sort_unstable();
        assert_eq!(left, ["ddd", "eee"], "50 bytes were taken, and 25 stay");
    }
}
