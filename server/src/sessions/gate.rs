//! One at a time, in the order of arrival: who may change a session next, or compute an earlier state of it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::Instant;

use crate::compute::{Invitations, Measured};
use crate::error::Error;

/// How long one has the gate to himself, until that was measured.
const GUESSED_STAY: Duration = Duration::from_millis(20);

/// Lets one in at a time. Whoever comes waits as long as his deadline allows, and is refused at once only where those
/// before him are known to take longer.
#[derive(Debug)]
pub(super) struct Gate {
    /// What refusals call it.
    name: &'static str,
    /// How many may wait.
    most: usize,
    turn: Arc<Semaphore>,
    traffic: Mutex<Traffic>,
}

#[derive(Debug)]
struct Traffic {
    /// How many wait or are in.
    count: u32,
    stay: Measured,
    invitations: Invitations,
}

/// The right to be inside; the next in line has it when this is dropped.
#[derive(Debug)]
pub(super) struct Pass {
    since: Instant,
    place: Place,
    _turn: OwnedSemaphorePermit,
}

/// A place among those who wait or are in.
#[derive(Debug)]
struct Place(Arc<Gate>);

impl Gate {
    pub(super) fn new(name: &'static str, most: usize) -> Arc<Self> {
        let stay = Measured::guessed(GUESSED_STAY);
        let traffic = Traffic { count: 0, stay, invitations: Invitations::default() };
        Arc::new(Self { name, most, turn: Arc::new(Semaphore::new(1)), traffic: Mutex::new(traffic) })
    }

    /// Waits for a turn; a patient caller is never refused when he comes.
    ///
    /// # Errors
    /// The deadline cannot be met or passed, or too many wait.
    pub(super) async fn enter(self: &Arc<Self>, is_patient: bool, deadline: Instant) -> Result<Pass, Error> {
        let place = self.place(is_patient, deadline)?;
        let turn = tokio::time::timeout_at(deadline, self.turn.clone().acquire_owned()).await;
        let turn = turn.map_err(|_elapsed| Error::DeadlineExceeded)?.map_err(|_closed| Error::Draining)?;
        Ok(Pass { since: Instant::now(), place, _turn: turn })
    }

    /// Waits for a turn without a place in the line: for what takes a moment, and has nobody refused.
    ///
    /// # Errors
    /// The deadline passed.
    pub(super) async fn step_in(&self, deadline: Instant) -> Result<OwnedSemaphorePermit, Error> {
        let turn = tokio::time::timeout_at(deadline, self.turn.clone().acquire_owned()).await;
        turn.map_err(|_elapsed| Error::DeadlineExceeded)?.map_err(|_closed| Error::Draining)
    }

    fn place(self: &Arc<Self>, is_patient: bool, deadline: Instant) -> Result<Place, Error> {
        let now = Instant::now();
        let mut traffic = self.lock();
        if !is_patient && traffic.count > 0 {
            let stay = Duration::from_secs_f64(traffic.stay.mean_s());
            let answered = stay * (traffic.count + 1);
            let late = (now + answered).saturating_duration_since(deadline);
            let is_full = traffic.count as usize > self.most;
            if is_full || !late.is_zero() {
                let place = traffic.invitations.next(now + late, stay);
                let retry_after = traffic.invitations.hint(now, place);
                return Err(if is_full {
                    Error::QueueFull { queue: self.name, retry_after }
                } else {
                    Error::Busy { queue: self.name, answered, retry_after }
                });
            }
        }
        traffic.count += 1;
        Ok(Place(self.clone()))
    }

    fn lock(&self) -> MutexGuard<'_, Traffic> {
        // Nothing panics while it is held.
        self.traffic.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Pass {
    fn drop(&mut self) {
        self.place.0.lock().stay.add(self.since.elapsed());
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.lock().count -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(seconds: u64) -> Instant {
        Instant::now() + Duration::from_secs(seconds)
    }

    /// Somebody who waits, and has begun to.
    async fn waiter(gate: &Arc<Gate>, deadline: Instant) -> tokio::task::JoinHandle<Result<(), Error>> {
        let before = gate.lock().count;
        let waiting = tokio::spawn({
            let gate = gate.clone();
            async move { gate.enter(false, deadline).await.map(drop) }
        });
        while gate.lock().count == before {
            tokio::task::yield_now().await;
        }
        waiting
    }

    #[tokio::test]
    async fn whoever_has_the_time_waits_and_a_late_caller_gives_up() {
        let gate = Gate::new("session", 100);
        let pass = gate.enter(false, after(20)).await.unwrap();
        let mut waiting = Vec::new();
        for _ in 0..64 {
            waiting.push(waiter(&gate, after(20)).await);
        }
        drop(pass);
        for each in waiting {
            assert_eq!(each.await.unwrap(), Ok(()));
        }
        let _pass = gate.enter(false, after(20)).await.unwrap();
        let late = Instant::now() + Duration::from_millis(60);
        assert_eq!(gate.enter(true, late).await.unwrap_err(), Error::DeadlineExceeded);
        assert_eq!(gate.lock().count, 1, "who gave up is not counted");
    }

    #[tokio::test]
    async fn whose_turn_would_come_too_late_is_refused_at_once_and_told_when_to_come_back() {
        let gate = Gate::new("session", 100);
        let _pass = gate.enter(false, after(20)).await.unwrap();
        gate.lock().stay = Measured::guessed(Duration::from_secs(6));
        let _second = waiter(&gate, after(60)).await;
        let Err(Error::Busy { answered, retry_after, .. }) = gate.enter(false, after(10)).await else {
            panic!("the third would be answered in 18 s")
        };
        assert_eq!(answered, Duration::from_secs(18));
        assert!((7..=11).contains(&retry_after.as_secs()), "{retry_after:?}");
        let Err(Error::Busy { retry_after: next, .. }) = gate.enter(false, after(10)).await else { panic!() };
        assert!(next > retry_after, "{next:?} is one stay after {retry_after:?}");
    }

    #[tokio::test]
    async fn a_free_gate_is_open_to_whoever_has_any_time_at_all() {
        let gate = Gate::new("session", 0);
        gate.lock().stay = Measured::guessed(Duration::from_secs(60));
        let pass = gate.enter(false, after(1)).await.expect("nobody is before him");
        assert_eq!(gate.enter(false, after(600)).await.unwrap_err().reason(), "QUEUE_FULL");
        drop(pass);
        assert!(gate.lock().stay.mean_s() < 1.0, "what was measured counts");
    }
}
