//! Failed attempts are counted, and each machine is answered later the more of them it has made.
//!
//! Only failures wait: whoever shows a token that is in force is answered at once, also from the same machine.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

use crate::peer;

/// A typing error or a forgotten token costs nothing.
const FREE: u32 = 3;
const FIRST_WAIT: Duration = Duration::from_millis(50);
/// A machine that has made none for this long begins anew.
const FORGOTTEN: Duration = Duration::from_secs(60);
/// Machines that are kept; beyond them the oldest is forgotten.
const MACHINES: usize = 4096;

/// The failed attempts of all machines.
#[derive(Debug)]
pub(super) struct Attempts {
    longest_wait: Duration,
    by_machine: Mutex<HashMap<Option<IpAddr>, Failed>>,
}

#[derive(Clone, Copy, Debug)]
struct Failed {
    count: u32,
    last: Instant,
}

impl Attempts {
    pub(super) fn new(longest_wait: Duration) -> Self {
        Self { longest_wait, by_machine: Mutex::default() }
    }

    /// Notes a failure, and says how long its answer should wait.
    pub(super) fn failed(&self, address: Option<IpAddr>, now: Instant) -> Duration {
        let machine = address.map(peer::machine);
        let mut machines = self.by_machine.lock().unwrap_or_else(PoisonError::into_inner);
        if machines.len() >= MACHINES && !machines.contains_key(&machine) {
            machines.retain(|_, failed| now < failed.last + FORGOTTEN);
            let oldest = machines.iter().min_by_key(|(_, failed)| failed.last).map(|(machine, _)| *machine);
            if machines.len() >= MACHINES
                && let Some(oldest) = oldest
            {
                machines.remove(&oldest);
            }
        }
        let failed = machines.entry(machine).or_insert(Failed { count: 0, last: now });
        if now >= failed.last + FORGOTTEN {
            failed.count = 0;
        }
        failed.count = failed.count.saturating_add(1);
        failed.last = now;
        wait(failed.count).min(self.longest_wait)
    }
}

fn wait(count: u32) -> Duration {
    match count.saturating_sub(FREE) {
        0 => Duration::ZERO,
        more => FIRST_WAIT * 2_u32.pow((more - 1).min(16)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_machine_waits_longer_with_each_failure_and_begins_anew_after_a_minute() {
        let (attempts, now) = (Attempts::new(Duration::from_secs(2)), Instant::now());
        let address = Some("192.0.2.1".parse().unwrap());
        let waits: Vec<u128> = (0..12).map(|_| attempts.failed(address, now).as_millis()).collect();
        assert_eq!(waits, [0, 0, 0, 50, 100, 200, 400, 800, 1600, 2000, 2000, 2000]);
        assert_eq!(attempts.failed(Some("192.0.2.2".parse().unwrap()), now), Duration::ZERO);
        assert_eq!(attempts.failed(address, now + FORGOTTEN), Duration::ZERO);
    }

    #[tokio::test]
    async fn however_many_machines_try_a_bounded_number_is_kept() {
        let (attempts, now) = (Attempts::new(Duration::from_secs(2)), Instant::now());
        for machine in 0..2 * MACHINES as u32 {
            let late = now + Duration::from_micros(machine.into());
            attempts.failed(Some(IpAddr::from(machine.to_be_bytes())), late);
        }
        assert_eq!(attempts.by_machine.lock().unwrap().len(), MACHINES);
    }
}
