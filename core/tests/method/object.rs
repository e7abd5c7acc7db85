//! An object whose shape is analytic, and a robot that explores it.

use nalgebra::UnitQuaternion;
use palpate_core::config::{Config, Method, Settings};
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Outcome, Pad, Sweep, Target, TouchedPoint, VisualPrior, Wrench,
};
use palpate_core::exploration::{Candidate, ProposalRequest};
use palpate_core::geometry::{Icosphere, Point, Pose, Vector};
use palpate_core::reconstruction::Reconstruction;

/// An ellipsoid that can be touched: all that a robot would find out about it is analytic.
pub(crate) struct Object {
    pub(crate) semi_axes: Vector,
    pub(crate) base_from_object: Pose,
}

pub(crate) const METHODS: [Method; 3] = [Method::Paper, Method::Palpate, Method::Gpis];

/// The defaults of a method.
pub(crate) fn of(method: Method) -> Settings {
    Settings { method, ..Settings::default() }
}

/// A probe that touches with its tip, whatever torque it shows, as in the paper.
pub(crate) fn point_pad() -> Pad {
    Pad::new(0.009).unwrap().touching_with(TouchedPoint::PadCentre)
}

pub(crate) fn best() -> ProposalRequest {
    ProposalRequest::best(1)
}

impl Object {
    pub(crate) fn sphere() -> Self {
        Self { semi_axes: Vector::repeat(0.045), base_from_object: Pose::translation(0.5, -0.1, 0.2) }
    }

    pub(crate) fn rotated_ellipsoid() -> Self {
        Self {
            semi_axes: Vector::new(0.03, 0.045, 0.07),
            base_from_object: Pose::new(Vector::new(0.4, 0.2, 0.1), Vector::new(0.5, -0.9, 0.3)),
        }
    }

    pub(crate) fn centre(&self) -> Point {
        self.base_from_object * Point::origin()
    }

    pub(crate) fn moved(&self, motion: &Pose) -> Self {
        Self { semi_axes: self.semi_axes, base_from_object: motion * self.base_from_object }
    }

    pub(crate) fn camera(&self) -> Point {
        self.base_from_object * Point::new(0.35, -0.3, 0.38)
    }

    /// The points of the surface nearest to the camera: an eighth of it.
    pub(crate) fn prior(&self) -> VisualPrior {
        let mut seen: Vec<Point> = Icosphere::get(4)
            .directions
            .iter()
            .map(|d| self.base_from_object * Point::from(d.component_mul(&self.semi_axes)))
            .collect();
        seen.sort_by(|a, b| (a - self.camera()).norm().total_cmp(&(b - self.camera()).norm()));
        seen.truncate(320);
        VisualPrior::new(seen.into_iter().step_by(2).collect(), None, Some(self.camera())).unwrap()
    }

    /// Probes from far outside to inside along a candidate's way.
    pub(crate) fn touch(&self, candidate: &Candidate) -> Evidence {
        let target = Target::new(candidate.point, candidate.normal.into_inner()).unwrap();
        let way = candidate.probe_end - candidate.probe_start;
        let first = self.met_at(&candidate.probe_start, &way);
        let outcome = if let Some(first) = first {
            let point = candidate.probe_start + way * first;
            let force = Vector::new(0.0, 0.0, -5.0);
            let wrench = Wrench { force, torque: Vector::new(0.001, -0.002, 0.0).cross(&force) };
            let facing = UnitQuaternion::rotation_between(&Vector::z(), &-candidate.normal.into_inner());
            let pose = Pose::from_parts(point.coords.into(), facing.unwrap_or_else(UnitQuaternion::identity));
            Outcome::Contact(Contact::new(pose, wrench, point_pad(), ContactDetail::default()).unwrap())
        } else {
            let sweep = Sweep::new(candidate.probe_start, candidate.probe_end, 0.0);
            Outcome::NoContact(sweep.unwrap())
        };
        Evidence::Attempt(Attempt { target: Some(target), outcome })
    }

    /// After which share of a way the surface is met; from a start inside, before it began.
    pub(crate) fn met_at(&self, from: &Point, way: &Vector) -> Option<f64> {
        let unit = |p: &Point| (self.base_from_object.inverse() * p).coords.component_div(&self.semi_axes);
        let (from, to) = (unit(from), unit(&(from + way)));
        let way = to - from;
        let (a, b, c) = (way.norm_squared(), from.dot(&way), from.norm_squared() - 1.0);
        let discriminant = b * b - a * c;
        let first = (-b - discriminant.max(0.0).sqrt()) / a;
        // From a start inside, the object was touched on the way there.
        let is_free = discriminant < 0.0 || first > 1.0 || (first < 0.0 && c >= 0.0);
        (!is_free).then_some(first)
    }

    /// The mean distance of a session's vertices to the surface, to first order, in metres.
    pub(crate) fn mean_error_m(&self, state: &Reconstruction) -> f64 {
        let vertices = &state.surface().unwrap().mesh.vertices;
        vertices.iter().map(|vertex| self.error_m(vertex)).sum::<f64>() / vertices.len() as f64
    }

    pub(crate) fn error_m(&self, point: &Point) -> f64 {
        let y = (self.base_from_object.inverse() * point).coords.component_div(&self.semi_axes);
        ((y.norm() - 1.0) * y.norm() / y.component_div(&self.semi_axes).norm()).abs()
    }
}

/// Explores an object and returns the evidence with the final state.
pub(crate) fn explore(
    object: &Object,
    settings: Settings,
    attempts: usize,
) -> (Vec<Evidence>, Reconstruction) {
    let mut log = vec![Evidence::VisualPrior(object.prior())];
    let mut state = Reconstruction::new(Config::new(settings).unwrap());
    for attempt in 0..=attempts {
        (state, _) = state.absorb(&log[attempt]).unwrap();
        if attempt < attempts {
            log.push(object.touch(&state.propose(&best()).candidates[0]));
        }
    }
    (log, state)
}
