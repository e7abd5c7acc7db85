//! The camera's views of a session: any number of any size, thinned together to what the method can take.
//!
//! ```text
//! fits, and nothing was thinned yet ------> as it came
//! fits beside the others, at their edge --> the mean of each voxel that no earlier view has
//! does not fit ---------------------------> a longer edge for all views; the estimate is computed anew
//! ```
//!
//! All follows from the event and the state before it, so that a replay thins in the same way.

use std::sync::Arc;
use std::time::Instant;

use palpate_core::error::{Error, FieldError};
use palpate_core::evidence::{Evidence, VisualPrior};
use palpate_core::geometry::Point;
use palpate_core::reconstruction::{Reconstruction, Update};
use palpate_core::warning::{Warning, WarningKind};

use super::Snapshot;
use super::clutter::Clutter;
use crate::limits::VISUAL_POINTS;
use crate::voxel::{self, Grid};

/// What became of a view.
#[derive(Clone, Debug)]
pub(crate) struct AddedView {
    pub(crate) update: Update,
    /// Points of it that are in the estimate.
    pub(crate) accepted: usize,
    /// The edge of the voxels in which all views of the session are thinned, where it was needed.
    pub(crate) edge_m: Option<f64>,
    /// What of it was not taken for the object.
    pub(crate) clutter: Clutter,
}

/// The evidence of a session with what it amounts to, while more is added.
struct EvidenceLog {
    evidence: Vec<(i64, Arc<Evidence>)>,
    reconstruction: Reconstruction,
}

impl Snapshot {
    /// The session after one more view, accepted at `at_us`. Costs milliseconds, and much more where an
    /// estimate with many contacts has to be computed anew.
    ///
    /// # Errors
    /// Thinned with the earlier views, nothing is left of the first one.
    pub(crate) fn add_view(
        &self,
        view: &VisualPrior,
        keeps_clutter: bool,
        at_us: i64,
    ) -> Result<(Self, AddedView), Error> {
        let started = Instant::now();
        let support = self.definition.config.support.as_ref();
        let (view, clutter) = Clutter::taken_from(view, keeps_clutter, support);
        let view = &view;
        let mut clouds: Vec<&[Point]> =
            self.evidence.iter().filter_map(|(_, evidence)| points(evidence)).collect();
        let room = VISUAL_POINTS.saturating_sub(clouds.iter().map(|points| points.len()).sum());
        let new_points = match self.view_edge_m {
            None => view.points().to_vec(),
            Some(edge_m) => grid(&clouds, edge_m).add(view.points()),
        };
        let (mut log, edge_m, new_points) = if new_points.len() <= room {
            (self.log(), self.view_edge_m, new_points)
        } else {
            clouds.push(view.points());
            let edge_m = match self.view_edge_m {
                None => voxel::edge_for(&clouds, VISUAL_POINTS),
                // Doubled, so that what was thinned once still takes the voxels that it took as it came.
                Some(edge_m) => voxel::doubled_edge_for(&clouds, edge_m, VISUAL_POINTS),
            };
            let mut grid = Grid::new(edge_m);
            (self.log_with_views_in(&mut grid)?, Some(edge_m), grid.add(view.points()))
        };
        let accepted = new_points.len();
        let (update, accepted) = match (thinned(view, new_points), edge_m) {
            (Ok(view), _) => {
                (log.absorb(self.revision + 1, Arc::new(Evidence::VisualPrior(view)))?, accepted)
            }
            // Too few for a view, but only because the others show the rest.
            (Err(_), Some(edge_m)) if log.reconstruction.has_seen() => (nothing_new(edge_m), 0),
            (Err(refusal), _) => return Err(refusal.into()),
        };
        let EvidenceLog { evidence, reconstruction } = log;
        let next = self.next(reconstruction, evidence, at_us, started);
        Ok((Self { view_edge_m: edge_m, ..next }, AddedView { update, accepted, edge_m, clutter }))
    }

    fn log(&self) -> EvidenceLog {
        EvidenceLog { evidence: self.evidence.clone(), reconstruction: self.reconstruction.clone() }
    }

    /// The same evidence in the same order, with its views thinned in `grid`.
    fn log_with_views_in(&self, grid: &mut Grid) -> Result<EvidenceLog, Error> {
        let reconstruction = Reconstruction::new(self.definition.config.clone());
        let reconstruction =
            if self.reconstruction.is_deferring() { reconstruction.deferring() } else { reconstruction };
        let mut log = EvidenceLog { evidence: Vec::new(), reconstruction };
        for (seq, evidence) in &self.evidence {
            match &**evidence {
                Evidence::Attempt(_) | Evidence::Moved(_) => drop(log.absorb(*seq, evidence.clone())?),
                Evidence::VisualPrior(seen) => match thinned(seen, grid.add(seen.points())) {
                    Ok(seen) => drop(log.absorb(*seq, Arc::new(Evidence::VisualPrior(seen)))?),
                    Err(_) if log.reconstruction.has_seen() => {}
                    Err(_) => return Err(too_wide(grid.edge_m()).into()),
                },
            }
        }
        Ok(log)
    }
}

impl EvidenceLog {
    fn absorb(&mut self, seq: i64, evidence: Arc<Evidence>) -> Result<Update, Error> {
        let (reconstruction, update) = self.reconstruction.absorb(&evidence)?;
        self.reconstruction = reconstruction;
        self.evidence.push((seq, evidence));
        Ok(update)
    }
}

fn points(evidence: &Evidence) -> Option<&[Point]> {
    match evidence {
        Evidence::VisualPrior(view) => Some(view.points()),
        Evidence::Attempt(_) | Evidence::Moved(_) => None,
    }
}

/// The voxels that `clouds` take.
fn grid(clouds: &[&[Point]], edge_m: f64) -> Grid {
    let mut grid = Grid::new(edge_m);
    for points in clouds {
        grid.add(points);
    }
    grid
}

/// The same view with other points.
fn thinned(view: &VisualPrior, points: Vec<Point>) -> Result<VisualPrior, FieldError> {
    VisualPrior::new(points, view.uncertainty(), view.viewpoint().copied())
}

fn nothing_new(edge_m: f64) -> Update {
    let message =
        format!("the view shows nothing new: earlier views have points in all its voxels of {edge_m} m");
    let warning = Warning::new(WarningKind::NothingNew, message).with("voxel_m", edge_m);
    Update { warnings: vec![warning], ..Update::default() }
}

fn too_wide(edge_m: f64) -> FieldError {
    let reason = format!(
        "the view is so wide that voxels of {edge_m} m would be needed to thin all views to {VISUAL_POINTS} \
         points, and nothing would be left of the first view: send the object's part of the view only"
    );
    FieldError::invalid("points", reason)
}

#[cfg(test)]
mod tests {
    use palpate_core::config::Config;

    use super::*;
    use crate::session::Definition;

    fn session() -> Snapshot {
        let definition = Definition {
            session_id: "ball".into(),
            display_name: String::new(),
            experiment: String::new(),
            frame_id: "base".into(),
            labels: std::collections::BTreeMap::new(),
            config: Config::default(),
            sensors: Vec::new(),
            keep_out: Vec::new(),
            plausible_size: crate::session::PlausibleSize::default(),
            shadow: Vec::new(),
            ancestors: Vec::new(),
            created_us: 1,
        };
        Snapshot::created(Arc::new(definition))
    }

    /// The side of a ball of 50 mm that is seen from where `side` is 1 or -1 along x.
    fn half_ball(count: u32, side: f64) -> VisualPrior {
        let points = (0..count).map(|i| {
            let (around, up) = (2.4 * f64::from(i), 1.0 - f64::from(i) / f64::from(count));
            let across = 0.05 * (1.0 - up * up).sqrt();
            Point::new(0.4 + 0.05 * side * up, 0.2 + across * around.cos(), 0.3 + across * around.sin())
        });
        VisualPrior::new(points.collect(), None, Some(Point::new(0.4 + side, 0.2, 0.3))).unwrap()
    }

    #[test]
    fn a_view_that_fits_enters_as_it_came() {
        let (next, added) = session().add_view(&half_ball(500, 1.0), false, 2).unwrap();
        assert_eq!((added.accepted, added.edge_m, next.stats.visual_points), (500, None, 500));
        assert_eq!((next.revision, next.updated_us), (2, 2));
    }

    #[test]
    fn a_view_of_any_size_is_thinned_to_the_limit_and_not_far_below() {
        for count in [2001, 12_465, 100_000] {
            let (next, added) = session().add_view(&half_ball(count, 1.0), false, 2).unwrap();
            assert!((1000..=VISUAL_POINTS).contains(&added.accepted), "{count}: {}", added.accepted);
            assert_eq!(next.stats.visual_points as usize, added.accepted);
            assert!(added.edge_m.is_some());
        }
    }

    #[test]
    fn views_are_thinned_against_each_other_so_that_the_last_has_its_share() {
        let (one, first) = session().add_view(&half_ball(12_000, 1.0), false, 2).unwrap();
        let (two, second) = one.add_view(&half_ball(12_000, -1.0), false, 3).unwrap();
        assert!(second.edge_m > first.edge_m, "twice the surface needs longer voxels");
        assert!((200..=VISUAL_POINTS).contains(&second.accepted), "{}", second.accepted);
        assert!(two.stats.visual_points as usize <= VISUAL_POINTS);
        let of_first = two.stats.visual_points as usize - second.accepted;
        assert!(of_first.abs_diff(second.accepted) < 150, "{of_first} and {}", second.accepted);

        let mut next = two.clone();
        for revision in 4..14 {
            let (after, added) = next.add_view(&half_ball(12_000, 1.0), false, revision).unwrap();
            assert_eq!(after.revision, revision);
            assert_eq!((added.accepted, added.update.warnings.len()), (0, 1));
            assert!(added.update.warnings[0].message.contains("nothing new"));
            assert_eq!(after.digest, two.digest);
            next = after;
        }
    }

    #[test]
    fn contacts_stay_in_the_estimate_when_views_are_thinned_anew() {
        use palpate_core::evidence::{Attempt, Outcome, Sweep};
        let (one, _) = session().add_view(&half_ball(1500, 1.0), false, 2).unwrap();
        let sweep = Sweep::new(Point::new(0.2, 0.2, 0.3), Point::new(0.3, 0.2, 0.3), 0.0).unwrap();
        let miss = Evidence::Attempt(Attempt { target: None, outcome: Outcome::NoContact(sweep) });
        let (missed, _) = one.absorb(miss, "", 3).unwrap();
        let (two, _) = missed.add_view(&half_ball(1500, -1.0), false, 4).unwrap();
        assert_eq!((two.stats.no_contacts, two.revision), (1, 4));
        assert!(two.stats.visual_points as usize <= VISUAL_POINTS);
        // The same events give the same bits.
        let again = missed.add_view(&half_ball(1500, -1.0), false, 4).unwrap().0;
        assert_eq!(again.digest, two.digest);
    }

    #[test]
    fn a_scene_that_leaves_nothing_of_the_object_is_refused_with_what_to_do() {
        let (one, _) = session().add_view(&half_ball(100, 1.0), false, 2).unwrap();
        let wide = (0..200_000).map(|i| {
            let (row, column) = (f64::from(i / 500), f64::from(i % 500));
            Point::new(5.0 * row, 5.0 * column, 0.1 * (row % 7.0))
        });
        let wide = VisualPrior::new(wide.collect(), None, None).unwrap();
        let refusal = one.add_view(&wide, false, 3).map(|_| "accepted").unwrap_err();
        assert!(refusal.to_string().contains("object's part of the view"), "{refusal}");
    }
}
