//! The topics: what is listened to, what is published, and by which quality of service.

use std::pin::pin;

use futures_util::StreamExt;
use ros2_client::qos::{Durability, History, QosProfile, WhenFull};
use ros2_client::{MessageTypeName, Name, Node, Publisher};
use tokio::sync::mpsc;

use super::Arrival;
use crate::bridge::{Inbound, Outbound};
use crate::messages::{
    Candidates, DiagnosticArray, Marker, Mesh, PointCloud2, PoseArray, PoseStamped, RosMessage,
};
use crate::names::Names;

/// The whole names of the topics that are listened to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Inputs {
    /// `geometry_msgs/WrenchStamped`.
    pub wrench: String,
    /// `sensor_msgs/PointCloud2`.
    pub points: String,
    /// `sensor_msgs/Image`.
    pub image: String,
    /// `sensor_msgs/CameraInfo`.
    pub camera_info: String,
    /// `palpate_msgs/Contact`.
    pub contact: String,
    /// `tf2_msgs/TFMessage`.
    pub tf: String,
    /// `tf2_msgs/TFMessage`, latched.
    pub tf_static: String,
}

impl Inputs {
    /// The names after remapping.
    ///
    /// # Errors
    /// A rule whose target is no name.
    pub fn resolve(names: &Names) -> Result<Self, String> {
        Ok(Self {
            wrench: names.resolve("wrench")?,
            points: names.resolve("points")?,
            image: names.resolve("depth/image")?,
            camera_info: names.resolve("depth/camera_info")?,
            contact: names.resolve("contact")?,
            tf: names.resolve("/tf")?,
            tf_static: names.resolve("/tf_static")?,
        })
    }
}

fn reliable(depth: usize) -> QosProfile {
    QosProfile::publisher_default().history(History::KeepLast { depth })
}

/// The last one is there for who comes later, such as RViz.
fn latched(depth: usize) -> QosProfile {
    reliable(depth).durability(Durability::TransientLocal).reliability_reliable(WhenFull::DEFAULT)
}

/// Listens to all inputs.
pub(super) fn subscribe(
    node: &mut Node,
    inputs: &Inputs,
    reliable_sensors: bool,
    arrive: &mpsc::Sender<Arrival>,
) -> Result<(), String> {
    // Best effort hears both kinds of publishers; reliable ones only what is sent reliably.
    let sensor =
        |depth| if reliable_sensors { reliable(depth) } else { reliable(depth).reliability_best_effort() };
    listen(node, &inputs.wrench, sensor(1000), Inbound::Wrench, arrive)?;
    listen(node, &inputs.points, sensor(2), Inbound::Cloud, arrive)?;
    listen(node, &inputs.image, sensor(2), Inbound::Image, arrive)?;
    listen(node, &inputs.camera_info, sensor(2), Inbound::CameraInfo, arrive)?;
    listen(node, &inputs.contact, reliable(100), Inbound::Contact, arrive)?;
    listen(node, &inputs.tf, reliable(100), Inbound::Tf, arrive)?;
    listen(node, &inputs.tf_static, latched(100), Inbound::TfStatic, arrive)
}

fn listen<M: RosMessage>(
    node: &mut Node,
    name: &str,
    qos: QosProfile,
    wrap: fn(M) -> Inbound,
    arrive: &mpsc::Sender<Arrival>,
) -> Result<(), String> {
    let failed = |error: &dyn std::fmt::Display| format!("topic {name}: {error}");
    let topic = node
        .create_topic(&parsed(name)?, MessageTypeName::new(M::PACKAGE, M::NAME), &qos)
        .map_err(|error| failed(&error))?;
    let subscription = node.create_subscription::<M>(&topic, Some(qos)).map_err(|error| failed(&error))?;
    let (arrive, name) = (arrive.clone(), name.to_owned());
    tokio::spawn(async move {
        let mut messages = pin!(subscription.async_stream());
        while let Some(message) = messages.next().await {
            match message {
                // The loop is behind: the sender waits, and DDS keeps as many as the depth says.
                Ok((message, _)) => {
                    if arrive.send(Arrival::Message(Box::new(wrap(message)))).await.is_err() {
                        return;
                    }
                }
                Err(error) => {
                    tracing::error!("topic {name} has a message that is no {}: {error}", M::full_name());
                }
            }
        }
    });
    Ok(())
}

pub(super) fn parsed(name: &str) -> Result<Name, String> {
    Name::parse(name).map_err(|error| format!("{name}: {error}"))
}

/// What is published.
pub(super) struct Publishers {
    candidate: Publisher<PoseStamped>,
    candidates: Publisher<PoseArray>,
    details: Publisher<Candidates>,
    mesh: Publisher<Mesh>,
    marker: Publisher<Marker>,
    attractors: Publisher<PointCloud2>,
    diagnostics: Publisher<DiagnosticArray>,
}

impl Publishers {
    pub(super) fn new(node: &mut Node, names: &Names) -> Result<Self, String> {
        Ok(Self {
            candidate: advertise(node, names, "~/candidate", latched(1))?,
            candidates: advertise(node, names, "~/candidates", latched(1))?,
            details: advertise(node, names, "~/candidate_details", latched(1))?,
            mesh: advertise(node, names, "~/mesh", latched(1))?,
            marker: advertise(node, names, "~/marker", latched(1))?,
            attractors: advertise(node, names, "~/attractors", latched(1))?,
            diagnostics: advertise(node, names, "/diagnostics", reliable(10))?,
        })
    }

    pub(super) fn publish(&self, messages: Vec<Outbound>) {
        for message in messages {
            match message {
                Outbound::Candidate(message) => send(&self.candidate, message),
                Outbound::Candidates(message) => send(&self.candidates, message),
                Outbound::Details(message) => send(&self.details, message),
                Outbound::Mesh(message) => send(&self.mesh, message),
                Outbound::Marker(message) => send(&self.marker, *message),
                Outbound::Attractors(message) => send(&self.attractors, message),
            }
        }
    }

    pub(super) fn diagnose(&self, message: DiagnosticArray) {
        send(&self.diagnostics, message);
    }
}

fn advertise<M: RosMessage>(
    node: &mut Node,
    names: &Names,
    name: &str,
    qos: QosProfile,
) -> Result<Publisher<M>, String> {
    let name = names.resolve(name)?;
    let failed = |error: &dyn std::fmt::Display| format!("topic {name}: {error}");
    let topic = node
        .create_topic(&parsed(&name)?, MessageTypeName::new(M::PACKAGE, M::NAME), &qos)
        .map_err(|error| failed(&error))?;
    node.create_publisher(&topic, Some(qos)).map_err(|error| failed(&error))
}

fn send<M: RosMessage>(publisher: &Publisher<M>, message: M) {
    if let Err(error) = publisher.publish(message) {
        tracing::warn!("a {} was not published: {error}", M::full_name());
    }
}
