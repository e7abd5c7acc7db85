//! The ellipsoid template and its fit to the attractors (Section III-D).
//!
//! The paper's "modest initialisation" is early stopping: every fit starts afresh from a sphere as large
//! as what was seen, and a gradient descent of a fixed number of steps leaves it too small rather than
//! too large where little is known. As printed, `y = (x - t) diag(s) R` makes `y y^T` independent of
//! `R`, so the axes are those of the session's frame; [`Axes::Free`] lets them turn.

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector};

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
    let moments = Moments::of(&points);
    let mut at = Parameters { centre: frame.centre, log_axes: Vector::zeros(), rotation };
    let mut adam = Adam::new(RATE);
    for _ in 0..STEPS {
        let mut gradient = at.gradient(&moments);
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
    EllipsoidFit { shape, loss: at.loss(&points) }
}

/// What the descent needs of the points: the weighted means of the products of any two of `1, x, y, z, x², y²,
/// z², xy, xz, yz`. `|y|² - 1` is linear in those ten, so a step costs the same however many points there are.
struct Moments(SMatrix<f64, TERMS, TERMS>);

const TERMS: usize = 10;

impl Moments {
    fn of(points: &[(Vector, f64)]) -> Self {
        let mut sums = SMatrix::<f64, TERMS, TERMS>::zeros();
        let mut total = 0.0;
        for (point, weight) in points {
            let (x, y, z) = (point.x, point.y, point.z);
            let terms = SVector::from([1.0, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z]);
            sums.ger(*weight, &terms, &terms, 1.0);
            total += weight;
        }
        Self(sums / total)
    }
}

/// Centre and logarithmic semi-axes in lengths of the patch, and the directions of the axes.
#[derive(Clone)]
struct Parameters {
    centre: Vector,
    log_axes: Vector,
    rotation: Rotation3<f64>,
}

impl Parameters {
    /// The weighted mean of `(|y|² - 1)²`.
    fn loss(&self, points: &[(Vector, f64)]) -> f64 {
        let inverse_axes = self.log_axes.map(|p| (-p).exp());
        let (mut loss, mut total) = (0.0, 0.0);
        for (point, weight) in points {
            let local = self.rotation.inverse_transform_vector(&(point - self.centre));
            let residual = local.component_mul(&inverse_axes).norm_squared() - 1.0;
            loss += weight * residual * residual;
            total += weight;
        }
        loss / total
    }

    /// Its gradient by centre, logarithmic semi-axes and a rotation applied on the right, `R exp(delta)`.
    fn gradient(&self, Moments(moments): &Moments) -> SVector<f64, 9> {
        let (centre, rotation) = (&self.centre, self.rotation.matrix());
        let inverse_squares = self.log_axes.map(|p| (-2.0 * p).exp());
        // |y|² - 1 = (x - t)ᵀ A (x - t) - 1, as a sum over the ten terms.
        let form = rotation * Matrix3::from_diagonal(&inverse_squares) * rotation.transpose();
        let slope = form * centre;
        let residual = SVector::<f64, TERMS>::from([
            centre.dot(&slope) - 1.0,
            -2.0 * slope.x,
            -2.0 * slope.y,
            -2.0 * slope.z,
            form.m11,
            form.m22,
            form.m33,
            2.0 * form.m12,
            2.0 * form.m13,
            2.0 * form.m23,
        ]);
        // The means of the residual with 1, with x and with x xᵀ; then about the centre, and in the template's frame.
        let means = moments * residual;
        let mean = means[0];
        let first = Vector::new(means[1], means[2], means[3]);
        let second = Matrix3::new(
            means[4], means[7], means[8], //
            means[7], means[5], means[9], //
            means[8], means[9], means[6],
        );
        let offset = first - centre * mean;
        let about = second - first * centre.transpose() - centre * offset.transpose();
        let local = rotation.transpose() * about * rotation;
        let turning = |a: usize, b: usize| (inverse_squares[a] - inverse_squares[b]) * local[(a, b)];
        4.0 * stack(
            &-(form * offset),
            &-inverse_squares.component_mul(&local.diagonal()),
            &Vector::new(turning(1, 2), turning(2, 0), turning(0, 1)),
        )
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

    /// The gradient as its formula reads, point by point.
    fn summed(at: &Parameters, points: &[(Vector, f64)]) -> SVector<f64, 9> {
        let inverse_axes = at.log_axes.map(|p| (-p).exp());
        let (mut gradient, mut total) = (SVector::zeros(), 0.0);
        for (point, weight) in points {
            let local = at.rotation.inverse_transform_vector(&(point - at.centre));
            let y = local.component_mul(&inverse_axes);
            let slope = 2.0 * y.component_mul(&inverse_axes);
            let row = stack(&-(at.rotation * slope), &(-2.0 * y.component_mul(&y)), &slope.cross(&local));
            gradient += row * (2.0 * weight * (y.norm_squared() - 1.0));
            total += weight;
        }
        gradient / total
    }

    #[test]
    fn the_gradient_from_the_moments_is_the_one_summed_over_the_points() {
        let points: Vec<(Vector, f64)> = (0..300)
            .map(|k| {
                let turn = f64::from(k);
                let point =
                    Vector::new(3.0 * turn.sin() - 1.0, (1.7 * turn).cos(), 2.0 * (2.3 * turn).sin() + 4.0);
                (point, if k % 3 == 0 { 1.0 } else { 0.4 })
            })
            .collect();
        let moments = Moments::of(&points);
        for size in [0.3, 1.0, 5.0_f64] {
            let at = Parameters {
                centre: Vector::new(-0.5, 0.2, 3.0),
                log_axes: Vector::new(size.ln(), 0.3, -0.2),
                rotation: Rotation3::new(Vector::new(0.4, -0.7, 0.2)),
            };
            let (found, expected) = (at.gradient(&moments), summed(&at, &points));
            assert!((found - expected).norm() < 1e-12 * expected.norm(), "{found} for {expected}");
            // And both are the slope of the loss.
            for parameter in 0..9 {
                let mut step = SVector::zeros();
                step[parameter] = 1e-5;
                let rise = at.moved(&step).loss(&points) - at.moved(&-step).loss(&points);
                assert!((rise / 2e-5 - found[parameter]).abs() < 1e-6 * expected.norm(), "{parameter}");
            }
        }
    }

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
