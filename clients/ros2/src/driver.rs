//! Drives one session: takes orders out of the outbox, carries them to the server until it has acknowledged them, and
//! tells what the session has become.
//!
//! ```text
//! connect ──> open the session ──> order ──> send under its request_id ──> acknowledged ──> tell, and fetch the surface
//!                                    ^            │  no answer: wait, send again
//!                                    └────────────┴─ refused: tell why; the order is done with
//! ```
//!
//! Between orders it looks each second whether somebody else changed the session.

mod connection;

use std::time::Duration;

use palpate_client::proto::v1::{
    AddVisualPriorRequest, ArchiveFormat, ContactResult, CreateSessionRequest, ExportSessionRequest,
    FinishSessionRequest, GetMeshRequest, ProposeContactsRequest, ReportContactRequest, RobotContext,
    Session, SessionState, VisualPrior, Warning, mesh,
};
use palpate_client::{Client, Code, Error};
use tokio::sync::mpsc;
use tokio::time::{MissedTickBehavior, interval};

use crate::attractors::{Touched, touched};
use crate::candidates::Proposal;
use crate::markers::Surface;
use crate::outbox::{Answer, Command, NewSession, Order, Reply};
use crate::parameters::{Parameters, session_config};

use connection::Connection;

/// How often to look whether somebody else changed the session.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);

/// What has become of the session.
#[derive(Debug, Clone, PartialEq)]
pub enum Update {
    /// A session is driven from now on.
    Opened(Box<Session>),
    /// Where to touch next.
    Proposed(Proposal),
    /// The surface.
    Surface(Surface),
    /// Where it was touched.
    Touched(Vec<Touched>),
    /// What the server doubts of the last evidence.
    Warnings(Vec<Warning>),
    /// Whether the server answers; if not, why.
    Server(Result<(), String>),
    /// Whether there is a session; if not, why, and what to do.
    Session(Result<String, String>),
    /// A view was taken or refused.
    View(Result<String, String>),
    /// A report was taken or refused.
    Report(Result<String, String>),
}

/// The one who drives.
struct Driver {
    parameters: Parameters,
    orders: mpsc::Receiver<Order>,
    connection: Connection,
    session: Option<Session>,
    /// The revision that was told last.
    told: i64,
}

/// Drives until the outbox is closed.
///
/// # Errors
/// What no waiting mends, such as an address that is none, in words.
pub async fn drive(
    parameters: Parameters,
    orders: mpsc::Receiver<Order>,
    updates: mpsc::Sender<Update>,
) -> Result<(), String> {
    let connection = Connection::open(&parameters, updates).await?;
    let mut driver = Driver { parameters, orders, connection, session: None, told: 0 };
    driver.open().await;
    driver.run().await;
    Ok(())
}

impl Driver {
    async fn run(&mut self) {
        let mut look = interval(LOOK_INTERVAL);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                biased;
                order = self.orders.recv() => match order {
                    Some(order) => self.carry_out(order).await,
                    None => return,
                },
                _ = look.tick() => self.look().await,
            }
        }
    }

    /// Opens the session of the parameters, or makes it.
    async fn open(&mut self) {
        let session_id = self.parameters.session_id.clone();
        if !session_id.is_empty() {
            match self
                .connection
                .deliver(|client| {
                    let session_id = session_id.clone();
                    async move { client.get_session(&session_id).await }
                })
                .await
            {
                Ok(session) => return self.drive_session(session).await,
                Err(error) if error.code() == Code::NotFound => {}
                Err(error) => return self.connection.tell(Update::Session(Err(error.to_string()))).await,
            }
        }
        if !self.parameters.create_session {
            let missing = format!("there is no session {session_id:?} yet: call the service ~/create");
            return self.connection.tell(Update::Session(Err(missing))).await;
        }
        let order = uuid::Uuid::now_v7().to_string();
        let new = NewSession { session_id, ..NewSession::default() };
        if let Err(error) = self.create(&order, new).await {
            self.connection.tell(Update::Session(Err(error))).await;
        }
    }

    async fn drive_session(&mut self, session: Session) {
        let wanted = &self.parameters.frame_id;
        if session.frame_id != *wanted {
            let other = format!(
                "session {} is in frame {:?}, and parameter frame_id is {wanted:?}: set it to the session's, or drive another session",
                session.session_id, session.frame_id
            );
            self.session = None;
            return self.connection.tell(Update::Session(Err(other))).await;
        }
        self.connection.tell(Update::Session(Ok(session.session_id.clone()))).await;
        self.connection.tell(Update::Opened(Box::new(session.clone()))).await;
        self.told = 0;
        let is_active = session.state() == SessionState::Active;
        self.session = Some(session);
        if is_active {
            self.refresh().await;
        }
    }

    async fn create(&mut self, request_id: &str, new: NewSession) -> Answer {
        let NewSession { session_id, display_name, experiment, config } = new;
        let or = |given: String, parameter: &str| if given.is_empty() { parameter.to_owned() } else { given };
        let config = match config {
            Some(config) => config,
            None => session_config(&self.parameters.config)?,
        };
        let request = CreateSessionRequest {
            session_id,
            display_name: or(display_name, &self.parameters.display_name),
            experiment: or(experiment, &self.parameters.experiment),
            frame_id: self.parameters.frame_id.clone(),
            labels: self.parameters.labels.clone().into_iter().collect(),
            config: Some(config),
            request_id: request_id.to_owned(),
        };
        let session = self
            .connection
            .deliver(|client| {
                let request = request.clone();
                async move { client.create_session(request).await }
            })
            .await;
        let session = session.map_err(|error| error.to_string())?;
        let session_id = session.session_id.clone();
        self.drive_session(session).await;
        Ok(Reply { message: format!("session {session_id} awaits a view"), session_id, proposal: None })
    }

    async fn carry_out(&mut self, order: Order) {
        let Order { request_id, command, reply, open } = order;
        let answer = match command {
            Command::Flush => Ok(Reply::default()),
            Command::Create(new) => self.create(&request_id, *new).await,
            command => match self.session.as_ref().map(|session| session.session_id.clone()) {
                None => Err("there is no session: call the service ~/create".to_owned()),
                Some(session_id) => self.within(session_id, request_id, command).await,
            },
        };
        drop(open);
        if let Some(reply) = reply {
            // Who asked may have stopped waiting.
            let _ = reply.send(answer);
        }
    }

    async fn within(&mut self, session_id: String, request_id: String, command: Command) -> Answer {
        match command {
            Command::View(prior) => {
                let answer = self.add_view(session_id, request_id, *prior).await;
                self.connection.tell(Update::View(answer.clone().map(|reply| reply.message))).await;
                answer
            }
            Command::Report(result) => {
                let answer = self.report(session_id, request_id, *result).await;
                self.connection.tell(Update::Report(answer.clone().map(|reply| reply.message))).await;
                answer
            }
            Command::Propose(top_k) => {
                self.propose(session_id, top_k).await.map_err(|error| error.to_string())
            }
            Command::Finish(note) => {
                let request = FinishSessionRequest {
                    session_id: session_id.clone(),
                    note,
                    request_id,
                    ..Default::default()
                };
                let finished = self
                    .connection
                    .deliver(|client| {
                        let request = request.clone();
                        async move { client.finish_session(request).await }
                    })
                    .await;
                finished.map_err(|error| error.to_string())?;
                self.propose_nothing(session_id.clone()).await;
                Ok(Reply { message: format!("session {session_id} is finished"), session_id, proposal: None })
            }
            Command::Create(_) | Command::Flush => Ok(Reply::default()),
        }
    }

    async fn add_view(&mut self, session_id: String, request_id: String, prior: VisualPrior) -> Answer {
        let request = AddVisualPriorRequest {
            session_id: session_id.clone(),
            prior: Some(prior),
            request_id,
            propose: self.parameters.candidates,
            ..Default::default()
        };
        let view = self
            .connection
            .deliver(|client| {
                let request = request.clone();
                async move { client.add_visual_prior(request).await }
            })
            .await;
        let view = view.map_err(|error| error.to_string())?;
        let session = view.session.clone().unwrap_or_default();
        let proposal = Proposal {
            session_id: session_id.clone(),
            revision: session.revision,
            should_stop: view.should_stop(),
            candidates: view.candidates,
        };
        self.connection.tell(Update::Warnings(view.warning_details)).await;
        self.connection.tell(Update::Proposed(proposal.clone())).await;
        self.fetch(&session_id, session.revision).await;
        let message = format!("{} points of the view are in the estimate", view.accepted_points);
        Ok(Reply { message, session_id, proposal: Some(proposal) })
    }

    async fn report(&mut self, session_id: String, request_id: String, result: ContactResult) -> Answer {
        let request = ReportContactRequest {
            session_id: session_id.clone(),
            result: Some(result),
            request_id,
            propose: self.parameters.candidates,
            robot: Some(self.robot()),
            ..Default::default()
        };
        let reply = self
            .connection
            .deliver(|client| {
                let request = request.clone();
                async move { client.report_contact(request).await }
            })
            .await;
        let reply = reply.map_err(|error| error.to_string())?;
        let revision = reply.session.as_ref().map_or(reply.seq, |session| session.revision);
        let proposal = Proposal {
            session_id: session_id.clone(),
            revision,
            should_stop: reply.should_stop(),
            candidates: reply.candidates,
        };
        self.connection.tell(Update::Warnings(reply.warning_details)).await;
        self.connection.tell(Update::Proposed(proposal.clone())).await;
        self.fetch(&session_id, revision).await;
        let message =
            format!("event {} moved the surface by up to {:.1} mm", reply.seq, 1e3 * reply.max_vertex_move_m);
        Ok(Reply { message, session_id, proposal: Some(proposal) })
    }

    async fn propose(&mut self, session_id: String, top_k: u32) -> Result<Reply, Error> {
        let top_k = if top_k == 0 { self.parameters.candidates } else { top_k };
        let request = ProposeContactsRequest {
            session_id: session_id.clone(),
            top_k,
            robot: Some(self.robot()),
            ..Default::default()
        };
        let proposed = self
            .connection
            .deliver(|client| {
                let request = request.clone();
                async move { client.propose_contacts(request).await }
            })
            .await?;
        let proposal = Proposal {
            session_id: session_id.clone(),
            revision: proposed.revision,
            should_stop: proposed.should_stop(),
            candidates: proposed.candidates,
        };
        self.connection.tell(Update::Warnings(proposed.warning_details)).await;
        self.connection.tell(Update::Proposed(proposal.clone())).await;
        let message = format!("{} candidates at revision {}", proposal.candidates.len(), proposal.revision);
        Ok(Reply { message, session_id, proposal: Some(proposal) })
    }

    fn robot(&self) -> RobotContext {
        RobotContext { robot_id: self.parameters.robot_id.clone(), ..Default::default() }
    }

    /// Fetches surface and touches of a revision and tells them.
    async fn fetch(&mut self, session_id: &str, revision: i64) {
        let request = GetMeshRequest { session_id: session_id.to_owned(), ..Default::default() };
        let fetched = self
            .connection
            .deliver(|client| {
                let request = request.clone();
                async move { client.get_mesh(request).await }
            })
            .await;
        match fetched.map(|mesh| mesh.body) {
            Ok(Some(mesh::Body::Raw(raw))) => match Surface::unpack(&raw) {
                Ok(surface) => self.connection.tell(Update::Surface(surface)).await,
                Err(error) => tracing::error!("the mesh of {session_id} cannot be read: {error}"),
            },
            Ok(_) => {}
            Err(error) => tracing::warn!("no mesh of {session_id}: {error}"),
        }
        let request = ExportSessionRequest {
            session_id: session_id.to_owned(),
            format: ArchiveFormat::Csv.into(),
            ..Default::default()
        };
        let table = self
            .connection
            .deliver(|client| {
                let request = request.clone();
                async move { download(&client, request).await }
            })
            .await;
        match table.map(|table| touched(&table)) {
            Ok(Ok(touched)) => self.connection.tell(Update::Touched(touched)).await,
            Ok(Err(error)) => {
                tracing::error!("the table of attempts of {session_id} cannot be read: {error}");
            }
            Err(error) => tracing::warn!("no table of attempts of {session_id}: {error}"),
        }
        self.told = revision;
    }

    /// Asks for everything anew.
    async fn refresh(&mut self) {
        let Some(session_id) = self.session.as_ref().map(|session| session.session_id.clone()) else {
            return;
        };
        match self.propose(session_id.clone(), 0).await {
            Ok(reply) => {
                let revision = reply.proposal.map_or(0, |proposal| proposal.revision);
                self.fetch(&session_id, revision).await;
            }
            Err(error) => tracing::warn!("no candidates of {session_id}: {error}"),
        }
    }

    /// A session that is finished takes no touches.
    async fn propose_nothing(&self, session_id: String) {
        self.connection.tell(Update::Proposed(Proposal { session_id, ..Proposal::default() })).await;
    }

    /// Looks whether somebody else changed the session; one attempt, since orders come first.
    async fn look(&mut self) {
        let Some(session_id) = self.session.as_ref().map(|session| session.session_id.clone()) else {
            return;
        };
        match self.connection.client().get_session(&session_id).await {
            Ok(session) => {
                self.connection.tell(Update::Server(Ok(()))).await;
                if session.revision != self.told {
                    match session.state() {
                        SessionState::Active => self.refresh().await,
                        SessionState::Finished => self.propose_nothing(session_id).await,
                        _ => {}
                    }
                    self.told = self.told.max(session.revision);
                }
            }
            Err(error) if error.code() == Code::NotFound => {
                self.session = None;
                let gone = format!("session {session_id} was deleted: call the service ~/create");
                self.connection.tell(Update::Session(Err(gone))).await;
            }
            Err(error) => {
                self.connection.tell(Update::Server(Err(error.to_string()))).await;
                self.connection.renew(&error).await;
            }
        }
    }
}

async fn download(client: &Client, request: ExportSessionRequest) -> Result<Vec<u8>, Error> {
    let mut download = client.export_session(request).await?;
    let mut file = Vec::new();
    while let Some(bytes) = download.next().await? {
        file.extend_from_slice(&bytes);
    }
    Ok(file)
}
