//! Warm starts: all that an estimate takes from the one before.
//!
//! ```text
//! evidence up to here --+
//!                       +--> estimate
//! warm start -----------+
//! ```
//! It is a few numbers. Where it is kept, the estimate at any revision costs one fit, and not all the fits before it.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{Detail, Estimate, PalpateDetail, Reconstruction};
use crate::evidence::Reading;
use crate::local::Hyperparameters;
use crate::template::TemplateStart;

/// What an estimate began with. Estimates of METHOD_PAPER and METHOD_GPIS, and the first one of each session, follow
/// from the evidence alone.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct WarmStart {
    palpate: Option<PalpateStart>,
}

/// What a fit of METHOD_PALPATE leaves to the next.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct PalpateStart {
    /// How many fits there were.
    pub(super) number: usize,
    /// How the next fit is to read the evidence.
    pub(super) reading: Reading,
    pub(super) template: TemplateStart,
    pub(super) hyperparameters: Hyperparameters,
}

impl PalpateStart {
    fn of(before: &PalpateDetail) -> Self {
        let PalpateDetail { number, reading, template, template_std_m: _, raised } = before;
        Self {
            number: *number,
            reading: reading.clone(),
            template: template.start.clone(),
            hyperparameters: raised.hyperparameters,
        }
    }
}

impl WarmStart {
    /// What an estimate leaves to the next.
    pub(super) fn after(estimate: Option<&Estimate>) -> Self {
        match estimate.map(|estimate| &estimate.detail) {
            Some(Detail::Palpate(detail)) => Self { palpate: Some(PalpateStart::of(detail)) },
            Some(Detail::Paper(_) | Detail::Gpis(_)) | None => Self::default(),
        }
    }

    pub(super) fn palpate(&self) -> Option<&PalpateStart> {
        self.palpate.as_ref()
    }
}

impl Reconstruction {
    /// What the estimate began with; nothing before the first visual prior.
    pub fn warm_start(&self) -> Option<&WarmStart> {
        self.last_estimate().map(|estimate| &estimate.began_with)
    }

    /// Whether another state has the very estimate of this one: nothing was fitted in between.
    pub fn shares_estimate_with(&self, other: &Self) -> bool {
        match (&self.estimate, &other.estimate) {
            (Some(one), Some(other)) => Arc::ptr_eq(one, other),
            (None, None) => true,
            (Some(_), None) | (None, Some(_)) => false,
        }
    }

    /// The same state without its estimate: from now on evidence is entered and nothing is fitted, until
    /// [`Self::estimated_from`].
    pub fn deferring(self) -> Self {
        Self { estimate: None, defers: true, ..self }
    }

    /// Whether estimates are left out for now.
    pub fn is_deferring(&self) -> bool {
        self.defers
    }

    /// The state with the estimate of all its evidence, which began with `start`: the same, to the last bit, as the
    /// state that was given this start's origin and the latest evidence.
    pub fn estimated_from(self, start: WarmStart) -> Self {
        let mut next = Self { defers: false, ..self };
        if next.has_seen() {
            next.estimate = Some(Arc::new(next.fitted(start)));
        }
        next
    }
}
