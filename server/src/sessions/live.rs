//! Sessions in memory: who may change one next, and its newest snapshot for everybody else.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{OnceCell, Semaphore, SemaphorePermit, watch};
use tokio::time::Instant;

use crate::error::Error;
use crate::session::Snapshot;

/// What one change takes, roughly; only the advice on when to try again rests on it.
const TYPICAL_CHANGE: Duration = Duration::from_millis(20);

/// A session in memory.
#[derive(Debug)]
pub(super) struct Live {
    /// One permit for each call that has its turn or waits for it.
    places: Semaphore,
    /// How many calls may wait beside the one whose turn it is.
    queue: usize,
    /// The turn itself, handed on in the order of arrival.
    turn: Semaphore,
    newest: OnceCell<watch::Sender<Arc<Snapshot>>>,
    gone: AtomicBool,
    last_used: AtomicU64,
}

/// The right to change a session; the next in line has it when this is dropped.
#[derive(Debug)]
pub(super) struct Turn<'a> {
    _place: SemaphorePermit<'a>,
    _turn: SemaphorePermit<'a>,
}

impl Live {
    fn new(queue: usize) -> Self {
        Self {
            places: Semaphore::new(1 + queue),
            queue,
            turn: Semaphore::new(1),
            newest: OnceCell::new(),
            gone: AtomicBool::new(false),
            last_used: AtomicU64::new(0),
        }
    }

    /// Waits for the caller's turn.
    ///
    /// # Errors
    /// Too many wait already, or the deadline passed.
    pub(super) async fn turn(&self, deadline: Instant) -> Result<Turn<'_>, Error> {
        let Ok(place) = self.places.try_acquire() else {
            let retry_after = TYPICAL_CHANGE * u32::try_from(self.queue.max(1)).unwrap_or(u32::MAX);
            return Err(Error::QueueFull { queue: "session", retry_after });
        };
        let turn = tokio::time::timeout_at(deadline, self.turn.acquire()).await;
        let turn = turn.map_err(|_elapsed| Error::DeadlineExceeded)?.map_err(|_closed| Error::Draining)?;
        Ok(Turn { _place: place, _turn: turn })
    }

    /// The newest snapshot and those to come, computed by `replay` where there is none yet.
    pub(super) async fn load<Replay: Future<Output = Result<Arc<Snapshot>, Error>>>(
        &self,
        replay: impl FnOnce() -> Replay,
    ) -> Result<watch::Receiver<Arc<Snapshot>>, Error> {
        let load = async || Ok(watch::Sender::new(replay().await?));
        Ok(self.newest.get_or_try_init(load).await?.subscribe())
    }

    /// Makes `snapshot` the newest; whoever has the turn calls this.
    pub(super) fn publish(&self, snapshot: impl Into<Arc<Snapshot>>) {
        if let Some(newest) = self.newest.get() {
            newest.send_replace(snapshot.into());
        }
    }

    /// Whether the session was removed while the caller waited.
    pub(super) fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Acquire)
    }

    pub(super) fn mark_gone(&self) {
        self.gone.store(true, Ordering::Release);
    }

    fn snapshot(&self) -> Option<Arc<Snapshot>> {
        self.newest.get().map(|newest| newest.borrow().clone())
    }

    fn is_watched(&self) -> bool {
        self.newest.get().is_some_and(|newest| newest.receiver_count() > 0)
    }
}

/// The sessions in memory, of which the least recently used give way to others.
#[derive(Debug)]
pub(super) struct LiveSessions {
    by_id: Mutex<HashMap<String, Arc<Live>>>,
    uses: AtomicU64,
    most: usize,
    queue: usize,
}

impl LiveSessions {
    /// Room for `most` sessions, in each of which `queue` calls may wait for their turn.
    pub(super) fn new(most: usize, queue: usize) -> Self {
        Self { by_id: Mutex::default(), uses: AtomicU64::new(0), most, queue }
    }

    /// The session's place in memory, made where there is none.
    pub(super) fn get(&self, session_id: &str) -> Arc<Live> {
        let mut by_id = self.lock();
        if let Some(live) = by_id.get(session_id) {
            self.touch(live);
            return live.clone();
        }
        if by_id.len() >= self.most {
            evict(&mut by_id);
        }
        let live = Arc::new(Live::new(self.queue));
        self.touch(&live);
        by_id.insert(session_id.to_owned(), live.clone());
        live
    }

    /// The newest snapshot, if it is in memory.
    pub(super) fn loaded(&self, session_id: &str) -> Option<Arc<Snapshot>> {
        let live = self.lock().get(session_id).cloned()?;
        self.touch(&live);
        live.snapshot()
    }

    /// Gives up this place, unless another one has taken its stead.
    pub(super) fn forget(&self, session_id: &str, live: &Arc<Live>) {
        let mut by_id = self.lock();
        if by_id.get(session_id).is_some_and(|present| Arc::ptr_eq(present, live)) {
            by_id.remove(session_id);
        }
    }

    fn touch(&self, live: &Live) {
        live.last_used.store(self.uses.fetch_add(1, Ordering::Relaxed), Ordering::Relaxed);
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, Arc<Live>>> {
        // Nothing panics while it is held, and the map is sound between any two statements.
        self.by_id.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Drops the session that was used least recently and that nobody uses now.
fn evict(by_id: &mut HashMap<String, Arc<Live>>) {
    let idle = by_id.iter().filter(|(_, live)| Arc::strong_count(live) == 1 && !live.is_watched());
    let oldest = idle.min_by_key(|(_, live)| live.last_used.load(Ordering::Relaxed));
    if let Some(session_id) = oldest.map(|(session_id, _)| session_id.clone()) {
        by_id.remove(&session_id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_recently_used_session_gives_way_unless_it_is_in_use() {
        let sessions = LiveSessions::new(2, 8);
        let in_use = sessions.get("aaa");
        sessions.get("bbb");
        sessions.get("ccc");
        assert!(Arc::ptr_eq(&in_use, &sessions.get("aaa")));
        assert!(!sessions.lock().contains_key("bbb"));
    }

    #[tokio::test]
    async fn turns_are_bounded_and_a_late_one_is_given_up() {
        let live = Arc::new(Live::new(8));
        let soon = Instant::now() + Duration::from_secs(20);
        let turn = live.turn(soon).await.unwrap();
        let waiting: Vec<_> = (0..8)
            .map(|_| {
                let live = live.clone();
                tokio::spawn(async move { live.turn(soon).await.map(drop) })
            })
            .collect();
        while live.places.available_permits() > 0 {
            tokio::task::yield_now().await;
        }
        assert_eq!(live.turn(soon).await.unwrap_err().reason(), "QUEUE_FULL");
        drop(turn);
        for each in waiting {
            assert_eq!(each.await.unwrap(), Ok(()));
        }
        let _turn = live.turn(soon).await.unwrap();
        assert_eq!(live.turn(Instant::now()).await.unwrap_err(), Error::DeadlineExceeded);
    }
}
