//! A session as nobody means it: a view and what came of some approaches, with numbers of every size.

use arbitrary::{Arbitrary, Unstructured};
use palpate_core::config::{Config, DeclaredSymmetry, Method, Settings, Strategy};
use palpate_core::error::FieldError;
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Moved, Outcome, Pad, RejectReason, Sweep, Target,
    TouchedPoint, VisualPrior, Wrench,
};
use palpate_core::exploration::Candidate;
use palpate_core::geometry::{Plane, Point, Pose, Vector};

/// Steps of one session; the time that a session takes grows with them.
const MOST_STEPS: usize = 8;
/// Points of one view.
const MOST_POINTS: usize = 80;

/// A number that is mostly of the size of objects, and sometimes of none.
#[derive(Clone, Copy, Debug, Arbitrary)]
pub struct Number(i16, u8);

impl Number {
    /// In metres, newtons or whatever it is used for.
    pub fn value(self) -> f64 {
        let Self(share, size) = self;
        let most = match size % 16 {
            0..=8 => 0.1,
            9 | 10 => 1.0,
            11 => 1e-3,
            12 => 1e-7,
            13 => 1e-30,
            14 => 100.0,
            _ => 1e4,
        };
        most * f64::from(share) / f64::from(i16::MAX)
    }
}

/// Three numbers.
#[derive(Clone, Copy, Debug, Arbitrary)]
pub struct Numbers([Number; 3]);

impl Numbers {
    fn vector(self) -> Vector {
        self.0.map(Number::value).into()
    }

    fn point(self) -> Point {
        self.vector().into()
    }
}

/// A place and a turn about an axis, by its length in radians.
#[derive(Clone, Copy, Debug, Arbitrary)]
pub struct Turned {
    position: Numbers,
    turn: Numbers,
}

impl Turned {
    fn pose(self) -> Pose {
        // Object-sized numbers are small turns; those of pads that face anywhere are tens of times as large.
        Pose::new(self.position.vector(), 31.0 * self.turn.vector())
    }
}

/// Points of a camera, each within a cube of 200 mm about a place.
#[derive(Debug)]
pub struct View {
    offsets: Vec<[i8; 3]>,
    place: Numbers,
    viewpoint: Option<Numbers>,
}

impl<'a> Arbitrary<'a> for View {
    fn arbitrary(bytes: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        let (place, viewpoint) = (bytes.arbitrary()?, bytes.arbitrary()?);
        let count = bytes.int_in_range(4..=MOST_POINTS)?;
        let offsets = (0..count).map(|_| bytes.arbitrary()).collect::<arbitrary::Result<_>>()?;
        Ok(Self { offsets, place, viewpoint })
    }
}

impl View {
    /// The evidence.
    ///
    /// # Errors
    /// It shows no surface.
    pub fn evidence(&self) -> Result<Evidence, FieldError> {
        let place = self.place.vector();
        let points = self
            .offsets
            .iter()
            .map(|offset| Point::from(place + 0.1 / 128.0 * Vector::from(offset.map(f64::from))));
        let viewpoint = self.viewpoint.map(Numbers::point);
        Ok(Evidence::VisualPrior(VisualPrior::new(points.collect(), None, viewpoint)?))
    }
}

/// How a session is set up.
#[derive(Debug, Arbitrary)]
pub struct Setup {
    method: u8,
    strategy: u8,
    seed: u8,
    symmetry: Option<bool>,
    support: Option<Number>,
    follows_motion: bool,
    alpha_travel: u8,
}

impl Setup {
    /// The parameters, on the coarsest mesh.
    ///
    /// # Errors
    /// They do not go together.
    pub fn config(&self) -> Result<Config, FieldError> {
        let strategies = [
            Strategy::Proactive,
            Strategy::ExpectedGain,
            Strategy::MinUncertainty,
            Strategy::Uniform,
            Strategy::Random,
        ];
        let symmetry = |is_mirror| {
            if is_mirror { DeclaredSymmetry::Mirror } else { DeclaredSymmetry::Revolution }
        };
        Config::new(Settings {
            method: [Method::Palpate, Method::Paper, Method::Gpis][usize::from(self.method) % 3],
            strategy: strategies[usize::from(self.strategy) % strategies.len()],
            seed: self.seed.into(),
            symmetry: self.symmetry.map(symmetry),
            support: self.support.map(|height| Plane::new(Vector::z_axis(), height.value())),
            follows_motion: self.follows_motion,
            alpha_travel: f64::from(self.alpha_travel / 128),
            icosphere_subdivisions: 2,
            ..Settings::default()
        })
    }
}

/// What happens next in a session.
#[derive(Debug, Arbitrary)]
pub enum Step {
    /// The robot goes to the best candidate, and touches so far from it along its normal.
    Meet(Number, Touch),
    /// It goes there and touches nothing.
    Miss,
    /// It does not go there.
    Reject(u8),
    /// It touches somewhere, with these pads.
    Touch(Turned, Touch, Option<(Turned, Touch)>),
    /// It touches nothing on some way.
    Sweep(Numbers, Numbers, Number),
    /// Something else of it touches.
    Hit(Turned),
    /// The object was moved.
    Move(Turned, Number),
    /// The camera sees more.
    See(View),
}

/// What a pad tells of a touch.
#[derive(Debug, Arbitrary)]
pub struct Touch {
    half_side: u8,
    touched: u8,
    force: Numbers,
    torque: Numbers,
    rest: Option<Numbers>,
    swept_from: Option<Numbers>,
    normal: Option<Numbers>,
    uncertainty: Option<u8>,
}

impl Touch {
    fn contact(&self, pose: Pose) -> Result<Contact, FieldError> {
        let touched = [TouchedPoint::Open, TouchedPoint::PadCentre, TouchedPoint::CentreOfPressure];
        let pad = Pad::new(0.0005 * (1.0 + f64::from(self.half_side)))?;
        let pad = pad.touching_with(touched[usize::from(self.touched) % 3]);
        let wrench = Wrench { force: 50.0 * self.force.vector(), torque: self.torque.vector() };
        let detail = ContactDetail {
            uncertainty: self.uncertainty.map(|u| f64::from(u) / 255.0),
            swept_from: self.swept_from.map(Numbers::point),
            normal: self.normal.map(Numbers::vector),
            rest_wrench: self.rest.map(|force| Wrench { force: force.vector(), torque: Vector::zeros() }),
        };
        Contact::new(pose, wrench, pad, detail)
    }
}

impl Step {
    /// The evidence; `None` where it needs a candidate and there is none.
    ///
    /// # Errors
    /// A constructor refuses it.
    pub fn evidence(&self, best: Option<&Candidate>) -> Result<Option<Evidence>, FieldError> {
        let outcome = match self {
            Self::Touch(place, touch, None) => Outcome::Contact(touch.contact(place.pose())?),
            Self::Touch(place, touch, Some((other, another))) => Outcome::Contacts {
                aimed: touch.contact(place.pose())?,
                others: vec![another.contact(other.pose())?],
            },
            Self::Sweep(from, to, radius) => {
                Outcome::NoContact(Sweep::new(from.point(), to.point(), radius.value().abs().min(1.0))?)
            }
            Self::Hit(place) => Outcome::InvalidContact(place.pose()),
            Self::Move(motion, std) => {
                let moved = Moved::new(motion.pose(), std.value().abs().min(1.0))?;
                return Ok(Some(Evidence::Moved(moved)));
            }
            Self::See(view) => return view.evidence().map(Some),
            Self::Meet(..) | Self::Miss | Self::Reject(_) => {
                return best.map(|best| self.evidence_at(best)).transpose();
            }
        };
        Ok(Some(Evidence::Attempt(Attempt { target: None, outcome })))
    }

    /// The same for what is done at a candidate.
    fn evidence_at(&self, best: &Candidate) -> Result<Evidence, FieldError> {
        let reasons = [
            RejectReason::Unspecified,
            RejectReason::NoIk,
            RejectReason::Collision,
            RejectReason::SafetyStop,
            RejectReason::Timeout,
            RejectReason::Operator,
        ];
        let outcome = match self {
            Self::Meet(off, touch) => {
                let at = best.point + off.value() * best.normal.into_inner();
                let pose = Pose::from_parts(at.coords.into(), best.approach.base_from_tool.rotation);
                Outcome::Contact(touch.contact(pose)?)
            }
            Self::Reject(reason) => Outcome::Rejected(reasons[usize::from(*reason) % reasons.len()]),
            _ => Outcome::NoContact(Sweep::new(best.probe_start, best.probe_end, 0.009)?),
        };
        let target = Some(Target::new(best.point, best.normal.into_inner())?);
        Ok(Evidence::Attempt(Attempt { target, outcome }))
    }
}

/// A whole session.
#[derive(Debug)]
pub struct Session {
    /// How it is set up.
    pub setup: Setup,
    /// What is seen first.
    pub view: View,
    /// What happens then.
    pub steps: Vec<Step>,
}

impl<'a> Arbitrary<'a> for Session {
    fn arbitrary(bytes: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        let (setup, view) = (bytes.arbitrary()?, bytes.arbitrary()?);
        let mut steps = Vec::new();
        while steps.len() < MOST_STEPS && !bytes.is_empty() {
            steps.push(bytes.arbitrary()?);
        }
        Ok(Self { setup, view, steps })
    }
}
