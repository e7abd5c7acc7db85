//! The ellipsoid template and its fit to the attractors.
//!
//! As printed, `y = (x - t) diag(s) R` makes `y yᵀ` independent of `R`. The rotation comes first
//! here: `y = diag(1/a) Rᵀ (x - t)`, with semi-axes `a = exp(p)`. The "modest initialisation" of
//! the paper is a permanent prior: without it, the side of a cylinder drives a semi-axis to
//! nearly a metre.

use nalgebra::{Rotation3, SVector};

use super::least_squares::{NormalEquations, minimise};
use super::patch_frame::{LOG_SIZE, PatchFrame, clamp_log_size, principal_axis};
use crate::evidence::attractor::{Attractor, Sense};
use crate::fingerprint::Fingerprint;
use crate::geometry::{Icosphere, Point, TriangleMesh, Vector};

/// Strength of the prior on size; on position it is half of it. 0.3 diverges, 3 under-fits.
const PRIOR_WEIGHT: f64 = 1.0;
/// All visual points together weigh as much as this many touches at most. As printed, each point
/// counts, and a camera with a finer grid outweighs the prior until the template diverges.
const VISUAL_TOUCHES: f64 = 80.0;
const FIRST_ITERATIONS: usize = 100;
const WARM_ITERATIONS: usize = 30;

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
    /// The minimised cost, `0.5 Σ r²` in normalised units.
    pub cost: f64,
    /// Whether a semi-axis ran into the bound of its size.
    pub diverged: bool,
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

/// Fits the ellipsoid to all attractors; `warm` marks a start that is already close.
///
/// Minimises `Σ (|y|² - 1)²` (Section III-D, with the rotation first) plus the prior
/// `w log(a / L)` on size and `w/2 (t - t0)` on position, in units of the visual patch.
pub fn fit(
    attractors: &[Attractor],
    viewpoint: Option<&Point>,
    start: &Ellipsoid,
    warm: bool,
) -> EllipsoidFit {
    let frame = PatchFrame::of(attractors, viewpoint);
    let visual_weight = (VISUAL_TOUCHES / frame.visual_points).sqrt().min(1.0);
    let points: Vec<(Vector, f64)> = attractors
        .iter()
        .map(|a| {
            let weight = if a.sense == Sense::Vision { visual_weight } else { 1.0 };
            (frame.local(&a.point), weight)
        })
        .collect();
    let parameters = Parameters {
        centre: frame.local(&start.centre),
        log_axes: start.semi_axes.map(|a| clamp_log_size((a / frame.length_m).ln())),
        rotation: start.base_from_template,
    };
    let iterations = if warm { WARM_ITERATIONS } else { FIRST_ITERATIONS };
    let minimum = minimise(
        parameters,
        iterations,
        |parameters| parameters.linearise(&points, &frame.centre),
        Parameters::retract,
    );
    let found = minimum.parameters;
    let shape = Ellipsoid {
        centre: frame.base(&found.centre),
        semi_axes: found.log_axes.map(f64::exp) * frame.length_m,
        base_from_template: found.rotation,
    };
    EllipsoidFit { shape, cost: minimum.cost, diverged: found.log_axes.max() >= LOG_SIZE.1 }
}

/// Centre and logarithmic semi-axes over the patch's length, and the axes.
#[derive(Clone)]
struct Parameters {
    centre: Vector,
    log_axes: Vector,
    rotation: Rotation3<f64>,
}

impl Parameters {
    /// Residuals and their analytic derivatives by centre, log semi-axes and a rotation applied
    /// on the right, `R exp(δ)`.
    fn linearise(&self, points: &[(Vector, f64)], prior_centre: &Vector) -> NormalEquations<9> {
        let inverse_axes = self.log_axes.map(|p| (-p).exp());
        let mut equations = NormalEquations::zero();
        for (point, weight) in points {
            let local = self.rotation.inverse_transform_vector(&(point - self.centre));
            let y = local.component_mul(&inverse_axes);
            let slope = 2.0 * y.component_mul(&inverse_axes);
            let by_centre = -(self.rotation * slope);
            let by_log_axes = -2.0 * y.component_mul(&y);
            let by_rotation = slope.cross(&local);
            let row = stack(&by_centre, &by_log_axes, &by_rotation);
            equations.add(weight * (y.norm_squared() - 1.0), &(row * *weight));
        }
        for axis in 0..3 {
            let mut row = SVector::zeros();
            row[axis] = 0.5 * PRIOR_WEIGHT;
            equations.add(0.5 * PRIOR_WEIGHT * (self.centre[axis] - prior_centre[axis]), &row);
            let mut row = SVector::zeros();
            row[3 + axis] = PRIOR_WEIGHT;
            equations.add(PRIOR_WEIGHT * self.log_axes[axis], &row);
        }
        equations
    }

    fn retract(&self, step: &SVector<f64, 9>) -> Self {
        let part = |from: usize| Vector::new(step[from], step[from + 1], step[from + 2]);
        Self {
            centre: self.centre + part(0),
            log_axes: (self.log_axes + part(3)).map(clamp_log_size),
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
