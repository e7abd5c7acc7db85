//! What is to be told to the server, in order, while it may be away.
//!
//! Each order gets its `request_id` when it is put in, and keeps it however often it is sent: the server counts it once.
//! The queue is bounded; what does not fit is refused to who brings it, and never dropped in silence.

use std::sync::Arc;

use palpate_client::proto::v1::{ContactResult, SessionConfig, VisualPrior};
use tokio::sync::{mpsc, oneshot};
use uuid::Uuid;

use crate::candidates::Proposal;

/// What is to be done.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Add a view.
    View(Box<VisualPrior>),
    /// Report what came of an approach.
    Report(Box<ContactResult>),
    /// Ask for so many candidates; 0 = as many as the parameters say.
    Propose(u32),
    /// Make a session and drive it from now on.
    Create(Box<NewSession>),
    /// Close the session, with a remark.
    Finish(String),
    /// Nothing; it is answered when all before it is done.
    Flush,
}

/// What a new session is called; what is empty comes from the parameters.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NewSession {
    /// Its identifier; empty = the server makes one.
    pub session_id: String,
    /// Its name for people.
    pub display_name: String,
    /// Its experiment.
    pub experiment: String,
    /// Its configuration; `None` = that of the parameters.
    pub config: Option<SessionConfig>,
}

/// What became of an order, or why not, in words.
pub type Answer = Result<Reply, String>;

/// What became of an order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reply {
    /// In words.
    pub message: String,
    /// The session that it was about.
    pub session_id: String,
    /// Where to touch next, where the server said so.
    pub proposal: Option<Proposal>,
}

/// One order with its `request_id`.
#[derive(Debug)]
pub struct Order {
    /// The same for every attempt.
    pub request_id: String,
    /// What is to be done.
    pub command: Command,
    /// Who waits for the answer, if anybody.
    pub reply: Option<oneshot::Sender<Answer>>,
    /// Dropped when the order is done with.
    pub open: Open,
}

/// Counts an order as long as it lives.
#[derive(Debug)]
pub struct Open(#[expect(dead_code, reason = "what counts is that it is there")] Arc<()>);

/// The way in.
#[derive(Debug)]
pub struct Outbox {
    orders: mpsc::Sender<Order>,
    open: Arc<()>,
}

impl Outbox {
    /// An outbox for so many orders, and where they come out.
    pub fn new(limit: usize) -> (Self, mpsc::Receiver<Order>) {
        let (orders, out) = mpsc::channel(limit);
        (Self { orders, open: Arc::default() }, out)
    }

    /// Puts an order in for which nobody waits.
    ///
    /// # Errors
    /// The outbox is full, in words.
    pub fn put(&self, command: Command) -> Result<(), String> {
        self.push(command, None)
    }

    /// Puts an order in and gives back where its answer will be.
    ///
    /// # Errors
    /// The outbox is full, in words.
    pub fn ask(&self, command: Command) -> Result<oneshot::Receiver<Answer>, String> {
        let (reply, answer) = oneshot::channel();
        self.push(command, Some(reply)).map(|()| answer)
    }

    /// How many orders are not done with, the one that is being sent among them.
    pub fn waiting(&self) -> usize {
        Arc::strong_count(&self.open) - 1
    }

    fn push(&self, command: Command, reply: Option<oneshot::Sender<Answer>>) -> Result<(), String> {
        let order =
            Order { request_id: Uuid::now_v7().to_string(), command, reply, open: Open(self.open.clone()) };
        self.orders.try_send(order).map_err(|error| {
            // The order that did not fit lives in its error and is none that waits.
            drop(error);
            format!(
                "{} reports wait for the server, and outbox_limit allows no more: this one is lost; is the server running?",
                self.waiting()
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_come_out_in_order_each_with_an_id_of_its_own() {
        let (outbox, mut out) = Outbox::new(3);
        outbox.put(Command::Propose(1)).unwrap();
        let mut answer = outbox.ask(Command::Flush).unwrap();
        assert_eq!(outbox.waiting(), 2);
        let (first, second) = (out.try_recv().unwrap(), out.try_recv().unwrap());
        assert_eq!((first.command, second.command), (Command::Propose(1), Command::Flush));
        assert_ne!(first.request_id, second.request_id);
        drop(first.open);
        assert_eq!(outbox.waiting(), 1, "an order waits until it is done with, not until it is taken out");
        second.reply.unwrap().send(Ok(Reply::default())).unwrap();
        assert_eq!(answer.try_recv().unwrap(), Ok(Reply::default()));
    }

    #[test]
    fn what_does_not_fit_is_refused_and_what_waits_stays() {
        let (outbox, mut out) = Outbox::new(2);
        outbox.put(Command::Propose(1)).unwrap();
        outbox.put(Command::Propose(2)).unwrap();
        let refused = outbox.put(Command::Propose(3)).unwrap_err();
        assert!(refused.contains("2 reports wait") && refused.contains("outbox_limit"), "{refused}");
        assert_eq!(out.try_recv().unwrap().command, Command::Propose(1));
        outbox.put(Command::Propose(4)).unwrap();
        assert_eq!(out.try_recv().unwrap().command, Command::Propose(2));
        assert_eq!(out.try_recv().unwrap().command, Command::Propose(4));
    }
}
