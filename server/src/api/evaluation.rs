//! How near the estimates of a session are to a true surface: all metrics, at any revisions.

use std::collections::BTreeMap;
use std::sync::Arc;

use palpate_core::metrics::{Comparison, MetricsError, Reference, Sampling, StatedError, coverage};
use palpate_core::reconstruction::Stats;
use palpate_proto::v1;
use tokio::time::Instant;

use super::references::Truth;
use super::{Api, Call};
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::limits::Limits;
use crate::session::Snapshot;
use crate::sessions::Aggregate;
use crate::wire::from_proto::{self, ReferenceFile, ReferenceNames};

const NAMES: ReferenceNames = ReferenceNames { mesh: "reference_mesh", format: "reference_format" };

impl Api {
    /// Compares the estimates of some revisions with a reference mesh.
    ///
    /// # Errors
    /// No such session or revision, nothing was seen at one of them, or there is nothing to compare with.
    pub(crate) async fn evaluate_session(
        &self,
        request: v1::EvaluateSessionRequest,
        call: Call,
    ) -> Result<v1::EvaluateSessionResponse, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("EvaluateSession", &session_id, &call, async |deadline| {
            let sampling = sampling(request.samples, request.seed, &self.limits)?;
            let sent = sent_file(&request)?;
            check_count(&request.revisions, &self.limits)?;
            let newest = self.sessions.at_revision(&session_id, 0, Queue::READERS, deadline).await?;
            let revisions = revisions(&request.revisions, newest.revision)?;
            let truth = match &sent {
                Some(file) => self.read_reference(file.clone(), NAMES, &session_id, deadline).await?,
                None => self.kept_truth(&session_id, Queue::READERS, deadline).await?,
            };
            let surface = self.sampled(&truth, sampling, &session_id, deadline).await?;
            let found = self.compared(&newest, &revisions, surface, deadline).await?;
            if let (Some(file), true) = (&sent, request.keep_reference) {
                self.keep_reference(&session_id, newest.definition.created_us, &truth, &file.bytes).await?;
            }
            let evaluations = revisions.iter().filter_map(|revision| found.get(revision).copied()).collect();
            Ok(v1::EvaluateSessionResponse { evaluations })
        })
        .await
    }

    /// The same true surface with samples of another number or seed.
    async fn sampled(
        &self,
        truth: &Truth,
        sampling: Sampling,
        session_id: &str,
        deadline: Instant,
    ) -> Result<Arc<Reference>, Error> {
        if sampling == Sampling::default() {
            return Ok(truth.surface.clone());
        }
        let known = truth.surface.clone();
        let sample = move || Reference::new(known.truth().clone(), sampling);
        let sampled =
            self.sessions.pool.run(Queue::READERS, Work::Comparison, session_id, deadline, sample).await?;
        Ok(Arc::new(sampled.map_err(incomparable)?))
    }

    /// The comparison of each of these revisions, computed in their order so that the log is folded once.
    async fn compared(
        &self,
        newest: &Arc<Snapshot>,
        revisions: &[i64],
        truth: Arc<Reference>,
        deadline: Instant,
    ) -> Result<BTreeMap<i64, v1::Evaluation>, Error> {
        let (session_id, _) = newest.identity();
        let pool = &self.sessions.pool;
        let of_itself = truth.clone();
        let floor = move || of_itself.chamfer_floor();
        let floor = pool
            .run(Queue::READERS, Work::Comparison, session_id, deadline, floor)
            .await?
            .map_err(incomparable)?;
        let mut found: BTreeMap<i64, v1::Evaluation> = BTreeMap::new();
        let mut ordered = revisions.to_vec();
        ordered.sort_unstable();
        ordered.dedup();
        for revision in ordered {
            let state = if revision == newest.revision {
                newest.clone()
            } else {
                self.sessions.at_revision(session_id, revision, Queue::READERS, deadline).await?
            };
            let truth = truth.clone();
            let compare = move || evaluation(&state, &truth, floor.sum_m);
            found.insert(
                revision,
                pool.run(Queue::READERS, Work::Comparison, session_id, deadline, compare).await??,
            );
        }
        Ok(found)
    }
}

fn sampling(samples: u32, seed: u64, limits: &Limits) -> Result<Sampling, Error> {
    if samples > limits.samples {
        let description = format!("{samples} is more than the limit of {}", limits.samples);
        return Err(Error::field("samples", description));
    }
    let default = Sampling::default();
    let chamfer_points = if samples == 0 { default.chamfer_points } else { samples as usize };
    Ok(Sampling { chamfer_points, seed, ..default })
}

/// The file that came with the request; nothing where the session's own is meant.
fn sent_file(request: &v1::EvaluateSessionRequest) -> Result<Option<ReferenceFile>, Error> {
    let v1::EvaluateSessionRequest {
        reference_mesh, reference_format, metres_per_unit, keep_reference, ..
    } = request;
    if !reference_mesh.is_empty() {
        return from_proto::reference_file(
            reference_mesh.clone(),
            *reference_format,
            *metres_per_unit,
            NAMES,
        )
        .map(Some);
    }
    let given = [
        ("reference_format", *reference_format != 0),
        ("metres_per_unit", *metres_per_unit != 0.0),
        ("keep_reference", *keep_reference),
    ];
    match given.into_iter().find_map(|(name, is_given)| is_given.then_some(name)) {
        Some(name) => Err(Error::field(name, "is about reference_mesh, which is empty: send the file")),
        None => Ok(None),
    }
}

fn check_count(revisions: &[i64], limits: &Limits) -> Result<(), Error> {
    let (found, most) = (revisions.len(), limits.evaluated_revisions);
    if found <= most {
        return Ok(());
    }
    Err(Error::field("revisions", format!("{found} are more than the limit of {most}: ask several times")))
}

/// The revisions that are asked for, 0 being the newest.
fn revisions(wanted: &[i64], head: i64) -> Result<Vec<i64>, Error> {
    if wanted.is_empty() {
        return Ok(vec![head]);
    }
    let revision = |(index, &wanted): (usize, &i64)| match wanted {
        0 => Ok(head),
        wanted if (1..=head).contains(&wanted) => Ok(wanted),
        other => {
            let description = format!("{other} is not between 1 and the session's revision {head}");
            Err(Error::field(format!("revisions[{index}]"), description))
        }
    };
    wanted.iter().enumerate().map(revision).collect()
}

fn evaluation(state: &Snapshot, truth: &Reference, floor_m: f64) -> Result<v1::Evaluation, Error> {
    let surface = state.reconstruction.surface().ok_or(Error::NoVisualPrior)?;
    let Comparison { surface_distance_m, hausdorff_m, f_score_1mm, coverage: covered, volume_ratio, chamfer } =
        truth.compare(&surface.mesh).map_err(incomparable)?;
    let stated = surface.std_m.as_ref().map(|std_m| truth.stated_errors(&surface.mesh, std_m));
    let stated: Option<Vec<StatedError>> = stated.transpose().map_err(incomparable)?;
    let within = |sigmas: f64| stated.as_ref().map_or(0.0, |stated| coverage(stated, sigmas));
    let &Stats { failures, early_contacts, no_contacts, rejected, invalid_contacts, attempts, .. } =
        &state.stats;
    Ok(v1::Evaluation {
        revision: state.revision,
        surface_distance_m,
        chamfer_sum_m: chamfer.sum_m,
        chamfer_mean_m: chamfer.mean_m,
        hausdorff_m,
        f_score_1mm,
        coverage: covered,
        // A plate encloses nothing.
        volume_ratio: if volume_ratio.is_finite() { volume_ratio } else { 0.0 },
        failures,
        calibration_2sigma: within(2.0),
        calibration_1sigma: within(1.0),
        has_calibration: stated.is_some(),
        early_contacts,
        no_contacts,
        rejected,
        invalid_contacts,
        attempts,
        chamfer_floor_m: floor_m,
    })
}

/// Estimates have an area and finite vertices, and the true surface was checked when it was read.
fn incomparable(error: MetricsError) -> Error {
    Error::internal(format!("an estimate cannot be compared: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn revisions_are_within_the_session_and_0_is_the_newest() {
        assert_eq!(revisions(&[], 7).unwrap(), [7]);
        assert_eq!(revisions(&[3, 0, 3], 7).unwrap(), [3, 7, 3]);
        for wrong in [8, -1] {
            assert_eq!(revisions(&[2, wrong], 7).unwrap_err().fields()[0].field, "revisions[1]");
        }
    }

    #[test]
    fn what_is_said_of_a_file_needs_the_file() {
        let field =
            |request: v1::EvaluateSessionRequest| sent_file(&request).unwrap_err().fields()[0].field.clone();
        let keep = v1::EvaluateSessionRequest { keep_reference: true, ..Default::default() };
        assert_eq!(field(keep), "keep_reference");
        let scaled = v1::EvaluateSessionRequest { metres_per_unit: 0.001, ..Default::default() };
        assert_eq!(field(scaled), "metres_per_unit");
        assert!(sent_file(&v1::EvaluateSessionRequest::default()).unwrap().is_none());
    }
}
