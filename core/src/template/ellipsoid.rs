//! The ellipsoid template and its fit to the attractors.
//!
//! As printed, `y = (x - t) diag(s) R` makes `y yᵀ` independent of `R`. The rotation comes first
//! here: `y = diag(1/a) Rᵀ (x - t)`, with semi-axes `a = exp(p)`. The "modest initialisation" of
//! the paper is a permanent prior: without it, the side of a cylinder drives a semi-axis to
//! nearly a metre.

use nalgebra::{Matrix3, Rotation3, SVector};

use super::TemplateFit;
use crate::attractor::{Attractor, Sense};
use crate::geometry::{Icosphere, Point, TriangleMesh, Vector};
use crate::least_squares::{NormalEquations, minimise};

/// Strength of the prior on size; on position it is half of it. 0.3 diverges, 3 under-fits.
const PRIOR_WEIGHT: f64 = 1.0;
/// Bounds of the logarithm of a semi-axis over the prior's length.
const LOG_SIZE: (f64, f64) = (-3.0, 3.5);
/// All visual points together weigh as much as this many touches at most. As printed, each point
/// counts, and a camera with a finer grid outweighs the prior until the template diverges.
const VISUAL_WEIGHT: f64 = 80.0;
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

/// The frame in which a fit is well scaled, and what the prior pulls towards.
struct Normalisation {
    /// Centroid of the visual points.
    origin: Point,
    /// Their root mean square distance from it, in metres.
    length_m: f64,
    /// How many visual points there are, at least one.
    visual_points: f64,
    /// Where the prior expects the centre: one length behind the patch, seen from the camera.
    centre: Vector,
}

impl Normalisation {
    fn of(attractors: &[Attractor], viewpoint: Option<&Point>) -> Self {
        let visual: Vec<&Point> =
            attractors.iter().filter(|a| a.sense == Sense::Vision).map(|a| &a.point).collect();
        let count = visual.len().max(1) as f64;
        let origin = Point::from(visual.iter().map(|point| point.coords).sum::<Vector>() / count);
        let mean_square = visual.iter().map(|&point| (point - origin).norm_squared()).sum::<f64>() / count;
        let to_camera = viewpoint.and_then(|viewpoint| (viewpoint - origin).try_normalize(1e-9));
        Self {
            origin,
            length_m: mean_square.sqrt(),
            visual_points: count,
            centre: to_camera.map_or_else(Vector::zeros, |direction| -direction),
        }
    }
}

/// The sphere that the first fit starts from, with axes taken from the data so that the fit moves
/// with it: towards the camera, then along the widest spread across that direction.
pub fn initial(attractors: &[Attractor], viewpoint: Option<&Point>) -> Ellipsoid {
    let frame = Normalisation::of(attractors, viewpoint);
    let offsets: Vec<Vector> =
        attractors.iter().filter(|a| a.sense == Sense::Vision).map(|a| a.point - frame.origin).collect();
    let thinnest = principal_axis(&offsets, 0);
    let towards = frame.centre.try_normalize(1e-9).map_or(thinnest, |centre| -centre);
    let across: Vec<Vector> = offsets.iter().map(|v| v - towards * v.dot(&towards)).collect();
    let widest = principal_axis(&across, 2);
    let axes = [towards, widest, towards.cross(&widest)];
    Ellipsoid {
        centre: frame.origin + frame.centre * frame.length_m,
        semi_axes: Vector::repeat(frame.length_m),
        base_from_template: Rotation3::from_basis_unchecked(&axes),
    }
}

/// The principal direction of rank `rank` (0 = least spread), with the sign of its third moment.
fn principal_axis(offsets: &[Vector], rank: usize) -> Vector {
    let covariance: Matrix3<f64> = offsets.iter().map(|v| v * v.transpose()).sum();
    let eigen = covariance.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let axis = eigen.eigenvectors.column(order[rank]).into_owned();
    let skew: f64 = offsets.iter().map(|v| v.dot(&axis).powi(3)).sum();
    if skew < 0.0 { -axis } else { axis }
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
) -> TemplateFit {
    let frame = Normalisation::of(attractors, viewpoint);
    let visual_weight = (VISUAL_WEIGHT / frame.visual_points).sqrt().min(1.0);
    let points: Vec<(Vector, f64)> = attractors
        .iter()
        .map(|a| {
            let weight = if a.sense == Sense::Vision { visual_weight } else { 1.0 };
            ((a.point - frame.origin) / frame.length_m, weight)
        })
        .collect();
    let parameters = Parameters {
        centre: (start.centre - frame.origin) / frame.length_m,
        log_axes: start.semi_axes.map(|a| (a / frame.length_m).ln().clamp(LOG_SIZE.0, LOG_SIZE.1)),
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
        centre: frame.origin + found.centre * frame.length_m,
        semi_axes: found.log_axes.map(f64::exp) * frame.length_m,
        base_from_template: found.rotation,
    };
    let mean_square = attractors.iter().map(|a| shape.distance_m(&a.point).powi(2)).sum::<f64>()
        / attractors.len().max(1) as f64;
    TemplateFit {
        shape,
        iterations: minimum.iterations,
        converged: minimum.converged,
        cost: minimum.cost,
        rms_m: mean_square.sqrt(),
        diverged: found.log_axes.max() >= LOG_SIZE.1,
    }
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
            log_axes: (self.log_axes + part(3)).map(|p| p.clamp(LOG_SIZE.0, LOG_SIZE.1)),
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
