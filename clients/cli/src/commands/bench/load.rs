//! The load: robots that touch at once, by their own pace or by a clock.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use palpate_client::proto::v1::{
    CreateSessionRequest, Method, ReportContactRequest, ReportContactResponse, SessionConfig, StopRule,
};
use palpate_client::{Client, Error};
use palpate_simulator::body::Body;
use palpate_simulator::robot::{Plan, Robot};
use palpate_simulator::shapes;
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep, sleep_until, timeout_at};

use super::figures::Answer;
use crate::failure::Failure;

/// What is touched: a body that casts no doubt, and costs the robots little.
const OBJECT: &str = "can";
/// A robot that is refused without being told when to ask again waits so long.
const PAUSE: Duration = Duration::from_millis(100);

/// What the robots do.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load {
    pub(super) sessions: u32,
    /// Contacts that each robot reports.
    pub(super) attempts: u32,
    /// Contacts a second in all; each robot goes on as soon as it is answered where there is none.
    pub(super) rate: Option<f64>,
    /// How long a robot waits for an answer, refusals included.
    pub(super) deadline: Duration,
    pub(super) method: Method,
    /// Whether a robot goes to another server with each call; it stays with one otherwise.
    pub(super) is_hopping: bool,
}

impl Load {
    /// Robots that have looked at their object, each in a session of its own.
    ///
    /// # Errors
    /// The server refuses, or does not answer.
    pub(super) async fn begin(&self, clients: &[Client]) -> Result<Vec<Robot<'static>>, Failure> {
        // It is read by all robots until the program ends.
        let body: &'static Body = Box::leak(Box::new(shapes::generate(OBJECT)?));
        let bar = bar(self.sessions.into(), "views")?;
        let mut robots = Vec::new();
        for number in 0..self.sessions {
            robots.push(self.robot(&clients[number as usize % clients.len()], body, number).await?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(robots)
    }

    async fn robot(
        &self,
        client: &Client,
        body: &'static Body,
        number: u32,
    ) -> Result<Robot<'static>, Failure> {
        let stop = StopRule { max_attempts: Some(self.attempts), ..StopRule::default() };
        let config =
            SessionConfig { method: self.method.into(), stop: Some(stop), ..SessionConfig::default() };
        let session = CreateSessionRequest {
            experiment: "bench".to_owned(),
            labels: BTreeMap::from([("robot".to_owned(), number.to_string())]),
            config: Some(config),
            ..CreateSessionRequest::default()
        };
        let (seed, attempts) = (number.into(), self.attempts);
        let plan = Plan { session, seed, attempts, ..Plan::default() };
        Ok(Robot::begin(client.clone(), body, plan).await?)
    }

    /// Lets all robots touch, and says what became of each contact and how long all of it took.
    ///
    /// # Errors
    /// A robot was answered what no server answers.
    pub(super) async fn run(
        &self,
        clients: &[Client],
        robots: Vec<Robot<'static>>,
    ) -> Result<(Vec<Answer>, Duration), Failure> {
        let bar = bar(u64::from(self.sessions) * u64::from(self.attempts), "contacts")?;
        let (clients, start) = (Arc::from(clients), Instant::now());
        let mut exploring = JoinSet::new();
        for (number, robot) in robots.into_iter().enumerate() {
            let clients = Arc::clone(&clients);
            let explorer = Explorer { load: *self, clients, number, start, bar: bar.clone() };
            exploring.spawn(explorer.explore(robot));
        }
        let mut answers = Vec::new();
        while let Some(explored) = exploring.join_next().await {
            answers.extend(explored??);
        }
        bar.finish_and_clear();
        Ok((answers, start.elapsed()))
    }

    /// When a robot's contact is due, after the start: those of all robots follow each other evenly.
    fn due(&self, robot: usize, contact: u32) -> Option<Duration> {
        let number = f64::from(contact) * f64::from(self.sessions) + robot as f64;
        self.rate.map(|rate| Duration::from_secs_f64(number / rate))
    }
}

/// One robot at work.
#[derive(Debug)]
struct Explorer {
    load: Load,
    /// Of all servers.
    clients: Arc<[Client]>,
    number: usize,
    start: Instant,
    bar: ProgressBar,
}

impl Explorer {
    async fn explore(self, mut robot: Robot<'static>) -> Result<Vec<Answer>, Failure> {
        let mut answers = Vec::new();
        for contact in 0..self.load.attempts {
            let due = self.load.due(self.number, contact).map(|after| self.start + after);
            if let Some(due) = due {
                sleep_until(due).await;
            }
            let Some((touched, report)) = robot.touch()? else { break };
            let from = due.unwrap_or_else(Instant::now);
            let request_id = format!("{}-{contact}", report.session_id);
            let report = ReportContactRequest { request_id, ..report };
            let (reply, refusals) = self.report(report, contact, from).await?;
            let waited = from.elapsed();
            self.bar.inc(1);
            let is_answered = reply.is_some();
            answers.push(Answer {
                robot: self.number,
                contact,
                since: from - self.start,
                waited,
                refusals,
                is_answered,
            });
            match reply {
                Some(reply) => drop(robot.accept(touched, reply)?),
                // Whoever gives up does not know where to touch next.
                None => break,
            }
        }
        Ok(answers)
    }

    /// The server of a call: the robot's own, or the next one each time.
    fn server(&self, call: u32) -> &Client {
        let hops = if self.load.is_hopping { call as usize } else { 0 };
        &self.clients[(self.number + hops) % self.clients.len()]
    }

    /// Reports until it is answered or the deadline has passed, and counts the refusals on the way.
    async fn report(
        &self,
        report: ReportContactRequest,
        contact: u32,
        from: Instant,
    ) -> Result<(Option<ReportContactResponse>, u32), Failure> {
        let deadline = from + self.load.deadline;
        let mut refusals = 0;
        loop {
            match timeout_at(deadline, self.server(contact + refusals).report_contact(report.clone())).await {
                Ok(Ok(reply)) => return Ok((Some(reply), refusals)),
                Ok(Err(error)) if error.is_transient() => {
                    refusals += 1;
                    let pause = sleep(asked_for(&error));
                    if timeout_at(deadline, pause).await.is_err() {
                        return Ok((None, refusals));
                    }
                }
                Ok(Err(error)) => return Err(error.into()),
                Err(_elapsed) => return Ok((None, refusals)),
            }
        }
    }
}

/// How long the server wants a robot to wait.
fn asked_for(error: &Error) -> Duration {
    error.refusal().and_then(|refusal| refusal.retry_after).unwrap_or(PAUSE)
}

fn bar(length: u64, what: &str) -> Result<ProgressBar, Failure> {
    let bar = ProgressBar::new(length);
    bar.set_style(ProgressStyle::with_template("{bar:15} {pos}/{len} {msg}, {eta} left")?);
    bar.set_message(what.to_owned());
    Ok(bar)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contacts_of_all_robots_are_due_evenly() {
        let load = Load {
            sessions: 4,
            attempts: 10,
            rate: Some(20.0),
            deadline: Duration::from_secs(1),
            method: Method::Unspecified,
            is_hopping: false,
        };
        let due = |robot, contact| load.due(robot, contact).unwrap().as_millis();
        assert_eq!([due(0, 0), due(1, 0), due(3, 0), due(0, 1), due(3, 9)], [0, 50, 150, 200, 1950]);
        assert_eq!(Load { rate: None, ..load }.due(0, 0), None);
    }
}
