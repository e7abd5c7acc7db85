//! Robots that explore at once, each in a session of its own, until they are told to stop.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use palpate_client::{Client, Error};
use palpate_proto::v1;
use tokio::sync::watch;
use tokio::task::JoinHandle;

use super::ball::{contact_at, directions, plausible};
use super::{creation, miss, prior, report, soon};

/// Robots at work.
#[derive(Debug)]
pub(crate) struct Robots {
    working: Vec<JoinHandle<Result<(String, u64), Error>>>,
    stop: watch::Sender<bool>,
    acknowledged: Arc<AtomicU64>,
}

impl Robots {
    /// Lets each of these clients explore.
    pub(crate) fn begin(clients: Vec<Client>) -> Self {
        let (stop, stopped) = watch::channel(false);
        let acknowledged = Arc::new(AtomicU64::new(0));
        let robot = |(number, client)| {
            tokio::spawn(explore(client, format!("robot-{number}"), stopped.clone(), acknowledged.clone()))
        };
        let working = clients.into_iter().enumerate().map(robot).collect();
        Self { working, stop, acknowledged }
    }

    /// How many results were acknowledged until now.
    pub(crate) fn acknowledged(&self) -> u64 {
        self.acknowledged.load(Ordering::Relaxed)
    }

    /// Waits until this many more are.
    pub(crate) async fn go_on(&self, more: u64) {
        let enough = self.acknowledged() + more;
        let going = async {
            while self.acknowledged() < enough && self.working.iter().any(|robot| !robot.is_finished()) {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        };
        soon("acknowledged results", going).await;
    }

    /// Stops all of them: how many results of each session were acknowledged, or the first error of any of them.
    pub(crate) async fn stop(self) -> Result<BTreeMap<String, u64>, Error> {
        self.stop.send_replace(true);
        let mut told = BTreeMap::new();
        for robot in self.working {
            let (session_id, count) = soon("a robot ends", robot).await.unwrap()?;
            told.insert(session_id, count);
        }
        Ok(told)
    }
}

/// Touches the ball all around, and misses it now and then.
async fn explore(
    client: Client,
    session_id: String,
    stop: watch::Receiver<bool>,
    acknowledged: Arc<AtomicU64>,
) -> Result<(String, u64), Error> {
    let places = directions(400);
    client.create_session(creation(&session_id)).await?;
    let mut candidate = client.add_visual_prior(prior(&session_id)).await?.candidates.pop();
    let mut count = 0;
    for (number, place) in places.iter().enumerate() {
        if *stop.borrow() {
            break;
        }
        let result = match candidate.take() {
            Some(candidate) if number % 5 == 4 => miss(&candidate),
            _ => contact_at(*place, 0.0, plausible(number)),
        };
        let said: v1::ReportContactRequest = report(&session_id, result, &format!("touch-{number}"));
        candidate = client.report_contact(said).await?.candidates.pop();
        count += 1;
        acknowledged.fetch_add(1, Ordering::Relaxed);
    }
    Ok((session_id, count))
}
