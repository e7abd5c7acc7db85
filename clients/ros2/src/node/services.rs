//! The services: who asks gets the server's answer, or is told that it is still to come.
//!
//! Replies are short, and candidates come on their topics alone: RustDDS 0.15 writes a reply that needs more than one
//! datagram wrongly (an octet too many before its parts), so that it would never arrive.

use std::time::Duration;

use futures_util::StreamExt;
use ros2_client::qos::{History, QosProfile};
use ros2_client::{Message, Node, ServiceMapping, ServiceTypeName};
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;

use super::Arrival;
use super::topics::parsed;
use crate::messages::{
    CreateSessionRequest, CreateSessionResponse, FinishRequest, FinishResponse, ProposeRequest,
    ProposeResponse, RejectRequest, RejectResponse, TriggerRequest, TriggerResponse,
};
use crate::names::Names;
use crate::outbox::{Answer, Reply};

/// How long a caller waits; what was asked stays in the outbox when it is longer.
const PATIENCE: Duration = Duration::from_secs(8);

/// A call, with who waits for its answer.
pub(super) enum Asked {
    Create(Waiting, CreateSessionRequest),
    Propose(Waiting, ProposeRequest),
    Reject(Waiting, RejectRequest),
    Finish(Waiting, FinishRequest),
    Tare(Waiting),
    TakeView(Waiting),
    NoContact(Waiting),
}

/// Who waits.
pub(super) struct Waiting(oneshot::Sender<Answer>);

impl Waiting {
    /// Answers at once.
    pub(super) fn say(self, answer: Result<&str, &str>) {
        let reply = |message: &str| Reply { message: message.to_owned(), ..Reply::default() };
        // A caller that is gone needs no answer.
        let _ = self.0.send(answer.map(reply).map_err(str::to_owned));
    }

    /// Answers with what the driver says, or that it has not said anything yet.
    pub(super) fn wait(self, answer: oneshot::Receiver<Answer>) {
        tokio::spawn(async move {
            let answer = match timeout(PATIENCE, answer).await {
                Ok(Ok(answer)) => answer,
                Ok(Err(_)) => Err("the bridge ends".to_owned()),
                Err(_) => Err(format!(
                    "the server has not answered in {} s; what was asked is kept and done as soon as it does: see /diagnostics",
                    PATIENCE.as_secs()
                )),
            };
            let _ = self.0.send(answer);
        });
    }
}

/// Offers all services.
pub(super) fn serve(
    node: &mut Node,
    names: &Names,
    mapping: ServiceMapping,
    arrive: &mpsc::Sender<Arrival>,
) -> Result<(), String> {
    let revision = |reply: &Reply| reply.proposal.as_ref().map_or(0, |proposal| proposal.revision);
    let mut offer = Offer { node, names, mapping, arrive };
    offer.service(
        "~/create",
        "palpate_msgs",
        "CreateSession",
        Asked::Create,
        |success, message, reply: Reply| CreateSessionResponse {
            success,
            message,
            session_id: reply.session_id,
        },
    )?;
    offer.service(
        "~/propose",
        "palpate_msgs",
        "Propose",
        Asked::Propose,
        move |success, message, reply: Reply| ProposeResponse {
            success,
            message,
            revision: revision(&reply),
        },
    )?;
    offer.service("~/reject", "palpate_msgs", "Reject", Asked::Reject, move |success, message, reply| {
        RejectResponse { success, message, revision: revision(&reply) }
    })?;
    offer.service("~/finish", "palpate_msgs", "Finish", Asked::Finish, |success, message, _| {
        FinishResponse { success, message }
    })?;
    let triggered = |success, message, _: Reply| TriggerResponse { success, message };
    let tare = |waiting, _: TriggerRequest| Asked::Tare(waiting);
    let take_view = |waiting, _: TriggerRequest| Asked::TakeView(waiting);
    let no_contact = |waiting, _: TriggerRequest| Asked::NoContact(waiting);
    offer.service("~/tare", "std_srvs", "Trigger", tare, triggered)?;
    offer.service("~/take_view", "std_srvs", "Trigger", take_view, triggered)?;
    offer.service("~/no_contact", "std_srvs", "Trigger", no_contact, triggered)
}

struct Offer<'a> {
    node: &'a mut Node,
    names: &'a Names,
    mapping: ServiceMapping,
    arrive: &'a mpsc::Sender<Arrival>,
}

impl Offer<'_> {
    fn service<Q, A>(
        &mut self,
        name: &str,
        package: &str,
        kind: &str,
        ask: impl Fn(Waiting, Q) -> Asked + Send + 'static,
        respond: impl Fn(bool, String, Reply) -> A + Send + 'static,
    ) -> Result<(), String>
    where
        Q: Message + Clone + Send + Sync + 'static,
        A: Message + Send + Sync + 'static,
    {
        let name = self.names.resolve(name)?;
        let qos = QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
        let kind = ServiceTypeName::new(package, kind);
        let server = self
            .node
            .create_server::<Q, A>(self.mapping, &parsed(&name)?, &kind, qos.clone(), qos)
            .map_err(|error| format!("service {name}: {error}"))?;
        let arrive = self.arrive.clone();
        tokio::spawn(async move {
            let mut requests = server.receive_request_stream();
            while let Some(request) = requests.next().await {
                let (id, request) = match request {
                    Ok(request) => request,
                    Err(error) => {
                        tracing::error!(
                            "service {name}: a request cannot be read: {error}; do parameter rmw and the caller's RMW agree?"
                        );
                        continue;
                    }
                };
                let (waiting, answer) = oneshot::channel();
                if arrive.send(Arrival::Service(ask(Waiting(waiting), request))).await.is_err() {
                    return;
                }
                let answer = answer.await.unwrap_or_else(|_| Err("the bridge ends".to_owned()));
                let response = match answer {
                    Ok(reply) => respond(true, shortened(&reply.message), reply),
                    Err(error) => respond(false, shortened(&error), Reply::default()),
                };
                if let Err(error) = server.async_send_response(id, response).await {
                    tracing::warn!("service {name}: an answer was not sent: {error:?}");
                }
            }
        });
        Ok(())
    }
}

/// The longest text of a reply, in octets: with all else it fits into one datagram.
const LONGEST_TEXT: usize = 700;

/// A text that fits into a reply.
fn shortened(text: &str) -> String {
    if text.len() <= LONGEST_TEXT {
        return text.to_owned();
    }
    format!("{} ...", &text[..text.floor_char_boundary(LONGEST_TEXT)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_cut_between_characters() {
        assert_eq!(shortened("no"), "no");
        let long = shortened(&"\u{e4}".repeat(500));
        assert!(long.ends_with("\u{e4} ...") && long.len() <= LONGEST_TEXT + 4, "{long}");
    }
}
