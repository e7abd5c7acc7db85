//! Tickets: what a page shows in a URL in place of a token, since an `EventSource` and a link cannot set headers.
//!
//! A URL is written into logs and histories, so a ticket opens one request, within a minute, for reading only. Where
//! several servers share a log, a ticket of one is good at all of them: they are in a table, as hashes.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use sha2::{Digest, Sha256};
use tokio::time::Instant;

use super::caller::Caller;
use super::scope::Scope;
use super::token::random_text;
use crate::error::Error;
use crate::session::now_us;
use crate::store::TicketTable;

/// How long a ticket is good for.
pub(crate) const LASTS: Duration = Duration::from_secs(60);
/// Tickets that are out at once.
const MOST: usize = 4096;

/// The tickets that were given out and not used.
#[derive(Debug)]
pub(super) enum Tickets {
    /// Of this server alone.
    Own(OwnTickets),
    /// Of all servers that share a log.
    Shared(TicketTable),
}

impl Tickets {
    /// Those in the table, where there is one.
    pub(super) fn new(table: Option<TicketTable>) -> Self {
        table.map_or_else(|| Self::Own(OwnTickets::default()), Self::Shared)
    }

    /// A ticket for this caller.
    ///
    /// # Errors
    /// Too many are out, or the system gives no random numbers.
    pub(super) async fn issue(&self, caller: &Caller) -> Result<String, Error> {
        let table = match self {
            Self::Own(own) => return own.issue(caller, Instant::now()),
            Self::Shared(table) => table,
        };
        let ticket = new_ticket()?;
        let now = now_us();
        let until_us = now + i64::try_from(LASTS.as_micros()).unwrap_or(i64::MAX);
        let row = caller.at_most(Scope::Read).to_ticket(until_us);
        let is_kept = table.put(&digest(&ticket), &row, now, MOST as i64).await?;
        if is_kept { Ok(ticket) } else { Err(too_many()) }
    }

    /// Whose ticket it is, once.
    ///
    /// # Errors
    /// It is none, or it was used, or it is too old.
    pub(super) async fn redeem(&self, ticket: &str) -> Result<Caller, Error> {
        let caller = match self {
            Self::Own(own) => own.redeem(ticket, Instant::now()),
            Self::Shared(table) => {
                let row = table.take(&digest(ticket)).await?;
                row.filter(|row| now_us() < row.until_us).and_then(|row| Caller::of_ticket(&row))
            }
        };
        caller.ok_or(Error::TicketInvalid)
    }
}

fn new_ticket() -> Result<String, Error> {
    random_text::<32>().map_err(|error| Error::internal(error.to_string()))
}

fn digest(ticket: &str) -> Vec<u8> {
    Sha256::digest(ticket).to_vec()
}

fn too_many() -> Error {
    let hint = "use those that were given out, or wait a minute";
    Error::Quota { what: "tickets at once", limit: MOST as u64, hint }
}

/// The tickets of one server, in memory.
#[derive(Debug, Default)]
pub(super) struct OwnTickets {
    out: Mutex<HashMap<String, Issued>>,
}

#[derive(Debug)]
struct Issued {
    caller: Caller,
    until: Instant,
}

impl OwnTickets {
    fn issue(&self, caller: &Caller, now: Instant) -> Result<String, Error> {
        let mut out = self.out.lock().unwrap_or_else(PoisonError::into_inner);
        out.retain(|_, issued| now < issued.until);
        if out.len() >= MOST {
            return Err(too_many());
        }
        let ticket = new_ticket()?;
        out.insert(ticket.clone(), Issued { caller: caller.at_most(Scope::Read), until: now + LASTS });
        Ok(ticket)
    }

    fn redeem(&self, ticket: &str, now: Instant) -> Option<Caller> {
        let issued = self.out.lock().unwrap_or_else(PoisonError::into_inner).remove(ticket)?;
        (now < issued.until).then_some(issued.caller)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_ticket_opens_one_request_within_a_minute_for_reading() {
        let (tickets, now) = (OwnTickets::default(), Instant::now());
        let ticket = tickets.issue(&Caller::anyone(None), now).unwrap();
        assert_eq!(tickets.redeem(&ticket, now).unwrap().scope(), Scope::Read);
        assert!(tickets.redeem(&ticket, now).is_none(), "only once");
        let late = tickets.issue(&Caller::anyone(None), now).unwrap();
        assert!(tickets.redeem(&late, now + LASTS).is_none());
        assert!(tickets.redeem("", now).is_none());
    }

    #[tokio::test]
    async fn no_more_are_out_than_may_be() {
        let (tickets, now) = (OwnTickets::default(), Instant::now());
        for _ in 0..MOST {
            tickets.issue(&Caller::anyone(None), now).unwrap();
        }
        assert_eq!(tickets.issue(&Caller::anyone(None), now).unwrap_err().reason(), "QUOTA");
        tickets.issue(&Caller::anyone(None), now + LASTS).unwrap();
    }
}
