//! The template: a primitive that guesses the whole object from the part that is known
//! (Section III-D).

mod ellipsoid;

pub use ellipsoid::{Ellipsoid, fit, initial};

/// How a fit of the template went.
#[derive(Clone, Debug, PartialEq)]
pub struct TemplateFit {
    /// The fitted shape.
    pub shape: Ellipsoid,
    /// Steps of the minimisation.
    pub iterations: usize,
    /// Whether it ended before its last step.
    pub converged: bool,
    /// The minimised cost, `0.5 Σ r²` in normalised units.
    pub cost: f64,
    /// Root mean square distance of the attractors to the shape, to first order, in metres.
    pub rms_m: f64,
    /// Whether a semi-axis ran into the bound of its size.
    pub diverged: bool,
}
