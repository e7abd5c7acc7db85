//! The loop of every exploration: step, count what failed, compare the estimate with the truth.

use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_client::Client;
use palpate_client::proto::v1::Session;
use palpate_core::geometry::TriangleMesh;
use palpate_core::metrics::{MetricsError, Reference};
use palpate_simulator::body::Body;
use palpate_simulator::probe::Outcome;
use palpate_simulator::robot::{Attempt, Estimate, Plan, Robot};

use super::warnings::is_telling;
use crate::failure::Failure;

/// What is computed from an estimate and the truth after every attempt.
pub(in crate::commands) type Metric<T> = fn(&Reference, &TriangleMesh) -> Result<T, MetricsError>;

/// A robot whose estimate is compared with the truth after every attempt.
#[derive(Debug)]
pub(in crate::commands) struct MeasuredRobot<'a, T> {
    robot: Robot<'a>,
    reference: Arc<Reference>,
    metric: Metric<T>,
    /// The latest estimate, with the object back where it stood at first if it has moved: where the reference is.
    pub(in crate::commands) estimate: Estimate,
    /// How far the latest estimate is from the truth.
    pub(in crate::commands) errors: T,
    /// Attempts that met nothing.
    pub(in crate::commands) missed: u32,
    /// Attempts that met something before they were there.
    pub(in crate::commands) early: u32,
    /// Attempts that were reported as contacts and met nothing.
    pub(in crate::commands) false_contacts: u32,
    /// Replies with a warning that something is wrong.
    pub(in crate::commands) warned: u32,
    /// The time that the robot waited for the server's replies to its reports.
    pub(in crate::commands) touching: Duration,
}

impl<'a, T: Send + 'static> MeasuredRobot<'a, T> {
    /// Creates the session, looks at the object and compares the first estimate.
    pub(in crate::commands) async fn begin(
        client: Client,
        body: &'a Body,
        reference: Arc<Reference>,
        plan: Plan,
        metric: Metric<T>,
    ) -> Result<Self, Failure> {
        let mut robot = Robot::begin(client, body, plan).await?;
        let estimate = robot.estimate().await?;
        let errors = compare(&reference, &estimate.mesh, metric).await?;
        let mut measured = Self {
            robot,
            reference,
            metric,
            estimate,
            errors,
            missed: 0,
            early: 0,
            false_contacts: 0,
            warned: 0,
            touching: Duration::ZERO,
        };
        measured.warned = has_telling(measured.view_warnings());
        Ok(measured)
    }

    /// Makes the next attempt; `None` when the exploration is finished.
    pub(in crate::commands) async fn step(&mut self) -> Result<Option<Attempt>, Failure> {
        let started = Instant::now();
        let Some(attempt) = self.robot.step().await? else { return Ok(None) };
        self.touching += started.elapsed();
        match attempt.outcome {
            Outcome::Hit(_) => {}
            Outcome::Early(_) => self.early += 1,
            Outcome::Miss => self.missed += 1,
            Outcome::False(_) => self.false_contacts += 1,
        }
        self.warned += has_telling(&attempt.warnings);
        let displacement = self.robot.displacement();
        let mut estimate = self.robot.estimate().await?;
        estimate.mesh.vertices.iter_mut().for_each(|vertex| *vertex -= displacement);
        let before = std::mem::replace(&mut self.estimate, estimate);
        // A failure may leave the estimate as it was, and then its errors too.
        if self.estimate.mesh != before.mesh {
            self.errors = self.measure(self.metric).await?;
        }
        Ok(Some(attempt))
    }

    /// Compares the latest estimate in another manner.
    pub(in crate::commands) async fn measure<U: Send + 'static>(
        &self,
        metric: Metric<U>,
    ) -> Result<U, Failure> {
        compare(&self.reference, &self.estimate.mesh, metric).await
    }

    /// The session as of the last reply.
    pub(in crate::commands) fn session(&self) -> &Session {
        self.robot.session()
    }

    /// What the server found odd about the view.
    pub(in crate::commands) fn view_warnings(&self) -> &[String] {
        self.robot.view_warnings()
    }

    /// Over the vertices of the latest estimate; 1 where nothing is known.
    pub(in crate::commands) fn mean_uncertainty(&self) -> f64 {
        self.session().stats.as_ref().map_or(1.0, |stats| stats.mean_uncertainty)
    }

    /// The latest estimate as a PLY file.
    pub(in crate::commands) async fn ply(&self) -> Result<Vec<u8>, Failure> {
        Ok(self.robot.ply().await?)
    }
}

/// One if a reply with these warnings says that something is wrong.
fn has_telling(warnings: &[String]) -> u32 {
    u32::from(warnings.iter().any(|warning| is_telling(warning)))
}

/// Compares off the async executor, which has a server to run.
async fn compare<T: Send + 'static>(
    reference: &Arc<Reference>,
    mesh: &TriangleMesh,
    metric: Metric<T>,
) -> Result<T, Failure> {
    let (reference, mesh) = (Arc::clone(reference), mesh.clone());
    Ok(tokio::task::spawn_blocking(move || metric(&reference, &mesh)).await??)
}

/// One word for how an approach ended.
pub(in crate::commands) fn outcome_name(outcome: &Outcome) -> &'static str {
    match outcome {
        Outcome::Hit(_) => "hit",
        Outcome::Early(_) => "early",
        Outcome::Miss => "miss",
        Outcome::False(_) => "false",
    }
}
