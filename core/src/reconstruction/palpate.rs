//! METHOD_PALPATE on one page: from all evidence, failures included, to a surface with its
//! standard deviation.

use super::warm_start::PalpateStart;
use super::{Detail, Estimate, PalpateDetail, Surface, belief, motion};
use crate::config::Config;
use crate::evidence::ledger::{Ledger, Motion};
use crate::evidence::{FitEvidence, Reading};
use crate::geometry::{Icosphere, Plane};
use crate::local;
use crate::schedule::Extras;
use crate::template::{self, TemplateSurface};
use crate::uncertainty::{self, Reach};

pub(super) fn estimate(
    ledger: &Ledger,
    before: Option<&PalpateStart>,
    config: &Config,
    sphere: &'static Icosphere,
) -> Estimate {
    let number = before.map_or(1, |before| before.number + 1);
    let scene =
        Scene { ledger, start: before.map(Start::of), extras: Extras::of_fit(number), config, sphere };
    // What was told is read as it was believed after the last fit, and in some fits otherwise, too: the
    // reading under which the measurements are the most likely is kept.
    let reading = before.map_or_else(|| Reading::first(config), |before| before.reading.told(ledger));
    let best = scene.settled(&reading);
    let best = scene.otherwise_read(best);
    let best = scene.followed(best);
    best.estimate(number, ledger.support.as_ref(), config, sphere)
}

/// Another reading has to be this much more likely, in nats: a Bayes factor of 20.
const CLEARLY: f64 = 3.0;
/// A camera that agrees with the robot's base is the simpler reading, and has to be more likely by less.
const VANISHING: f64 = 1.5;
/// And that of an object that has moved by this much: it is rare, and a better template looks like it.
const MOVED_CLEARLY: f64 = 15.0;

/// A motion has to be found again after so many further pieces of evidence.
const CONFIRMED_AFTER: usize = 4;
const FORGOTTEN_AFTER: usize = 8;

/// What a fit starts from, and what it is made of.
#[derive(Clone, Copy)]
struct Scene<'a> {
    ledger: &'a Ledger,
    start: Option<Start<'a>>,
    extras: Extras,
    config: &'a Config,
    sphere: &'static Icosphere,
}

/// What an earlier fit leaves to the next.
#[derive(Clone, Copy)]
struct Start<'a> {
    template: &'a template::TemplateStart,
    hyperparameters: &'a local::Hyperparameters,
}

impl<'a> Start<'a> {
    fn of(before: &'a PalpateStart) -> Self {
        Self { template: &before.template, hyperparameters: &before.hyperparameters }
    }
}

/// The stages of one fit.
struct Fitted {
    /// How the next fit is to read the evidence.
    reading: Reading,
    evidence: FitEvidence,
    template: template::SelectedFit,
    surface: TemplateSurface,
    conditioned: local::Conditioned,
}

impl Scene<'_> {
    /// A fit with a reading, and another where that doubts other touches than the reading did. Doubts that
    /// leave a surface under which the measurements are clearly less likely are dropped.
    fn settled(&self, reading: &Reading) -> Fitted {
        let fitted = self.fit(reading);
        let (before, after) = (reading.doubted(), fitted.reading.doubted());
        if after == before {
            return fitted;
        }
        let doubting = self.fit(&fitted.reading);
        let only_believes_more = after.is_subset(&before);
        if only_believes_more || doubting.log_likelihood() > fitted.log_likelihood() - CLEARLY {
            return doubting;
        }
        let (doubts, seen_doubts) = (reading.doubts.clone(), reading.seen_doubts.clone());
        let reading = Reading { doubts, seen_doubts, ..fitted.reading };
        Fitted { reading, ..fitted }
    }

    /// The fit with its pads or cameras read otherwise where that is the more likely.
    fn otherwise_read(&self, mut best: Fitted) -> Fitted {
        let others = belief::alternatives(&best.reading, self.ledger);
        for other in others.into_iter().filter(|_| self.extras.readings) {
            let other = self.settled(&self.settled(&other).reading);
            let offsets_vanish = best.reading.finds_offsets && !other.reading.finds_offsets;
            let margin = if offsets_vanish { VANISHING } else { CLEARLY };
            let is_needed = other.log_likelihood() < best.log_likelihood() - CLEARLY;
            let better = self.better(&best, other, margin);
            if offsets_vanish {
                best.reading.offsets_needed = if is_needed { best.reading.offsets_needed + 1 } else { 0 };
            }
            best = better.unwrap_or(best);
        }
        best
    }

    /// The fit of an object that has moved, where that is the more likely; a motion that is not to be followed is
    /// only noted.
    fn followed(&self, mut best: Fitted) -> Fitted {
        let moved = self.moved(&best);
        let awaited = best.reading.awaited;
        if awaited.is_some_and(|(_, at)| self.ledger.entries >= at + FORGOTTEN_AFTER) {
            best.reading.awaited = None;
        }
        for (moved, margin) in moved {
            let motions = best.reading.motions.len();
            let Some(found) = self.better(&best, moved, margin) else { continue };
            // It was tried with templates from new starts: what is believed so far is given them, too.
            let stayed = self.afresh(&best.reading);
            if found.log_likelihood() > stayed.log_likelihood() + CLEARLY {
                if found.reading.motions.len() > motions && !self.confirms(awaited, &found.reading) {
                    let found = found.reading.motions.last().map(|motion| (*motion, self.ledger.entries));
                    best.reading.awaited = awaited.or(found);
                } else if self.config.follows_motion || found.reading.motions.len() <= motions {
                    best = found;
                } else {
                    best.reading.suspected = found.reading.motions.last().copied();
                }
            } else if stayed.log_likelihood() > best.log_likelihood() + CLEARLY {
                best = stayed;
            }
        }
        best
    }

    /// Whether a motion was found before, and some attempts ago: a template that was wrong looks like a motion
    /// until the next attempts mend it.
    fn confirms(&self, awaited: Option<(Motion, usize)>, reading: &Reading) -> bool {
        awaited.zip(reading.motions.last()).is_some_and(|((before, at), found)| {
            self.ledger.entries >= at + CONFIRMED_AFTER
                && before.since.abs_diff(found.since) <= FORGOTTEN_AFTER
        })
    }

    /// The fit of another reading where that is clearly the more likely, and not by its template alone: a fit
    /// of the first reading that starts from there is no better.
    fn better(&self, best: &Fitted, other: Fitted, margin: f64) -> Option<Fitted> {
        let is_clear = |best: &Fitted| other.log_likelihood() > best.log_likelihood() + margin;
        if !is_clear(best) {
            return None;
        }
        let challenger = Scene { start: Some(other.start()), ..*self }.settled(&best.reading);
        is_clear(&challenger).then_some(other)
    }

    /// Fits for an object that has moved, where there are signs of it, and for one that has not or otherwise
    /// where a motion was found lately; each with how much more likely it has to be.
    fn moved(&self, best: &Fitted) -> Vec<(Fitted, f64)> {
        let Self { ledger, extras, config, .. } = *self;
        if !config.stages.motion {
            return Vec::new();
        }
        let revised = motion::without_latest(&best.reading, ledger).filter(|_| extras.readings);
        let reading = revised.as_ref().unwrap_or(&best.reading);
        let is_awaited = best.reading.awaited.is_some();
        let since = motion::suspected_since(reading, ledger, extras.readings || is_awaited);
        let Some(first) = since.first() else { return Vec::new() };
        let earlier = ledger.until(*first);
        let known = Scene { ledger: &earlier, start: None, extras: Extras::of_fit(1), ..*self }.fit(reading);
        let (heights_m, std_m) =
            known.conditioned.outline(&known.surface, &known.evidence.detail, motion::VERTICES);
        let mesh = known.surface.raised(&heights_m);
        let normals = mesh.vertex_normals();
        let known = motion::Known::new(&mesh.vertices, &normals, &std_m);
        let found = motion::found(reading, ledger, &known, &since);
        let level = found.as_ref().and_then(|motion| motion::level(motion, ledger));
        let is_new =
            if revised.is_some() { CLEARLY } else { MOVED_CLEARLY * (1 + reading.motions.len()) as f64 };
        let moved = level.into_iter().chain(found).map(|motion| {
            let cost = motion::cost(&motion, ledger);
            (self.afresh(&reading.moved(motion)), is_new + cost)
        });
        moved.chain(revised.iter().map(|reading| (self.afresh(reading), CLEARLY))).collect()
    }

    /// The first two fits of a session that begins with all of the evidence: the second tries another part, too.
    fn afresh(&self, reading: &Reading) -> Fitted {
        let first = Self { start: None, extras: Extras::of_fit(1), ..*self }.settled(reading);
        let second = Scene { start: Some(first.start()), extras: Extras::of_fit(2), ..*self };
        second.settled(&first.reading)
    }

    /// Sections III-D and III-E for one reading of the evidence.
    fn fit(&self, reading: &Reading) -> Fitted {
        let Self { ledger, start, extras, config, sphere } = *self;
        let stages = &config.stages;
        let evidence = FitEvidence::of(ledger, reading, config);

        // Section III-D: the template guesses the whole from the part.
        let template = template::select(&evidence, start.map(|start| start.template), extras, stages);
        let surface = TemplateSurface::new(template.shape.mesh(sphere));

        // Section III-E: a Gaussian process over it meets what was measured and leaves free what was swept.
        let last = start.map(|start| start.hyperparameters);
        let conditioned = local::condition(&surface, &template.shape, &evidence, last, extras, config);
        let mut reading = belief::learnt(reading, &conditioned);
        reading.stands_at =
            ledger.support.and_then(|plane| surface.mesh().lowest_over(&plane)).map(|(foot, _)| foot);
        Fitted { reading, evidence, template, surface, conditioned }
    }
}

impl Fitted {
    fn start(&self) -> Start<'_> {
        Start { template: &self.template.start, hyperparameters: &self.conditioned.hyperparameters }
    }

    /// How likely the measurements were, with what the template's parameters cost.
    fn log_likelihood(&self) -> f64 {
        let count = self.evidence.measured.len() as f64;
        self.conditioned.log_likelihood - 0.5 * self.template.parameters() * count.ln()
    }

    /// Section III-F: uncertainty spreads from the attractors, then to what a revolution makes symmetric.
    fn estimate(
        self,
        number: usize,
        support: Option<&Plane>,
        config: &Config,
        sphere: &'static Icosphere,
    ) -> Estimate {
        let Self { reading, evidence, template, surface, conditioned } = self;
        let raised = conditioned.raise(&surface, &evidence.detail);
        let mut mesh = surface.raised(&raised.heights_m);
        if let Some(support) = support {
            mesh = mesh.above(support);
        }
        let attractors: Vec<_> = evidence.believed().copied().collect();
        let reach = Reach::of(config);
        let mut uncertainty =
            uncertainty::propagate(&sphere.connectivity, &mesh.vertices, &attractors, reach);
        if config.stages.symmetry_first {
            let symmetry = raised.process.symmetry();
            uncertainty = uncertainty::lowered_by_symmetry(uncertainty, &mesh, symmetry, &attractors, reach);
        }

        let template_std_m = template.deviations_m(&surface.mesh().vertices);
        let std_m = Some(raised.std_m.clone());
        let detail = PalpateDetail { number, reading, template, template_std_m, raised };
        let surface = Surface { mesh, uncertainty, std_m };
        Estimate::new(surface, reach, Detail::Palpate(Box::new(detail)), sphere.connectivity.clone())
    }
}
