//! The template: a primitive that guesses the whole object from the part that is known
//! (Section III-D).
//!
//! Takes the evidence and the fit before; gives a shape in the frame that the method
//! works in. METHOD_PAPER fits an [`ellipsoid`]. METHOD_PALPATE [selects](selection) a union of
//! superquadrics, which takes an ellipsoid, a cylinder, a box or a body with a neck, whichever the
//! evidence supports: the template selection that the paper leaves to the future. Either becomes a
//! [`TemplateSurface`], on which the local stage works.

mod adam;
mod compound;
mod covariance;
mod distances;
pub mod ellipsoid;
mod extent;
mod field;
mod fit_data;
mod least_squares;
mod limb;
mod part;
mod part_fit;
mod patch_frame;
mod samples;
mod selection;
mod split;
mod starts;
mod superquadric;
mod surface;
mod union;

pub use compound::Compound;
pub use ellipsoid::{Ellipsoid, EllipsoidFit};
pub(crate) use patch_frame::PatchFrame;
pub use selection::SelectedFit;
pub(crate) use selection::{TemplateStart, select};
pub use superquadric::Superquadric;
pub use surface::{Projection, TemplateSurface};
