//! A rosbag2 recording in MCAP, played to a server as if the robot did it again.
//!
//! Messages go through the same [`Bridge`] as those of a live node, in the order in which they were recorded, and each
//! order is carried out before the next message: a recording of an exploration gives the same session each time.

use std::fmt;
use std::path::Path;
use std::time::{Duration, Instant};

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::from_bytes;
use tokio::sync::mpsc;

use crate::bridge::{Bridge, Inbound};
use crate::diagnostics::Level;
use crate::driver::{self, Update};
use crate::messages::{Contact, RosMessage, TfMessage};
use crate::names::Names;
use crate::node::Inputs;
use crate::outbox::{Command, Outbox};
use crate::parameters::Parameters;

/// What was played.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Played {
    /// The session that it made.
    pub session_id: String,
    /// Messages that the bridge listens to.
    pub messages: usize,
    /// Views that the server took.
    pub views: usize,
    /// Reports that the server took.
    pub reports: usize,
    /// What was lost, and why.
    pub problems: Vec<String>,
}

impl fmt::Display for Played {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { session_id, messages, views, reports, problems } = self;
        write!(f, "{messages} messages, {views} views, {reports} reports in session {session_id}")?;
        problems.iter().try_for_each(|problem| write!(f, "\n{problem}"))
    }
}

/// Plays a recording from its beginning to its end.
///
/// # Errors
/// The file is none, or the server cannot be called, in words.
pub async fn play(file: &Path, parameters: Parameters, names: &Names) -> Result<Played, String> {
    let shown = file.display();
    let bytes = std::fs::read(file).map_err(|error| format!("{shown} cannot be read: {error}"))?;
    let inputs = Inputs::resolve(names)?;
    let (outbox, orders) = Outbox::new(parameters.outbox_limit);
    let (tell, updates) = mpsc::channel(64);
    let mut player = Player {
        bridge: Bridge::new(parameters.clone(), outbox, &names.node),
        updates,
        played: Played::default(),
    };
    let driving = tokio::spawn(driver::drive(parameters, orders, tell));
    player.carry_out().await?;
    let mut recording: Vec<(u64, Inbound)> = Vec::new();
    for message in mcap::MessageStream::new(&bytes).map_err(|error| format!("{shown} is no MCAP: {error}"))? {
        let message =
            message.map_err(|error| format!("{shown}: {error}; if its chunks are compressed, `mcap decompress` makes a file whose chunks are not"))?;
        if let Some(inbound) = inputs.read(&message).map_err(|error| format!("{shown}: {error}"))? {
            recording.push((message.log_time, inbound));
        }
    }
    // Chunks overlap in time; the sort keeps the order of equal times.
    recording.sort_by_key(|(time, _)| *time);
    player.played.messages = recording.len();
    for (_, message) in recording {
        player.take(message).await?;
    }
    player.give_up().await?;
    let Player { bridge, played, .. } = player;
    drop(bridge);
    driving.await.map_err(|error| format!("the driver ended: {error}"))??;
    Ok(played)
}

struct Player {
    bridge: Bridge,
    updates: mpsc::Receiver<Update>,
    played: Played,
}

impl Player {
    async fn take(&mut self, message: Inbound) -> Result<(), String> {
        self.bridge.take(message, Instant::now());
        self.note_problem();
        if self.bridge.outbox().waiting() > 0 { self.carry_out().await } else { Ok(()) }
    }

    /// What still waits for TF will not get it: the recording is over.
    async fn give_up(&mut self) -> Result<(), String> {
        self.bridge.settle(Instant::now() + Duration::from_secs(3600));
        self.note_problem();
        self.carry_out().await
    }

    fn note_problem(&mut self) {
        for part in ["view", "wrench", "contact", "report", "tf"] {
            if let Some((Level::Error, problem)) = self.bridge.diagnostics().get(part) {
                let problem = problem.to_owned();
                if !self.played.problems.contains(&problem) {
                    self.played.problems.push(problem);
                }
            }
        }
    }

    /// Waits until all orders are carried out.
    async fn carry_out(&mut self) -> Result<(), String> {
        let mut done = self.bridge.outbox().ask(Command::Flush)?;
        loop {
            tokio::select! {
                biased;
                update = self.updates.recv() => match update {
                    Some(update) => self.hear(update),
                    None => return Err("the server cannot be called: see the log".to_owned()),
                },
                _ = &mut done => break,
            }
        }
        while let Ok(update) = self.updates.try_recv() {
            self.hear(update);
        }
        Ok(())
    }

    fn hear(&mut self, update: Update) {
        match &update {
            Update::Opened(session) => self.played.session_id.clone_from(&session.session_id),
            Update::View(Ok(_)) => self.played.views += 1,
            Update::Report(Ok(_)) => self.played.reports += 1,
            Update::Session(Err(error)) => self.played.problems.push(error.clone()),
            _ => {}
        }
        self.bridge.update(update);
        self.note_problem();
    }
}

impl Inputs {
    /// A message of a recording, if the bridge listens to its topic.
    fn read(&self, message: &mcap::Message) -> Result<Option<Inbound>, String> {
        let topic = message.channel.topic.as_str();
        if topic == self.wrench {
            decode(message, Inbound::Wrench)
        } else if topic == self.points {
            decode(message, Inbound::Cloud)
        } else if topic == self.image {
            decode(message, Inbound::Image)
        } else if topic == self.camera_info {
            decode(message, Inbound::CameraInfo)
        } else if topic == self.contact {
            decode::<Contact>(message, Inbound::Contact)
        } else if topic == self.tf {
            decode::<TfMessage>(message, Inbound::Tf)
        } else if topic == self.tf_static {
            decode::<TfMessage>(message, Inbound::TfStatic)
        } else {
            Ok(None)
        }
    }
}

/// Decodes one message, whose type must be the one that the topic has.
fn decode<M: RosMessage>(message: &mcap::Message, wrap: fn(M) -> Inbound) -> Result<Option<Inbound>, String> {
    let topic = &message.channel.topic;
    let expected = M::full_name();
    if let Some(schema) = message.channel.schema.as_ref().filter(|schema| schema.name != expected) {
        return Err(format!("topic {topic} has {}, not {expected}: remap another topic to it", schema.name));
    }
    if message.channel.message_encoding != "cdr" {
        return Err(format!(
            "topic {topic} is encoded as {:?}, not as cdr",
            message.channel.message_encoding
        ));
    }
    let unreadable = |error: String| format!("topic {topic} has a message that is no {expected}: {error}");
    // Four octets say the byte order before the message.
    let (kind, body) =
        message.data.split_at_checked(4).ok_or_else(|| unreadable("it is empty".to_owned()))?;
    let decoded = match kind[1] {
        0 => from_bytes::<M, BigEndian>(body),
        1 => from_bytes::<M, LittleEndian>(body),
        other => return Err(unreadable(format!("it is encoded as {other}, not as plain CDR"))),
    };
    decoded.map(|(message, _)| Some(wrap(message))).map_err(|error| unreadable(error.to_string()))
}
