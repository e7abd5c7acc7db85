//! Tickets: what a page shows in a URL in place of a token, since an `EventSource` and a link cannot set headers.
//!
//! A URL is written into logs and histories, so a ticket opens one request, within a minute, for reading only.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

use super::caller::Caller;
use super::scope::Scope;
use super::token::random_text;
use crate::error::Error;

/// How long a ticket is good for.
pub(crate) const LASTS: Duration = Duration::from_secs(60);
/// Tickets that are out at once.
const MOST: usize = 4096;

/// The tickets that were given out and not used.
#[derive(Debug, Default)]
pub(super) struct Tickets {
    out: Mutex<HashMap<String, Issued>>,
}

#[derive(Debug)]
struct Issued {
    caller: Caller,
    until: Instant,
}

impl Tickets {
    /// A ticket for this caller.
    ///
    /// # Errors
    /// Too many are out, or the system gives no random numbers.
    pub(super) fn issue(&self, caller: &Caller, now: Instant) -> Result<String, Error> {
        let mut out = self.out.lock().unwrap_or_else(PoisonError::into_inner);
        out.retain(|_, issued| now < issued.until);
        if out.len() >= MOST {
            let hint = "use those that were given out, or wait a minute";
            return Err(Error::Quota { what: "tickets at once", limit: MOST as u64, hint });
        }
        let ticket = random_text::<32>().map_err(|error| Error::internal(error.to_string()))?;
        out.insert(ticket.clone(), Issued { caller: caller.at_most(Scope::Read), until: now + LASTS });
        Ok(ticket)
    }

    /// Whose ticket it is, once.
    pub(super) fn redeem(&self, ticket: &str, now: Instant) -> Option<Caller> {
        let issued = self.out.lock().unwrap_or_else(PoisonError::into_inner).remove(ticket)?;
        (now < issued.until).then_some(issued.caller)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_ticket_opens_one_request_within_a_minute_for_reading() {
        let (tickets, now) = (Tickets::default(), Instant::now());
        let ticket = tickets.issue(&Caller::anyone(None), now).unwrap();
        assert_eq!(tickets.redeem(&ticket, now).unwrap().scope(), Scope::Read);
        assert!(tickets.redeem(&ticket, now).is_none(), "only once");
        let late = tickets.issue(&Caller::anyone(None), now).unwrap();
        assert!(tickets.redeem(&late, now + LASTS).is_none());
        assert!(tickets.redeem("", now).is_none());
    }

    #[tokio::test]
    async fn no_more_are_out_than_may_be() {
        let (tickets, now) = (Tickets::default(), Instant::now());
        for _ in 0..MOST {
            tickets.issue(&Caller::anyone(None), now).unwrap();
        }
        assert_eq!(tickets.issue(&Caller::anyone(None), now).unwrap_err().reason(), "QUOTA");
        tickets.issue(&Caller::anyone(None), now + LASTS).unwrap();
    }
}
