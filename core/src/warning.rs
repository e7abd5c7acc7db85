//! What a method notices about its evidence: nothing is refused, but somebody should have a look.

/// What a warning is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WarningKind {
    /// A view without a viewpoint.
    NoViewpoint,
    /// A contact far from its candidate.
    EarlyContact,
    /// A measured normal that is not used.
    NormalIgnored,
    /// Force and torque are zero.
    ZeroWrench,
    /// The force pulls on the pad.
    PullingForce,
    /// The force points across the approach.
    WrenchFrame,
    /// A torque that no pad can feel at this force.
    TorqueTooLarge,
    /// The force acts beside the pad.
    TouchedByHousing,
    /// A wrench where there is none.
    TareDrift,
    /// The pad points out of the object.
    QuaternionOrder,
    /// The candidate is of another session.
    CandidateOfAnotherSession,
    /// A contact contradicts what else is known.
    DoubtedContact,
    /// The object seems to have moved.
    ObjectMoved,
    /// A view and the touches disagree by a rigid offset.
    CameraOffset,
    /// Points with a NaN or an infinity.
    NonFinitePoints,
    /// Points of the plane that the object stands on.
    SupportPoints,
    /// Points that float alone.
    IsolatedPoints,
    /// Points that were sent more than once.
    RepeatedPoints,
    /// An object of an implausible size.
    ImplausibleSize,
    /// A view that shows nothing new.
    NothingNew,
    /// An approach below the object where no table was declared.
    NoTable,
    /// A contact far from everything known.
    FarContact,
    /// A load below the sensor's noise.
    WeakContact,
    /// A way of the probe that no arm reaches.
    LongSweep,
}

/// One thing that was noticed.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// What it is about.
    pub kind: WarningKind,
    /// What was noticed and what to do about it, in a sentence for the caller.
    pub message: String,
    /// The numbers behind it; the unit is the end of the name.
    pub parameters: Vec<(&'static str, f64)>,
}

impl Warning {
    /// A warning without numbers.
    pub fn new(kind: WarningKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), parameters: Vec::new() }
    }

    /// The same with one more number.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: f64) -> Self {
        self.parameters.push((name, value));
        self
    }
}
