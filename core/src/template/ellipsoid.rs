//! The ellipsoid template and its fit to the attractors (Section III-D).
//!
//! The paper's "modest initialisation" is early stopping: every fit starts afresh from a sphere as large
//! as what was seen, and a gradient descent of a fixed number of steps leaves it too small rather than
//! too large where little is known. As printed, `y = (x - t) diag(s) R` makes `y y^T` independent of
//! `R`, so the axes are those of the session's frame; [`Axes::Free`] lets them turn.

use nalgebra::{Rotation3, SVector};

use super::adam::Adam;
use super::patch_frame::{PatchFrame, principal_axis};
use crate::config::Axes;
use crate::evidence::attractor::{Attractor, Sense};
use crate::fingerprint::Fingerprint;
use crate::geometry::{Icosphere, Point, TriangleMesh, Vector};

/// Steps of the descent, each of about this size in the centre and in the logarithms of the semi-axes, in
/// lengths of the patch.
const STEPS: usize = 200;
const RATE: f64 = 0.01;
/// All visual points together weigh as much as this many touches at most: as printed each point counts,
/// and a camera with a finer grid would outweigh the touches.
const VISUAL_TOUCHES: f64 = 80.0;

/// An ellipsoid in the session's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Its centre, in metres.
    pub centre: Point,
    /// Its semi-axes, in metres.
    pub semi_axes: Vector,
    /// The directions of its axes, as columns.
    pub base_from_template: Rotation3<f64>,
}

impl Ellipsoid {
    /// Adds itself to a fingerprint.
    pub(crate) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self { centre, semi_axes, base_from_template } = self;
        fingerprint.vector(&centre.coords);
        fingerprint.vector(semi_axes);
        fingerprint.rotation(base_from_template);
    }

    /// A point in the template's frame, scaled so that the surface is the unit sphere.
    fn unit_from_base(&self, point: &Point) -> Vector {
        self.base_from_template
            .inverse_transform_vector(&(point - self.centre))
            .component_div(&self.semi_axes)
    }

    /// The algebraic residual `|y|² - 1`: 0 on the surface, negative inside, without unit.
    pub fn algebraic_residual(&self, point: &Point) -> f64 {
        self.unit_from_base(point).norm_squared() - 1.0
    }

    /// The signed distance to first order (Taubin), in metres.
    pub fn distance_m(&self, point: &Point) -> f64 {
        let y = self.unit_from_base(point);
        let radius = y.norm();
        let slope = y.component_div(&self.semi_axes).norm();
        // At the centre the gauge has no slope; the nearest surface is a smallest semi-axis away.
        if slope > 0.0 { (radius - 1.0) * radius / slope } else { -self.semi_axes.min() }
    }

    /// The icosphere mapped onto the ellipsoid: `R diag(a) S + t`.
    pub fn mesh(&self, sphere: &Icosphere) -> TriangleMesh {
        sphere.mesh_of(|direction| {
            self.centre + self.base_from_template * direction.component_mul(&self.semi_axes)
        })
    }
}

/// A fitted ellipsoid.
#[derive(Clone, Debug, PartialEq)]
pub struct EllipsoidFit {
    /// The ellipsoid.
    pub shape: Ellipsoid,
    /// What is left of the loss, the weighted mean of `(|y|^2 - 1)^2`, without unit.
    pub loss: f64,
}

/// The sphere that the first fit starts from, with axes taken from the data so that the fit moves
/// with it: towards the camera, then along the widest spread across that direction.
pub fn initial(attractors: &[Attractor], viewpoint: Option<&Point>) -> Ellipsoid {
    let frame = PatchFrame::of(attractors, viewpoint);
    let offsets: Vec<Vector> =
        attractors.iter().filter(|a| a.sense == Sense::Vision).map(|a| a.point - frame.origin).collect();
    let thinnest = principal_axis(&offsets, 0);
    let towards = frame.centre.try_normalize(1e-9).map_or(thinnest, |centre| -centre);
    let across: Vec<Vector> = offsets.iter().map(|v| v - towards * v.dot(&towards)).collect();
    let widest = principal_axis(&across, 2);
    let axes = [towards, widest, towards.cross(&widest)];
    Ellipsoid {
        centre: frame.base(&frame.centre),
        semi_axes: Vector::repeat(frame.length_m),
        base_from_template: Rotation3::from_basis_unchecked(&axes),
    }
}

/// Fits the ellipsoid to all attractors: minimises the weighted mean of `(|y|^2 - 1)^2` with `y = diag(1/a)
/// R^T (x - t)`, in lengths of the visual patch, by a descent that stops early.
pub fn fit(attractors: &[Attractor], viewpoint: Option<&Point>, axes: Axes) -> EllipsoidFit {
    let frame = PatchFrame::of(attractors, viewpoint);
    let visual_weight = (VISUAL_TOUCHES / frame.visual_points).min(1.0);
    let points: Vec<(Vector, f64)> = attractors
        .iter()
        .map(|a| (frame.local(&a.point), if a.sense == Sense::Vision { visual_weight } else { 1.0 }))
        .collect();
    let rotation = match axes {
        Axes::Frame => Rotation3::identity(),
        Axes::Free => initial(attractors, viewpoint).base_from_template,
    };
    let mut at = Parameters { centre: frame.centre, log_axes: Vector::zeros(), rotation };
    let mut adam = Adam::new(RATE);
    for _ in 0..STEPS {
        let (_, mut gradient) = at.loss(&points);
        if axes == Axes::Frame {
            gradient.fixed_rows_mut::<3>(6).fill(0.0);
        }
        at = at.moved(&adam.step(&gradient));
    }
    let shape = Ellipsoid {
        centre: frame.base(&at.centre),
        semi_axes: at.log_axes.map(f64::exp) * frame.length_m,
        base_from_template: at.rotation,
    };
    EllipsoidFit { shape, loss: at.loss(&points).0 }
}

/// Centre and logarithmic semi-axes in lengths of the patch, and the directions of the axes.
#[derive(Clone)]
struct Parameters {
    centre: Vector,
    log_axes: Vector,
    rotation: Rotation3<f64>,
}

impl Parameters {
    /// The loss, and its gradient by centre, logarithmic semi-axes and a rotation applied on the right,
    /// `R exp(delta)`.
    fn loss(&self, points: &[(Vector, f64)]) -> (f64, SVector<f64, 9>) {
        let inverse_axes = self.log_axes.map(|p| (-p).exp());
        let (mut loss, mut gradient, mut total) = (0.0, SVector::zeros(), 0.0);
        for (point, weight) in points {
            let local = self.rotation.inverse_transform_vector(&(point - self.centre));
            let y = local.component_mul(&inverse_axes);
            let residual = y.norm_squared() - 1.0;
            let slope = 2.0 * y.component_mul(&inverse_axes);
            let row = stack(&-(self.rotation * slope), &(-2.0 * y.component_mul(&y)), &slope.cross(&local));
            loss += weight * residual * residual;
            gradient += row * (2.0 * weight * residual);
            total += weight;
        }
        (loss / total, gradient / total)
    }

    fn moved(&self, step: &SVector<f64, 9>) -> Self {
        let part = |from: usize| Vector::new(step[from], step[from + 1], step[from + 2]);
        Self {
            centre: self.centre + part(0),
            log_axes: self.log_axes + part(3),
            rotation: self.rotation * Rotation3::new(part(6)),
        }
    }
}

fn stack(a: &Vector, b: &Vector, c: &Vector) -> SVector<f64, 9> {
    SVector::from_fn(|row, _| match row / 3 {
        0 => a[row],
        1 => b[row - 3],
        _ => c[row - 6],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn residuals_agree_with_the_reference_vectors() {
        let file: Value = serde_json::from_str(include_str!("../../tests/data/residuals.json")).unwrap();
        let numbers = |value: &Value| -> Vec<f64> {
            value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
        };
        let q = numbers(&file["q"]);
        let matrix: Vec<f64> = file["R"].as_array().unwrap().iter().flat_map(numbers).collect();
        let shape = Ellipsoid {
            centre: Point::new(q[0], q[1], q[2]),
            semi_axes: Vector::new(q[3].exp(), q[4].exp(), q[5].exp()),
            base_from_template: Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_row_slice(&matrix)),
        };
        let points = file["X"].as_array().unwrap().iter().map(|row| Point::from_slice(&numbers(row)));
        let expected = numbers(&file["algebraic"]).into_iter().zip(numbers(&file["ellipsoid_taubin"]));
        for (point, (algebraic, distance)) in points.zip(expected) {
            assert!((shape.algebraic_residual(&point) - algebraic).abs() < 1e-9);
            // The reference adds its guard of 1e-6 to every coordinate here too.
            assert!((shape.distance_m(&point) - distance).abs() < 5e-6);
        }
    }
}
