//! What of a view is not taken for the object: sorted by the method, counted and shown to the caller.

use palpate_core::error::FieldError;
use palpate_core::evidence::VisualPrior;
use palpate_core::evidence::clutter::{self, Fate};
use palpate_core::geometry::{Plane, Point};
use palpate_core::warning::{Warning, WarningKind};

/// So many of the points that were set aside are shown.
const SHOWN: usize = 1000;

/// What of a view was set aside, and what was kept.
#[derive(Clone, Debug, Default)]
pub(crate) struct Clutter {
    pub(crate) kept: Vec<Point>,
    /// Points of the plane that the object stands on.
    pub(crate) support: usize,
    /// Points that float alone.
    pub(crate) isolated: usize,
    /// Points far behind what is seen around them.
    pub(crate) flying: usize,
    /// Some of the points that were set aside, spread evenly.
    pub(crate) shown: Vec<Point>,
    /// The plane that the object stands on, where the view shows it.
    pub(crate) plane: Option<Plane>,
}

impl Clutter {
    /// The view without its clutter; as it came where the caller keeps it, or where too little would be left.
    pub(super) fn taken_from(
        view: &VisualPrior,
        is_kept: bool,
        declared: Option<&Plane>,
    ) -> (VisualPrior, Self) {
        let all = || Self { kept: view.points().to_vec(), ..Self::default() };
        if is_kept {
            return (view.clone(), all());
        }
        let sorted = clutter::sort(view.points(), view.viewpoint(), declared);
        let of = |kept: bool| {
            let fates = view.points().iter().zip(&sorted.fates);
            fates.filter(move |(_, fate)| (**fate == Fate::Kept) == kept).map(|(point, _)| *point)
        };
        let kept: Vec<Point> = of(true).collect();
        let Ok(rest) = Self::view_of(view, kept.clone()) else { return (view.clone(), all()) };
        let clutter = Self {
            kept,
            support: sorted.count(Fate::Support),
            isolated: sorted.count(Fate::Isolated),
            flying: sorted.count(Fate::Flying),
            shown: clutter::spread(&of(false).collect::<Vec<_>>(), SHOWN),
            plane: sorted.support.filter(|_| sorted.count(Fate::Support) > 0),
        };
        (rest, clutter)
    }

    fn view_of(view: &VisualPrior, points: Vec<Point>) -> Result<VisualPrior, FieldError> {
        VisualPrior::new(points, view.uncertainty(), view.viewpoint().copied())
    }

    /// How many points were set aside.
    pub(crate) fn count(&self) -> usize {
        self.support + self.isolated + self.flying
    }

    /// What the caller should know of it. Pixels at depth edges are in every depth image, and nothing to warn of.
    pub(crate) fn warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        let keep = "prior.keep_clutter keeps them";
        if self.support > 0 {
            let message = format!(
                "{} points lie on the plane that the object stands on and were set aside: crop the view to the object, \
                 or declare the plane as config.support; {keep}",
                self.support
            );
            warnings
                .push(Warning::new(WarningKind::SupportPoints, message).with("points", self.support as f64));
        }
        if self.isolated > 0 {
            let message = format!(
                "{} points float alone, such as pixels without depth at the camera's origin, and were set aside; {keep}",
                self.isolated
            );
            warnings.push(
                Warning::new(WarningKind::IsolatedPoints, message).with("points", self.isolated as f64),
            );
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clutter_is_set_aside_shown_and_warned_about_unless_it_is_to_be_kept() {
        let ball = (0..200).map(|i| {
            let (around, up) = (2.4 * f64::from(i), 1.0 - f64::from(i) / 200.0);
            let across = 0.05 * (1.0 - up * up).sqrt();
            Point::new(across * around.cos(), across * around.sin(), 0.05 * up)
        });
        let camera = Point::new(0.0, 0.0, 0.6);
        let points: Vec<Point> = ball.chain([camera, Point::new(0.3, 0.2, 0.4)]).collect();
        let view = VisualPrior::new(points, Some(0.3), Some(camera)).unwrap();
        let (rest, clutter) = Clutter::taken_from(&view, false, None);
        assert_eq!((rest.points().len(), clutter.isolated, clutter.shown.len()), (200, 2, 2));
        assert_eq!((rest.uncertainty(), rest.viewpoint()), (Some(0.3), Some(&camera)));
        assert_eq!(clutter.warnings()[0].kind, WarningKind::IsolatedPoints);
        let (whole, kept) = Clutter::taken_from(&view, true, None);
        assert_eq!((whole, kept.count(), kept.warnings()), (view, 0, Vec::new()));
    }
}
