//! The whole exploration loop on one stream: a message out, its answer back.
//!
//! A stream that breaks is opened again, and the message that was not answered is sent again with the same
//! `request_id`, so that the server counts it once.

use palpate_proto::v1::explore_request::Message as Said;
use palpate_proto::v1::explore_response::Message as Answer;
use palpate_proto::v1::{
    AddVisualPriorResponse, ContactResult, ExploreOpen, ExploreRequest, ExploreResponse, Mesh, Ping,
    ProposeContactsRequest, ProposeContactsResponse, ReportContactResponse, Session, VisualPrior,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;

use crate::retry::ensure_request_id;
use crate::routing::to_session;
use crate::{Client, Error};

/// An open exploration stream; made by [`Client::explore`].
#[derive(Debug)]
pub struct Exploration {
    client: Client,
    /// How to open the stream again: `resume_after_revision` is the newest revision heard of.
    open: ExploreOpen,
    link: Option<Link>,
    session: Session,
    /// The newest mesh that the caller has not taken.
    mesh: Option<Mesh>,
    last_id: u64,
}

/// One connection of the stream.
#[derive(Debug)]
struct Link {
    requests: mpsc::Sender<ExploreRequest>,
    answers: Streaming<ExploreResponse>,
}

impl Exploration {
    pub(crate) async fn open(client: Client, open: ExploreOpen) -> Result<Self, Error> {
        let mut exploration =
            Self { client, open, link: None, session: Session::default(), mesh: None, last_id: 0 };
        let mut attempts = 1;
        while let Err(error) = exploration.connect(attempts).await {
            exploration.client.retry().pause(error, attempts).await?;
            attempts += 1;
        }
        Ok(exploration)
    }

    /// The session as it was when the stream was last opened.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Adds a camera's view; the answer brings as many candidates as `ExploreOpen.top_k` asks for.
    pub async fn add_visual_prior(&mut self, prior: VisualPrior) -> Result<AddVisualPriorResponse, Error> {
        match self.exchange(Said::VisualPrior(prior)).await? {
            Answer::Prior(answer) => Ok(answer),
            other => Err(unexpected(&other)),
        }
    }

    /// Reports what came of an approach; the answer brings as many candidates as `ExploreOpen.top_k` asks for.
    pub async fn report(&mut self, result: ContactResult) -> Result<ReportContactResponse, Error> {
        match self.exchange(Said::Result(result)).await? {
            Answer::Accepted(answer) => Ok(answer),
            other => Err(unexpected(&other)),
        }
    }

    /// Asks where to touch next; `session_id` may stay empty.
    pub async fn propose(
        &mut self,
        request: ProposeContactsRequest,
    ) -> Result<ProposeContactsResponse, Error> {
        match self.exchange(Said::Propose(request)).await? {
            Answer::Candidates(answer) => Ok(answer),
            other => Err(unexpected(&other)),
        }
    }

    /// Asks for a sign of life.
    pub async fn ping(&mut self) -> Result<(), Error> {
        let nonce = self.last_id;
        match self.exchange(Said::Ping(Ping { nonce })).await? {
            Answer::Pong(pong) if pong.nonce == nonce => Ok(()),
            other => Err(unexpected(&other)),
        }
    }

    /// Takes the newest mesh that has not been taken yet, and waits for one if there is none.
    ///
    /// Useful only with `ExploreOpen.send_mesh`, after a prior or a result.
    ///
    /// # Errors
    /// [`Error::NoAnswer`] when none comes before the deadline.
    pub async fn next_mesh(&mut self) -> Result<Mesh, Error> {
        loop {
            if let Some(mesh) = self.mesh.take() {
                return Ok(mesh);
            }
            if let Some(answer) = self.receive(1).await?.message {
                return Err(unexpected(&answer));
            }
        }
    }

    /// Sends a message and waits for its answer, over a new connection if the old one breaks.
    async fn exchange(&mut self, said: Said) -> Result<Answer, Error> {
        self.last_id += 1;
        let mut request = ExploreRequest { id: self.last_id, request_id: String::new(), message: Some(said) };
        ensure_request_id(&mut request.request_id);

        let mut attempts = 1;
        loop {
            match self.attempt(&request, attempts).await {
                Ok(Answer::Problem(problem)) => return Err(Error::from_problem(problem)),
                Ok(answer) => return Ok(answer),
                Err(error) => {
                    self.link = None;
                    self.client.retry().pause(error, attempts).await?;
                }
            }
            attempts += 1;
        }
    }

    async fn attempt(&mut self, request: &ExploreRequest, attempts: u32) -> Result<Answer, Error> {
        if self.link.is_none() {
            self.connect(attempts).await?;
        }
        if let Some(link) = &self.link {
            // A closed stream refuses the message; why it closed is then read from the answers.
            let _closed = link.requests.send(request.clone()).await;
        }
        loop {
            let response = self.receive(attempts).await?;
            match response.message {
                Some(answer) if response.in_reply_to == request.id => return Ok(answer),
                // A mesh, put aside, or the answer to an exchange that the caller dropped half-way.
                _ => {}
            }
        }
    }

    /// Opens the stream and waits until the server has opened the session.
    async fn connect(&mut self, attempts: u32) -> Result<(), Error> {
        let (requests, receiver) = mpsc::channel(1);
        let open = ExploreRequest { message: Some(Said::Open(self.open.clone())), ..Default::default() };
        // The channel has room for this one message and its receiver is here: it cannot be refused.
        let _accepted = requests.try_send(open);
        let mut service = self.client.exploration();
        let opening = service.explore(to_session(&self.open.session_id, ReceiverStream::new(receiver)));
        let answers = self.client.in_time(opening, attempts).await?.into_inner();
        self.link = Some(Link { requests, answers });
        match self.receive(attempts).await?.message {
            Some(Answer::Opened(session)) => {
                self.session = session;
                Ok(())
            }
            Some(Answer::Problem(problem)) => Err(Error::from_problem(problem)),
            Some(other) => Err(unexpected(&other)),
            None => Err(no_answer("the stream was not opened", attempts)),
        }
    }

    /// Waits for the next message of the server; a mesh is put aside, which leaves the message empty.
    async fn receive(&mut self, attempts: u32) -> Result<ExploreResponse, Error> {
        let Some(link) = &mut self.link else {
            return Err(no_answer("the stream is closed", attempts));
        };
        let answer = self.client.in_time(link.answers.message(), attempts).await?;
        let mut response = answer.ok_or_else(|| no_answer("the server ended the stream", attempts))?;
        let newest = self.open.resume_after_revision.max(response.revision);
        self.open.resume_after_revision = newest;
        if let Some(Answer::Mesh(mesh)) = response.message.take_if(|m| matches!(m, Answer::Mesh(_))) {
            self.mesh = Some(mesh);
        }
        Ok(response)
    }
}

fn no_answer(detail: &str, attempts: u32) -> Error {
    Error::NoAnswer { attempts, detail: detail.to_owned() }
}

fn unexpected(answer: &Answer) -> Error {
    let name = match answer {
        Answer::Opened(_) => "opened",
        Answer::Accepted(_) => "accepted",
        Answer::Prior(_) => "prior",
        Answer::Candidates(_) => "candidates",
        Answer::Mesh(_) => "mesh",
        Answer::Problem(_) => "problem",
        Answer::Pong(_) => "pong",
    };
    Error::Malformed {
        what: "ExploreResponse.message",
        detail: format!("{name} does not answer what was asked"),
    }
}

#[cfg(test)]
mod tests {
    use palpate_proto::v1::{
        ContactResult, ExploreOpen, NoContact, ProposeContactsRequest, contact_result::Outcome,
    };
    use tonic::{Code, Status};

    use crate::test_server::{Scripted, Step};

    fn open() -> ExploreOpen {
        ExploreOpen { session_id: "cup".to_owned(), send_mesh: true, ..Default::default() }
    }

    fn miss() -> ContactResult {
        ContactResult { outcome: Some(Outcome::NoContact(NoContact::default())), ..Default::default() }
    }

    #[tokio::test]
    async fn every_message_gets_its_own_answer_and_meshes_are_put_aside() {
        let server = Scripted::start(vec![]).await;
        let mut exploration = server.client().await.explore(open()).await.unwrap();
        assert_eq!(exploration.session().session_id, "cup");
        exploration.ping().await.unwrap();
        assert_eq!(exploration.report(miss()).await.unwrap().seq, 1);
        assert_eq!(exploration.report(miss()).await.unwrap().seq, 2);
        let proposal = exploration.propose(ProposeContactsRequest::default()).await;
        assert_eq!(proposal.unwrap().revision, 2);
        assert_eq!(exploration.next_mesh().await.unwrap().revision, 2);
    }

    #[tokio::test]
    async fn a_broken_stream_is_opened_again_and_the_same_request_sent_again() {
        let broken = Step::Fail(Status::unavailable("going down"));
        let server = Scripted::start(vec![Step::Answer, broken]).await;
        let mut exploration = server.client().await.explore(open()).await.unwrap();
        exploration.report(miss()).await.unwrap();
        exploration.report(miss()).await.unwrap();

        let ids = server.request_ids();
        assert_eq!(ids.len(), 3, "{ids:?}");
        assert_ne!(ids[0], ids[1]);
        assert_eq!(ids[1], ids[2]);
        assert_eq!(server.resumed_after(), vec![0, 1]);
    }

    #[tokio::test]
    async fn a_problem_is_an_error_that_leaves_the_stream_open() {
        let server = Scripted::start(vec![Step::Problem]).await;
        let mut exploration = server.client().await.explore(open()).await.unwrap();
        let error = exploration.report(miss()).await.unwrap_err();
        assert_eq!(error.code(), Code::InvalidArgument);
        assert_eq!(error.reason(), "FIELD_INVALID");
        assert_eq!(error.refusal().unwrap().fields[0].field, "result");
        exploration.report(miss()).await.unwrap();
        assert_eq!(server.resumed_after(), vec![0]);
    }
}
