//! Places for open streams: over all, from one machine and in one session.
//!
//! A stream costs little while nothing happens, so there is room for many; but whoever opens all of
//! them must not shut out the others.

use std::collections::HashMap;
use std::hash::Hash;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::Error;
use crate::limits::Limits;
use crate::peer;

const HINT: &str = "close streams that are no longer read";

/// All places, taken and free; cheap to clone.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    taken: Arc<Mutex<Taken>>,
}

#[derive(Debug, Default)]
struct Taken {
    all: usize,
    by_machine: HashMap<IpAddr, usize>,
    by_session: HashMap<String, usize>,
}

/// One stream's place, until it is dropped.
#[derive(Debug)]
pub(super) struct Place {
    places: Places,
    machine: Option<IpAddr>,
    session_id: Option<String>,
}

impl Places {
    /// A place for a stream from this address, if it is known.
    ///
    /// # Errors
    /// [`Error::Quota`]: there is none left, over all or for this machine.
    pub(super) fn take(&self, address: Option<IpAddr>, limits: &Limits) -> Result<Place, Error> {
        let mut taken = self.lock();
        if taken.all >= limits.streams {
            return Err(full("open streams", limits.streams));
        }
        let machine = address.map(peer::machine);
        if let Some(machine) = machine
            && !count_up(&mut taken.by_machine, machine, limits.streams_per_peer)
        {
            return Err(full("open streams from one address", limits.streams_per_peer));
        }
        taken.all += 1;
        Ok(Place { places: self.clone(), machine, session_id: None })
    }

    /// How many are taken.
    pub(super) fn taken(&self) -> usize {
        self.lock().all
    }

    fn lock(&self) -> MutexGuard<'_, Taken> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Place {
    /// Takes a place in this session, too; a stream is about one session.
    ///
    /// # Errors
    /// [`Error::Quota`]: the session has none left.
    pub(super) fn enter(&mut self, session_id: &str, limits: &Limits) -> Result<(), Error> {
        let mut taken = self.places.lock();
        if let Some(before) = self.session_id.take() {
            count_down(&mut taken.by_session, &before);
        }
        if !count_up(&mut taken.by_session, session_id.to_owned(), limits.streams_per_session) {
            return Err(full("open streams of one session", limits.streams_per_session));
        }
        self.session_id = Some(session_id.to_owned());
        Ok(())
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut taken = self.places.lock();
        taken.all -= 1;
        if let Some(machine) = &self.machine {
            count_down(&mut taken.by_machine, machine);
        }
        if let Some(session_id) = &self.session_id {
            count_down(&mut taken.by_session, session_id);
        }
    }
}

fn full(what: &'static str, limit: usize) -> Error {
    Error::Quota { what, limit: limit as u64, hint: HINT }
}

/// Whether there was room for one more.
fn count_up<K: Eq + Hash>(counts: &mut HashMap<K, usize>, key: K, most: usize) -> bool {
    let count = counts.entry(key).or_default();
    let has_room = *count < most;
    *count += usize::from(has_room);
    has_room
}

/// One less; what nobody has is forgotten.
fn count_down<K: Eq + Hash>(counts: &mut HashMap<K, usize>, key: &K) {
    if let Some(count) = counts.get_mut(key) {
        *count = count.saturating_sub(1);
        if *count == 0 {
            counts.remove(key);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_bounded_three_ways_and_come_back() {
        let limits = Limits { streams: 3, streams_per_peer: 2, streams_per_session: 1, ..Limits::default() };
        let (here, there) = (Some([192, 0, 2, 1].into()), Some([192, 0, 2, 2].into()));
        let places = Places::default();
        let refused = |outcome: Result<(), Error>| outcome.unwrap_err().to_string();
        let mut first = places.take(here, &limits).unwrap();
        let mut second = places.take(here, &limits).unwrap();
        let third = places.take(here, &limits).map(drop);
        assert!(refused(third).contains("2 open streams from one address"));
        first.enter("ball", &limits).unwrap();
        first.enter("ball", &limits).expect("it moves from this place to this place");
        assert!(refused(second.enter("ball", &limits)).contains("1 open streams of one session"));
        second.enter("mug", &limits).unwrap();
        let third = places.take(there, &limits).unwrap();
        assert!(refused(places.take(None, &limits).map(drop)).contains("3 open streams is reached"));
        drop(first);
        second.enter("ball", &limits).unwrap();
        drop((second, third));
        let taken = places.lock();
        assert_eq!((taken.all, taken.by_machine.len(), taken.by_session.len()), (0, 0, 0));
    }
}
