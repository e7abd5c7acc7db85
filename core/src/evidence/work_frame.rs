//! The frame that a method works in.
//!
//! METHOD_PALPATE works in the frame of its first view: the origin at the centroid of the points, z
//! towards the camera (or, where it is not known, the farthest point), x towards the point that lies
//! farthest from that axis. Coordinates in it are
//! rounded to a multiple of 7 nm, far below what any sensor resolves. A scene and the same scene
//! rotated or moved then become the same numbers, to the last bit, so every choice that the method
//! makes is the same one: without it, rounding in the session's frame decides near ties, and an
//! exploration and its rotated twin part after a few touches.

use nalgebra::{Rotation3, UnitQuaternion};

use super::Evidence;
use super::attempt::{Attempt, Contact, Moved, Outcome, Sweep, Target};
use super::visual_prior::VisualPrior;
use crate::fingerprint::Fingerprint;
use crate::geometry::{Direction, Plane, Point, Pose, Vector};
use crate::method::Method;

/// Coordinates are rounded to a multiple of this, in metres: a power of two, so that the rounding
/// itself is exact.
const QUANTUM_M: f64 = 1.0 / (1_u64 << 27) as f64;
/// Likewise for the components of a direction.
const DIRECTION_QUANTUM: f64 = 1.0 / (1_u64 << 30) as f64;
/// Of points that are nearly as far away, by this share, the first one counts.
const MARGIN: f64 = 1e-9;

/// The frame that a method works in.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum WorkFrame {
    /// The session's own frame, numbers as they were sent.
    #[default]
    Session,
    /// The frame of the first view.
    View {
        /// Where that frame is in the session's.
        base_from_view: Pose,
    },
}

impl WorkFrame {
    /// The frame that a method works in once it has its first view.
    pub(crate) fn of(method: Method, prior: &VisualPrior) -> Self {
        if method.works_in_view_frame() { Self::of_view(prior) } else { Self::Session }
    }

    /// The frame of a view.
    fn of_view(prior: &VisualPrior) -> Self {
        let points = prior.points();
        let centroid = points.iter().map(|point| point.coords).sum::<Vector>() / points.len() as f64;
        let offsets: Vec<Vector> = points.iter().map(|point| point.coords - centroid).collect();
        let towards_camera = prior.viewpoint().map(|camera| camera.coords - centroid);
        let z = towards_camera
            .and_then(|offset| Direction::try_new(offset, 1e-6))
            .unwrap_or_else(|| farthest(offsets.iter().copied()));
        let x = farthest(offsets.iter().map(|offset| offset - z.into_inner() * offset.dot(&z)));
        // What rounding leaves of z in x is taken out once more.
        let x = Direction::new_normalize(x.into_inner() - z.into_inner() * x.dot(&z));
        let axes = Rotation3::from_basis_unchecked(&[x.into_inner(), z.cross(&x), z.into_inner()]);
        Self::View { base_from_view: Pose::from_parts(centroid.into(), UnitQuaternion::from(axes)) }
    }

    /// Adds itself to a fingerprint.
    pub(crate) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        match self {
            Self::Session => fingerprint.count(0),
            Self::View { base_from_view } => {
                fingerprint.vector(&base_from_view.translation.vector);
                fingerprint.numbers(base_from_view.rotation.coords.as_slice());
            }
        }
    }

    /// Evidence in this frame.
    pub(crate) fn enter(&self, evidence: &Evidence) -> Evidence {
        match evidence {
            Evidence::VisualPrior(prior) => Evidence::VisualPrior(prior.mapped(|point| self.point(point))),
            Evidence::Attempt(Attempt { target, outcome }) => Evidence::Attempt(Attempt {
                target: target.map(|target| self.target(&target)),
                outcome: self.outcome(outcome),
            }),
            Evidence::Moved(moved) => Evidence::Moved(self.motion(moved)),
        }
    }

    fn motion(&self, moved: &Moved) -> Moved {
        match self {
            Self::Session => *moved,
            Self::View { base_from_view } => moved.seen_from(&base_from_view.inverse()),
        }
    }

    fn outcome(&self, outcome: &Outcome) -> Outcome {
        match outcome {
            Outcome::Contact(contact) => Outcome::Contact(self.contact(contact)),
            Outcome::NoContact(sweep) => Outcome::NoContact(self.sweep(sweep)),
            Outcome::Contacts { aimed, others } => Outcome::Contacts {
                aimed: self.contact(aimed),
                others: others.iter().map(|contact| self.contact(contact)).collect(),
            },
            Outcome::Rejected(reason) => Outcome::Rejected(*reason),
            Outcome::InvalidContact(base_from_sensor) => Outcome::InvalidContact(self.pose(base_from_sensor)),
        }
    }

    fn contact(&self, contact: &Contact) -> Contact {
        contact.mapped(|pose| self.pose(pose), |point| self.point(point), |normal| self.direction(normal))
    }

    fn sweep(&self, sweep: &Sweep) -> Sweep {
        sweep.mapped(|point| self.point(point))
    }

    fn target(&self, target: &Target) -> Target {
        target.mapped(|point| self.point(point), |normal| self.direction(normal))
    }

    /// A point in this frame, rounded.
    fn point(&self, in_base: &Point) -> Point {
        match self {
            Self::Session => *in_base,
            Self::View { .. } => rounded(&self.exact_point(in_base).coords, QUANTUM_M).into(),
        }
    }

    /// A pose in this frame, rounded.
    fn pose(&self, base_from_sensor: &Pose) -> Pose {
        match self {
            Self::Session => *base_from_sensor,
            Self::View { base_from_view } => {
                let view_from_sensor = base_from_view.inv_mul(base_from_sensor);
                let position = rounded(&view_from_sensor.translation.vector, QUANTUM_M);
                let turn = view_from_sensor.rotation.coords.map(|x| round(x, DIRECTION_QUANTUM));
                let turn = UnitQuaternion::from_quaternion(turn.into());
                Pose::from_parts(position.into(), turn)
            }
        }
    }

    pub(crate) fn direction(&self, in_base: &Direction) -> Direction {
        match self {
            Self::Session => *in_base,
            Self::View { .. } => {
                Direction::new_normalize(rounded(&self.exact_direction(in_base), DIRECTION_QUANTUM))
            }
        }
    }

    /// A point in this frame, as it is: for what is asked, not for what is fitted.
    pub(crate) fn exact_point(&self, in_base: &Point) -> Point {
        match self {
            Self::Session => *in_base,
            Self::View { base_from_view } => base_from_view.inverse_transform_point(in_base),
        }
    }

    /// A direction in this frame, as it is.
    pub(crate) fn exact_direction(&self, in_base: &Direction) -> Vector {
        match self {
            Self::Session => in_base.into_inner(),
            Self::View { base_from_view } => base_from_view.inverse_transform_vector(in_base),
        }
    }

    /// A plane in this frame.
    pub(crate) fn plane(&self, in_base: &Plane) -> Plane {
        let foot = self.point(&Point::from(in_base.normal().into_inner() * in_base.offset_m()));
        let normal = self.direction(in_base.normal());
        Plane::new(normal, normal.dot(&foot.coords))
    }

    /// A point of this frame in the session's.
    pub(crate) fn point_in_base(&self, point: &Point) -> Point {
        match self {
            Self::Session => *point,
            Self::View { base_from_view } => base_from_view * point,
        }
    }

    /// A vector of this frame in the session's.
    pub(crate) fn vector_in_base(&self, vector: &Vector) -> Vector {
        match self {
            Self::Session => *vector,
            Self::View { base_from_view } => base_from_view.rotation * vector,
        }
    }

    /// A direction of this frame in the session's.
    pub(crate) fn direction_in_base(&self, direction: &Direction) -> Direction {
        match self {
            Self::Session => *direction,
            Self::View { base_from_view } => base_from_view.rotation * direction,
        }
    }
}

fn rounded(vector: &Vector, quantum: f64) -> Vector {
    vector.map(|x| round(x, quantum))
}

fn round(x: f64, quantum: f64) -> f64 {
    (x / quantum).round() * quantum
}

/// The direction to the farthest of some offsets, of which one at least is not zero.
fn farthest(offsets: impl Iterator<Item = Vector>) -> Direction {
    let farther = |best: Vector, offset: Vector| {
        if offset.norm() > best.norm() * (1.0 + MARGIN) { offset } else { best }
    };
    Direction::try_new(offsets.fold(Vector::zeros(), farther), 0.0).unwrap_or_else(Vector::x_axis)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prior(motion: &Pose, viewpoint: bool) -> VisualPrior {
        // Coordinates as a camera sends them, in single precision.
        let at = |k: u32| {
            let (u, v) = (f64::from(k % 13) / 13.0, f64::from(k * 7 % 31) / 31.0);
            motion * Point::new(f64::from(u as f32) * 0.1, f64::from(v as f32) * 0.07, 0.02 * (u * v).sin())
        };
        let camera = viewpoint.then(|| motion * Point::new(0.3, -0.2, 0.9));
        VisualPrior::new((0..200).map(at).collect(), None, camera).unwrap()
    }

    #[test]
    fn a_scene_and_its_rotated_twin_are_the_same_numbers() {
        for viewpoint in [true, false] {
            let here = prior(&Pose::identity(), viewpoint);
            let frame = WorkFrame::of_view(&here);
            for angles in [Vector::z() * 1.5, Vector::new(0.3, -2.0, 1.1), Vector::x() * 3.1] {
                let motion = Pose::new(Vector::new(0.4, -0.7, 0.2), angles);
                let there = prior(&motion, viewpoint);
                let twin = WorkFrame::of_view(&there);
                let (here, there) =
                    (Evidence::VisualPrior(here.clone()), Evidence::VisualPrior(there.clone()));
                assert_eq!(frame.enter(&here), twin.enter(&there));
            }
        }
    }

    #[test]
    fn what_is_entered_comes_back_to_where_it_was() {
        let frame = WorkFrame::of_view(&prior(&Pose::identity(), true));
        for point in [Point::new(0.05, 0.02, 0.01), Point::new(-3.0, 2.0, 7.0)] {
            assert!((frame.point_in_base(&frame.point(&point)) - point).norm() < 2.0 * QUANTUM_M);
            assert!((frame.point_in_base(&frame.exact_point(&point)) - point).norm() < 1e-14);
        }
        let up = Vector::z_axis();
        assert!(
            (frame.direction_in_base(&frame.direction(&up)).into_inner() - up.into_inner()).norm() < 1e-8
        );
    }
}
