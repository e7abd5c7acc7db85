//! What real robots do wrong, each off unless asked for.
//!
//! ```text
//!   camera ... table, flying pixels, pixels without depth, not where it says it is
//!   probe .... contacts in the air
//!   object ... moves while it is explored
//! ```
//! Every fault draws from a stream of its own: the others stay as they are when one comes along.

pub(crate) mod false_contact;
pub(crate) mod hand_eye;
mod motion;
mod pixels;

pub use self::motion::Motion;
pub(crate) use self::pixels::Pixels;

/// What goes wrong; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// With this probability an approach reports a contact in the air, before it touches anything.
    pub false_contact_share: f64,
    /// The object is pushed aside once.
    pub move_after: Option<Motion>,
    /// How far all that the camera reports is off, in metres: the camera and the robot's base disagree.
    pub hand_eye_m: f64,
    /// By how much the camera looks elsewhere than the robot believes, in radians: all that it reports is turned
    /// about the camera.
    pub hand_eye_turn: f64,
    /// This share of the view lies on the table that the object stands on.
    pub table_share: f64,
    /// This share of the view are flying pixels: between an edge and what is behind it.
    pub flying_pixel_share: f64,
    /// This share of the view are pixels without depth, which come out at the camera itself.
    pub zero_share: f64,
}

impl Faults {
    /// Whether anything goes wrong.
    pub fn any(&self) -> bool {
        *self != Self::default()
    }
}
