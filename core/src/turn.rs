//! What takes turns: a fit goes on from the one before, and does one thing more.

/// What one fit does beyond going on from the one before. Nothing of it changes with every touch,
/// and one at a time keeps every step short.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// The template also starts afresh.
    Starts,
    /// The noise of the senses is asked for.
    Noise,
    /// A part more is tried.
    Splits,
    /// Symmetry is asked for.
    Symmetry,
}

impl Turn {
    /// The turn of a fit by its number, the first being 1.
    pub fn of(fit: usize) -> Self {
        [Self::Starts, Self::Noise, Self::Splits, Self::Symmetry][fit % 4]
    }
}
