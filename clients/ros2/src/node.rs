//! The ROS 2 node: topics and services around a [`Bridge`], and nothing else.
//!
//! Each subscription and each service is a task that puts what it hears into one channel; one loop owns the bridge and
//! publishes. So nothing is locked, and what a robot sends stays in order.

mod participant;
mod services;
mod topics;

use std::time::{Duration, Instant};

use ros2_client::{NodeName, NodeOptions};
use tokio::sync::mpsc;
use tokio::time::interval;

use crate::bridge::{Bridge, Inbound};
use crate::driver;
use crate::messages::{CreateSessionRequest, Time};
use crate::names::Names;
use crate::outbox::{Command, NewSession, Outbox};
use crate::parameters::{Parameters, session_config};

pub use participant::Network;
use services::Asked;
pub use topics::Inputs;
use topics::Publishers;

/// How often `/diagnostics` is published, and how often it is looked at what waits for TF and whether there is news.
const DIAGNOSTICS_INTERVAL: Duration = Duration::from_secs(1);
const SETTLE_INTERVAL: Duration = Duration::from_millis(50);
/// Messages that may wait for the loop; a bridge that is behind must not grow.
const MOST_MESSAGES: usize = 1024;

/// What arrives over DDS.
enum Arrival {
    Message(Box<Inbound>),
    Service(Asked),
}

/// Runs the node until it is interrupted.
///
/// # Errors
/// What keeps it from running, in words.
pub async fn run(parameters: Parameters, names: &Names, network: &Network) -> Result<(), String> {
    let context = network.context()?;
    let name = NodeName::new(&names.namespace, &names.node)
        .map_err(|error| format!("node {} in {}: {error}", names.node, names.namespace))?;
    // Parameters are set at the start and not later, so there is nothing for parameter services to do.
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    let mut node = context.new_node(name, options).map_err(|error| format!("no node: {error}"))?;
    let spinner = node.spinner().map_err(|error| format!("no spinner: {error}"))?;
    let (arrive, mut arrivals) = mpsc::channel(MOST_MESSAGES);
    let publishers = Publishers::new(&mut node, names)?;
    topics::subscribe(&mut node, &Inputs::resolve(names)?, parameters.reliable_sensors, &arrive)?;
    services::serve(&mut node, names, network.service_mapping(&parameters.rmw)?, &arrive)?;
    tokio::spawn(async move {
        if let Err(error) = spinner.spin().await {
            tracing::error!("the node's background work ended: {error}");
        }
    });

    let (outbox, orders) = Outbox::new(parameters.outbox_limit);
    let (tell, mut updates) = mpsc::channel(64);
    let mut bridge = Bridge::new(parameters.clone(), outbox, &names.node);
    let mut driving = tokio::spawn(driver::drive(parameters, orders, tell));
    let (mut diagnose, mut settle) = (interval(DIAGNOSTICS_INTERVAL), interval(SETTLE_INTERVAL));
    tracing::info!("listens in ROS_DOMAIN_ID {} as {}", context.domain_id(), node.fully_qualified_name());
    loop {
        tokio::select! {
            Some(arrival) = arrivals.recv() => match arrival {
                Arrival::Message(message) => bridge.take(*message, Instant::now()),
                Arrival::Service(asked) => answer(&mut bridge, asked),
            },
            Some(update) = updates.recv() => publishers.publish(bridge.update(update)),
            _ = diagnose.tick() => publishers.diagnose(bridge.diagnostics().array(stamp(&bridge))),
            _ = settle.tick() => {
                bridge.settle(Instant::now());
                if bridge.has_news() {
                    publishers.diagnose(bridge.diagnostics().array(stamp(&bridge)));
                }
            }
            ended = &mut driving => return ended.map_err(|error| format!("the driver ended: {error}"))?,
            interrupted = tokio::signal::ctrl_c() => {
                return interrupted.map_err(|error| format!("no signals: {error}"));
            }
        }
    }
}

/// The robot's clock, or this machine's before the robot said anything.
fn stamp(bridge: &Bridge) -> Time {
    let now = bridge.now();
    if now != Time::default() {
        return now;
    }
    let since = std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    Time::from_ns(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
}

/// Does at once what the bridge does itself, and gives the rest to the driver.
fn answer(bridge: &mut Bridge, asked: Asked) {
    let (waiting, command) = match asked {
        Asked::Tare(waiting) => {
            bridge.tare();
            return waiting
                .say(Ok("the next samples of topic wrench are the tare: nothing may touch the sensor"));
        }
        Asked::TakeView(waiting) => {
            bridge.take_view();
            return waiting.say(Ok("the next cloud or depth image becomes a view"));
        }
        Asked::NoContact(waiting) => (waiting, bridge.no_contact()),
        Asked::Reject(waiting, request) => {
            (waiting, bridge.reject(&request.candidate_id, request.reason, &request.detail))
        }
        Asked::Propose(waiting, request) => (waiting, Ok(Command::Propose(request.top_k))),
        Asked::Finish(waiting, request) => (waiting, Ok(Command::Finish(request.note))),
        Asked::Create(waiting, request) => (waiting, create(request)),
    };
    match command.and_then(|command| bridge.outbox().ask(command)) {
        Ok(answer) => waiting.wait(answer),
        Err(error) => waiting.say(Err(&error)),
    }
}

fn create(request: CreateSessionRequest) -> Result<Command, String> {
    let CreateSessionRequest { session_id, display_name, experiment, config } = request;
    let config = match config.trim() {
        "" => None,
        json => {
            let values = serde_json::from_str(json).map_err(|error| format!("config is no JSON: {error}"))?;
            Some(session_config(&values).map_err(|error| format!("config: {error}"))?)
        }
    };
    Ok(Command::Create(Box::new(NewSession { session_id, display_name, experiment, config })))
}
