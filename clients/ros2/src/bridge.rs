//! The bridge without its wires: messages of ROS in, orders for the server and messages of ROS out.
//!
//! A measurement waits here until TF knows where it was taken; then it becomes an order, in the order of arrival.
//! The node and the player of recordings both feed this, so that a recording tests what a robot does.

mod contacts;
#[cfg(test)]
mod tests;
mod views;

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use palpate_client::proto::v1::{self, SessionState};

use crate::attractors::attractors;
use crate::candidates::Proposal;
use crate::contact_detector::{ContactDetector, Touch};
use crate::diagnostics::{Diagnostics, Level};
use crate::driver::Update;
use crate::messages::{
    CameraInfo, Candidates, Contact, Header, Image, Marker, Mesh, PointCloud2, PoseArray, PoseStamped,
    TfMessage, Time, WrenchStamped, frame,
};
use crate::outbox::{Command, Outbox};
use crate::parameters::{Parameters, PriorPolicy};
use crate::transforms::{LookupError, Transforms};

/// What comes from a robot.
#[derive(Debug, Clone, PartialEq)]
pub enum Inbound {
    /// Topic `wrench`.
    Wrench(WrenchStamped),
    /// Topic `points`.
    Cloud(PointCloud2),
    /// Topic `depth/image`.
    Image(Image),
    /// Topic `depth/camera_info`.
    CameraInfo(CameraInfo),
    /// Topic `/tf`.
    Tf(TfMessage),
    /// Topic `/tf_static`.
    TfStatic(TfMessage),
    /// Topic `contact`.
    Contact(Contact),
}

/// What goes to those who listen.
#[derive(Debug, Clone, PartialEq)]
pub enum Outbound {
    /// The best candidate: the tool at the beginning of the approach.
    Candidate(PoseStamped),
    /// The same of all candidates.
    Candidates(PoseArray),
    /// All of the candidates.
    Details(Candidates),
    /// The surface.
    Mesh(Mesh),
    /// The surface in colours.
    Marker(Box<Marker>),
    /// Where it was touched.
    Attractors(PointCloud2),
}

/// What waits for TF.
#[derive(Debug, Clone)]
enum Measurement {
    Touch { touch: Touch, frame_id: String, candidate_id: String },
    Contact { contact: Contact, candidate_id: String },
    Cloud(PointCloud2),
    Image(Image, CameraInfo),
}

/// Why a measurement is no order yet.
#[derive(Debug)]
enum Unready {
    /// TF may still bring it.
    Waits(LookupError),
    /// It is wrong, in words.
    Wrong(String),
}

impl From<LookupError> for Unready {
    fn from(error: LookupError) -> Self {
        if error.may_come() { Self::Waits(error) } else { Self::Wrong(error.to_string()) }
    }
}

/// How many measurements may wait for TF; 1 kHz of touches is none.
const MOST_WAITING: usize = 64;

/// All that is known on this side of the server.
#[derive(Debug)]
pub struct Bridge {
    parameters: Parameters,
    transforms: Transforms,
    detector: ContactDetector,
    camera: Option<CameraInfo>,
    waiting: VecDeque<(Instant, Measurement)>,
    outbox: Outbox,
    diagnostics: Diagnostics,
    proposal: Proposal,
    /// Whether something was reported for the best candidate already.
    is_claimed: bool,
    is_view_wanted: bool,
    /// The newest stamp of what came in: the robot's own clock, simulated or not.
    now: Time,
}

impl Bridge {
    /// One that puts its orders into an outbox; `node` is the name that diagnostics bear.
    pub fn new(parameters: Parameters, outbox: Outbox, node: &str) -> Self {
        let mut diagnostics = Diagnostics::new(node);
        diagnostics.set("server", Level::Warn, "not connected yet");
        if parameters.contact.enabled {
            diagnostics.set(
                "contact",
                Level::Warn,
                "no wrench yet: is topic wrench remapped to the sensor's?",
            );
        }
        Self {
            transforms: Transforms::new(parameters.tf.buffer_s, parameters.tf.max_gap_s),
            detector: ContactDetector::new(parameters.contact),
            camera: None,
            waiting: VecDeque::new(),
            outbox,
            diagnostics,
            proposal: Proposal::default(),
            is_claimed: true,
            is_view_wanted: false,
            now: Time::default(),
            parameters,
        }
    }

    /// The states of all parts.
    pub fn diagnostics(&self) -> &Diagnostics {
        &self.diagnostics
    }

    /// Whether a state changed since the last call.
    pub fn has_news(&mut self) -> bool {
        self.diagnostics.take_news()
    }

    /// The outbox.
    pub fn outbox(&self) -> &Outbox {
        &self.outbox
    }

    /// The robot's clock: the newest stamp that came in.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Takes a message; `at` is when it came.
    pub fn take(&mut self, message: Inbound, at: Instant) {
        match message {
            Inbound::Tf(tf) => self.take_transforms(&tf, false),
            Inbound::TfStatic(tf) => self.take_transforms(&tf, true),
            Inbound::Wrench(wrench) => self.take_wrench(&wrench, at),
            Inbound::Contact(contact) => {
                self.tick(contact.header.stamp);
                let candidate_id = self.candidate_of(&contact);
                self.wait_for_tf(Measurement::Contact { contact, candidate_id }, at);
            }
            Inbound::CameraInfo(camera) => self.camera = Some(camera),
            Inbound::Cloud(cloud) => {
                self.tick(cloud.header.stamp);
                if self.is_view_wanted {
                    self.wait_for_tf(Measurement::Cloud(cloud), at);
                }
            }
            Inbound::Image(image) => {
                self.tick(image.header.stamp);
                match self.camera.clone().filter(|_| self.is_view_wanted) {
                    Some(camera) => self.wait_for_tf(Measurement::Image(image, camera), at),
                    None if self.is_view_wanted => {
                        self.diagnostics.set(
                            "view",
                            Level::Warn,
                            "topic depth/image has come and depth/camera_info not: remap it, too",
                        );
                    }
                    None => {}
                }
            }
        }
        self.settle(at);
    }

    /// Looks at what waits; to be called now and then also when nothing comes.
    pub fn settle(&mut self, at: Instant) {
        let patience = Duration::from_secs_f64(self.parameters.tf.timeout_s);
        while let Some((since, measurement)) = self.waiting.front() {
            let is_patient = at.saturating_duration_since(*since) < patience;
            let order = match self.order_of(measurement) {
                Err(Unready::Waits(_)) if is_patient => return,
                Err(Unready::Waits(error)) => Err(error.to_string()),
                Err(Unready::Wrong(error)) => Err(error),
                Ok(command) => self.outbox.put(command),
            };
            let is_view = measurement.is_view();
            let (part, what) = measurement.names();
            if let Err(error) = order {
                self.diagnostics.set(part, Level::Error, &format!("{what}: {error}"));
                // The next one may be better.
                self.is_view_wanted |= is_view;
            } else {
                self.diagnostics.set(part, Level::Ok, "the last one is on its way to the server");
            }
            self.waiting.pop_front();
        }
    }

    /// Takes what the driver tells, and gives back what is to be published.
    pub fn update(&mut self, update: Update) -> Vec<Outbound> {
        let header = Header { stamp: self.now, frame_id: self.parameters.frame_id.clone() };
        match update {
            Update::Opened(session) => {
                self.is_view_wanted = self.parameters.prior == PriorPolicy::First
                    && session.state() == SessionState::AwaitingPrior;
                self.propose(
                    Proposal { session_id: session.session_id.clone(), ..Proposal::default() },
                    header,
                )
            }
            Update::Proposed(proposal) => self.propose(proposal, header),
            Update::Surface(surface) => {
                vec![Outbound::Mesh(surface.mesh()), Outbound::Marker(Box::new(surface.marker(header)))]
            }
            Update::Touched(touched) => vec![Outbound::Attractors(attractors(&touched, header))],
            Update::Warnings(warnings) => {
                self.diagnostics.set_warnings(&warnings);
                Vec::new()
            }
            Update::Server(state) => {
                let waiting = vec![("waiting_reports".to_owned(), self.outbox.waiting().to_string())];
                let (level, message) = match state {
                    Ok(()) => (Level::Ok, "answers".to_owned()),
                    Err(error) => (Level::Error, format!("{error}; what is reported is kept and sent again")),
                };
                self.diagnostics.set_with("server", level, &message, waiting);
                Vec::new()
            }
            Update::Session(state) => {
                self.report_state("session", state);
                Vec::new()
            }
            Update::View(state) => {
                self.is_view_wanted |= state.is_err() && self.parameters.prior == PriorPolicy::First;
                self.report_state("view", state);
                Vec::new()
            }
            Update::Report(state) => {
                self.report_state("report", state);
                Vec::new()
            }
        }
    }

    /// The next cloud or depth image becomes a view.
    pub fn take_view(&mut self) {
        self.is_view_wanted = true;
    }

    /// The next samples are the tare of the contact detector.
    pub fn tare(&mut self) {
        self.detector.tare();
    }

    fn report_state(&mut self, part: &str, state: Result<String, String>) {
        match state {
            Ok(message) => self.diagnostics.set(part, Level::Ok, &message),
            Err(error) => self.diagnostics.set(part, Level::Error, &error),
        }
    }

    fn propose(&mut self, proposal: Proposal, header: Header) -> Vec<Outbound> {
        let details = proposal.details(header.clone());
        if !details.should_stop.is_empty() {
            self.diagnostics.set(
                "stop",
                Level::Warn,
                &format!("the server advises to stop: {}", details.should_stop),
            );
        } else {
            self.diagnostics.set("stop", Level::Ok, "go on");
        }
        let poses = Outbound::Candidates(proposal.poses(header.clone()));
        let best = proposal.best(header).map(Outbound::Candidate);
        // The same candidate again, asked for anew, is no other one.
        let best_id = |proposal: &Proposal| proposal.candidates.first().map(|best| best.candidate_id.clone());
        self.is_claimed &= best_id(&self.proposal) == best_id(&proposal);
        self.proposal = proposal;
        best.into_iter().chain([poses, Outbound::Details(details)]).collect()
    }

    fn tick(&mut self, stamp: Time) {
        // A clock that went far back is another one: a simulation, or a recording from its beginning.
        let is_back = self.now.as_ns() - stamp.as_ns() > 10_000_000_000 && stamp.as_ns() > 0;
        if stamp > self.now || is_back {
            self.now = stamp;
        }
    }

    fn take_transforms(&mut self, tf: &TfMessage, is_static: bool) {
        let topic = if is_static { "/tf_static" } else { "/tf" };
        for transform in &tf.transforms {
            if !is_static {
                self.tick(transform.header.stamp);
            }
            if let Err(error) = self.transforms.insert(transform, is_static) {
                self.diagnostics.set("tf", Level::Error, &format!("topic {topic}: {error}"));
            }
        }
    }

    fn take_wrench(&mut self, wrench: &WrenchStamped, at: Instant) {
        self.tick(wrench.header.stamp);
        if !self.parameters.contact.enabled {
            return;
        }
        if !wrench.wrench.to_array().iter().all(|part| part.is_finite()) {
            self.diagnostics.set(
                "detector",
                Level::Error,
                "topic wrench: force or torque is NaN or infinite; such samples are passed over",
            );
        } else if self.detector.is_taring() {
            self.diagnostics.set("detector", Level::Ok, "taking the tare: nothing may touch the sensor");
        } else {
            self.diagnostics.set("detector", Level::Ok, "listens to the wrench");
        }
        if let Some(touch) = self.detector.sample(wrench.header.stamp.as_ns(), wrench.wrench) {
            let candidate_id = if self.parameters.follow_candidates { self.claim() } else { String::new() };
            let frame_id = frame(&wrench.header.frame_id).to_owned();
            self.wait_for_tf(Measurement::Touch { touch, frame_id, candidate_id }, at);
        }
    }

    /// The best candidate's id, once: a second touch before the next proposal is the robot's own.
    fn claim(&mut self) -> String {
        if std::mem::replace(&mut self.is_claimed, true) {
            return String::new();
        }
        self.proposal.candidates.first().map(|best| best.candidate_id.clone()).unwrap_or_default()
    }

    fn wait_for_tf(&mut self, measurement: Measurement, at: Instant) {
        if self.waiting.len() >= MOST_WAITING {
            let (part, what) = measurement.names();
            self.diagnostics.set(
                part,
                Level::Error,
                &format!("{what}: {MOST_WAITING} others wait for TF already; this one is lost"),
            );
            return;
        }
        if measurement.is_view() {
            self.is_view_wanted = false;
        }
        self.waiting.push_back((at, measurement));
    }

    fn order_of(&self, measurement: &Measurement) -> Result<Command, Unready> {
        match measurement {
            Measurement::Touch { touch, frame_id, candidate_id } => self.touch(touch, frame_id, candidate_id),
            Measurement::Contact { contact, candidate_id } => self.contact(contact, candidate_id),
            Measurement::Cloud(cloud) => self.cloud(cloud),
            Measurement::Image(image, camera) => self.depth_image(image, camera),
        }
    }

    fn candidate(&self, candidate_id: &str) -> Option<&v1::Candidate> {
        self.proposal.candidates.iter().find(|candidate| candidate.candidate_id == candidate_id)
    }
}

impl Measurement {
    fn is_view(&self) -> bool {
        matches!(self, Self::Cloud(_) | Self::Image(..))
    }

    /// The part of the diagnostics that it belongs to, and what it is called there.
    fn names(&self) -> (&'static str, &'static str) {
        match self {
            Self::Touch { .. } => ("wrench", "a touch on topic wrench is lost"),
            Self::Contact { .. } => ("contact", "a message on topic contact is lost"),
            Self::Cloud(_) => ("view", "topic points"),
            Self::Image(..) => ("view", "topic depth/image"),
        }
    }
}
