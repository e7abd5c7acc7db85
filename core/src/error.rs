//! What can be wrong with what a caller hands in. A failed contact is not among it: that is data.

/// A value that cannot be used, named by the field that carries it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{field}: {reason}")]
pub struct FieldError {
    /// The field's name, such as `points` or `wrench.force`; callers prefix it with their own path.
    pub field: &'static str,
    /// What is wrong and what would be right.
    pub reason: String,
    /// Whether the value is NaN, infinite or absurdly large.
    pub non_finite: bool,
}

impl FieldError {
    /// A value that is out of its range or of the wrong form.
    pub fn invalid(field: &'static str, reason: impl Into<String>) -> Self {
        Self { field, reason: reason.into(), non_finite: false }
    }

    /// A number that is NaN, infinite or beyond any workspace.
    pub fn non_finite(field: &'static str, reason: impl Into<String>) -> Self {
        Self { field, reason: reason.into(), non_finite: true }
    }
}

/// Why evidence was not absorbed; the state is then as it was.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A value cannot be used.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// Touches make sense only once something of the object has been seen.
    #[error("the session has no visual prior yet: add one before reporting contacts")]
    NoVisualPrior,
}
