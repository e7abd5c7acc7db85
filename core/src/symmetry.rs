//! Symmetry: points of the template whose displacements are correlated.
//!
//! A touch on one side of a bottle says something about its other side. Symmetry is never imposed:
//! it is a share of the displacement's variance that mirrored or rotated points have in common, so
//! what breaks it is still found, and it is assumed only where the evidence supports it.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use nalgebra::{Matrix3, Rotation3, Unit};
use serde::{Deserialize, Serialize};

use crate::config::DeclaredSymmetry;
use crate::geometry::{Point, SurfacePoint, Vector};

/// Which points are symmetric to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Symmetry {
    /// None.
    None,
    /// Those that reflections at the planes across the marked axes bring together.
    Mirror([bool; 3]),
    /// Those at the same height and radius about an axis.
    Revolution(usize),
}

impl Symmetry {
    /// The hypotheses that are compared, given what the caller has declared.
    pub fn candidates(declared: Option<DeclaredSymmetry>) -> Vec<Self> {
        let mirrors = (1..8).map(|planes| Self::Mirror([0, 1, 2].map(|axis| planes & (1 << axis) > 0)));
        let revolutions = (0..3).map(Self::Revolution);
        match declared {
            None => revolutions.chain(mirrors).collect(),
            Some(DeclaredSymmetry::Revolution) => revolutions.collect(),
            Some(DeclaredSymmetry::Mirror) => mirrors.collect(),
        }
    }

    /// Motions, about the axes of a template, that bring a body of this symmetry onto itself; enough
    /// of them to tell one.
    pub(crate) fn motions(self) -> Vec<Matrix3<f64>> {
        match self {
            Self::None => Vec::new(),
            Self::Mirror(planes) => {
                let across = |axis: usize| {
                    let mut motion = Matrix3::identity();
                    motion[(axis, axis)] = -1.0;
                    motion
                };
                (0..3).filter(|axis| planes[*axis]).map(across).collect()
            }
            Self::Revolution(axis) => {
                let about = Unit::new_unchecked(Vector::ith(axis, 1.0));
                let turn = |angle: f64| Rotation3::from_axis_angle(&about, angle).into_inner();
                vec![turn(FRAC_PI_4), turn(FRAC_PI_2)]
            }
        }
    }

    /// Whether this axis of the template defines the symmetry.
    pub fn is_about(self, axis: usize) -> bool {
        match self {
            Self::None => false,
            Self::Mirror(planes) => planes[axis],
            Self::Revolution(about) => axis == about,
        }
    }
}

/// A symmetry about the axes of a template.
#[derive(Clone, Copy, Debug)]
pub struct SymmetryFrame {
    /// A point on all of its planes and axes, in metres.
    pub centre: Point,
    /// The directions of the axes, as columns.
    pub axes: Rotation3<f64>,
    /// Which points are symmetric.
    pub symmetry: Symmetry,
}

impl SymmetryFrame {
    /// The representative of each of some points.
    pub fn representatives(&self, points: &[SurfacePoint]) -> Vec<SurfacePoint> {
        points.iter().map(|point| self.representative(point)).collect()
    }

    /// The representative of a point: one point for all that are symmetric to each other.
    pub fn representative(&self, place: &SurfacePoint) -> SurfacePoint {
        let point = self.axes.inverse_transform_vector(&(place.point - self.centre.coords));
        let normal = self.axes.inverse_transform_vector(&place.normal);
        match self.symmetry {
            Symmetry::None => SurfacePoint { point, normal },
            Symmetry::Mirror(planes) => {
                let side = Vector::from_fn(|k, _| if planes[k] && point[k] < 0.0 { -1.0 } else { 1.0 });
                SurfacePoint { point: point.component_mul(&side), normal: normal.component_mul(&side) }
            }
            Symmetry::Revolution(axis) => {
                let mut across = point;
                across[axis] = 0.0;
                let radius = across.norm();
                let outward = across.try_normalize(1e-9).unwrap_or_else(Vector::zeros);
                SurfacePoint {
                    point: Vector::new(radius, 0.0, point[axis]),
                    normal: Vector::new(normal.dot(&outward), 0.0, normal[axis]),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame_of(symmetry: Symmetry) -> SymmetryFrame {
        SymmetryFrame {
            centre: Point::new(0.1, 0.0, 0.2),
            axes: Rotation3::from_euler_angles(0.3, 0.5, -0.2),
            symmetry,
        }
    }

    fn place(frame: &SymmetryFrame, local: Vector, normal: Vector) -> SurfacePoint {
        SurfacePoint {
            point: frame.centre.coords + frame.axes * local,
            normal: frame.axes * normal.normalize(),
        }
    }

    #[test]
    fn mirrored_points_have_one_representative_and_others_do_not() {
        let frame = frame_of(Symmetry::Mirror([true, false, false]));
        let here = place(&frame, Vector::new(0.02, 0.01, 0.03), Vector::new(1.0, 0.2, 0.0));
        let there = place(&frame, Vector::new(-0.02, 0.01, 0.03), Vector::new(-1.0, 0.2, 0.0));
        let elsewhere = place(&frame, Vector::new(0.02, -0.01, 0.03), Vector::new(1.0, -0.2, 0.0));
        let close = |a: SurfacePoint, b: SurfacePoint| {
            (a.point - b.point).norm() + (a.normal - b.normal).norm() < 1e-12
        };
        assert!(close(frame.representative(&here), frame.representative(&there)));
        assert!(!close(frame.representative(&here), frame.representative(&elsewhere)));
    }

    #[test]
    fn points_on_one_circle_have_one_representative() {
        let frame = frame_of(Symmetry::Revolution(2));
        let at = |turn: f64| {
            let outward = Vector::new(turn.cos(), turn.sin(), 0.0);
            frame.representative(&place(&frame, outward * 0.03 + Vector::z() * 0.05, outward + Vector::z()))
        };
        for turn in [0.5, 2.0, 4.0] {
            assert!((at(turn).point - at(0.0).point).norm() < 1e-12);
            assert!((at(turn).normal - at(0.0).normal).norm() < 1e-12);
        }
    }

    #[test]
    fn a_declared_symmetry_narrows_the_hypotheses() {
        assert_eq!(Symmetry::candidates(None).len(), 10);
        let revolutions = Symmetry::candidates(Some(DeclaredSymmetry::Revolution));
        assert!(revolutions.iter().all(|s| matches!(s, Symmetry::Revolution(_))));
        let mirrors = Symmetry::candidates(Some(DeclaredSymmetry::Mirror));
        assert_eq!(mirrors.len(), 7);
        for across in 0..3 {
            let plane = Symmetry::Mirror([0, 1, 2].map(|axis| axis == across));
            assert!(mirrors.contains(&plane), "{plane:?}");
        }
    }
}
