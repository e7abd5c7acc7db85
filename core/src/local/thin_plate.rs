//! Local deformation: a thin plate over the template's surface, pinned to the attractors
//! (Section III-E).
//!
//! The plate's weights are orthogonal to all affine functions at the centres, and for such weights the kernel matrix
//! is positive definite: projected onto them the system has a Cholesky factor.

use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::linalg::solvers::Solve;
use faer::{Accum, Col, Mat, Par, Side};

use super::affine::Affine;
use super::cholesky;
use crate::geometry::{Point, Vector};
use crate::template::Projection;
use crate::vectorised::{coarse_ln, widest};

/// Coordinates are divided by this before the kernel, in metres.
const LENGTH_UNIT_M: f64 = 0.05;
/// Added to the kernel's diagonal: lets the plate miss an attractor a little, and coincident
/// attractors share their place.
const SMOOTHING: f64 = 1e-3;
/// Centres whose kernels are evaluated at a time.
const LANES: usize = 32;

/// A smooth displacement over space, `F` of Section III-E: `Σ w φ(|x - c|) + linear(x)`, with
/// `φ(r) = r² log r`.
#[derive(Clone, Debug)]
pub struct ThinPlate {
    origin: Point,
    centres: Vec<Centres>,
    linear: [f64; 4],
    residual_m: f64,
}

/// The coordinates of some centres, the squares of their norms, and their weights. The last ones are filled up with
/// weights of zero.
type Centres = [[f64; LANES]; 5];

impl ThinPlate {
    /// The plate through the given displacements, at least one.
    pub fn fit(projections: &[Projection]) -> Self {
        let count = projections.len();
        let sum: Vector = projections.iter().map(|projection| projection.foot.point).sum();
        let origin = Point::from(sum / count.max(1) as f64);
        let centres: Vec<Vector> =
            projections.iter().map(|projection| scaled(&origin, &projection.foot.point.into())).collect();
        let heights = Col::from_fn(count, |row| projections[row].height_m);
        let affine = Affine::at(&centres);
        let (basis, of_basis) = (&affine.basis, affine.basis.transpose());
        let (system, bent) = system(&centres, basis);
        let flat = of_basis * &heights;
        let right = &heights - basis * &flat;
        let mut solution = match cholesky::factor(system) {
            Some(factor) => {
                let mut solution = right;
                cholesky::solve(&factor, solution.as_mat_mut());
                solution
            }
            // Between centres kilometres apart kernels are so large that the smoothing is lost in their rounding.
            None => self::system(&centres, basis).0.lblt(Side::Lower).solve(right),
        };
        // Orthogonal to the affine functions but for rounding, which this takes away.
        solution -= basis * (of_basis * &solution);
        let shares = &flat - bent.transpose() * &solution;
        let linear = affine.coefficients(shares.iter().copied());
        let weights: Vec<f64> = solution.iter().copied().collect();
        // The smoothing term is exactly what separates the plate from its data.
        let mean_square = weights.iter().map(|w| (SMOOTHING * w).powi(2)).sum::<f64>() / count.max(1) as f64;
        let block = |from: usize| {
            let mut block = [[0.0; LANES]; 5];
            for (lane, row) in (from..count.min(from + LANES)).enumerate() {
                (0..3).for_each(|axis| block[axis][lane] = centres[row][axis]);
                block[3][lane] = centres[row].norm_squared();
                block[4][lane] = weights[row];
            }
            block
        };
        let centres = (0..count).step_by(LANES).map(block).collect();
        Self { origin, centres, linear, residual_m: mean_square.sqrt() }
    }

    /// The displacement at a point, in metres.
    pub fn displacement_m(&self, point: &Point) -> f64 {
        self.heights_m(&[*point])[0]
    }

    /// The displacements at some points, in metres.
    pub fn heights_m(&self, points: &[Point]) -> Vec<f64> {
        let mut heights_m = vec![0.0; points.len()];
        widest(
            #[inline(always)]
            || {
                for (height_m, point) in heights_m.iter_mut().zip(points) {
                    *height_m = self.height_m(point);
                }
            },
        );
        heights_m
    }

    #[inline(always)]
    fn height_m(&self, point: &Point) -> f64 {
        let at = (point - self.origin) / LENGTH_UNIT_M;
        let (square, [x, y, z]) = (at.norm_squared(), [-2.0 * at.x, -2.0 * at.y, -2.0 * at.z]);
        let mut bending = [0.0; LANES];
        for [xs, ys, zs, squares, weights] in &self.centres {
            for lane in 0..LANES {
                // |x - c|² = |x|² + |c|² - 2 x·c, whose rounding the kernel does not feel.
                let apart = zs[lane].mul_add(z, squares[lane] + square);
                let apart = xs[lane].mul_add(x, ys[lane].mul_add(y, apart));
                bending[lane] = weights[lane].mul_add(kernel(apart), bending[lane]);
            }
        }
        let mut sum = self.linear[0] + self.linear[1] * at.x + self.linear[2] * at.y + self.linear[3] * at.z;
        for lane in bending {
            sum += lane;
        }
        sum
    }

    /// Root mean square of what smoothing leaves of the heights it was fitted to, in metres.
    pub fn residual_m(&self) -> f64 {
        self.residual_m
    }
}

/// The kernel of any two centres, below the diagonal; zero on it and above.
fn kernels(centres: &[Vector]) -> Mat<f64> {
    let mut kernels = Mat::<f64>::zeros(centres.len(), centres.len());
    widest(
        #[inline(always)]
        || {
            for (column, centre) in centres.iter().enumerate() {
                let below = &mut kernels.col_as_slice_mut(column)[column + 1..];
                for (entry, other) in below.iter_mut().zip(&centres[column + 1..]) {
                    let (dx, dy, dz) = (other.x - centre.x, other.y - centre.y, other.z - centre.z);
                    *entry = kernel(dx * dx + dy * dy + dz * dz);
                }
            }
        },
    );
    kernels
}

/// `(1 - B Bᵀ) K (1 - B Bᵀ)` with the smoothing, which makes it positive definite, on the diagonal and below; and `K B`.
fn system(centres: &[Vector], basis: &Mat<f64>) -> (Mat<f64>, Mat<f64>) {
    let (mut system, of_basis) = (kernels(centres), basis.transpose());
    // K B, from what lies below the diagonal of K.
    let mut bent = Mat::zeros(centres.len(), basis.ncols());
    let (whole, below) = (BlockStructure::Rectangular, BlockStructure::TriangularLower);
    let above = BlockStructure::StrictTriangularUpper;
    matmul(&mut bent, whole, Accum::Replace, &system, below, basis, whole, 1.0, Par::Seq);
    matmul(&mut bent, whole, Accum::Add, system.transpose(), above, basis, whole, 1.0, Par::Seq);
    let half = &bent - basis * (of_basis * &bent) * faer::Scale(0.5);
    matmul(&mut system, below, Accum::Add, basis, whole, half.transpose(), whole, -1.0, Par::Seq);
    matmul(&mut system, below, Accum::Add, &half, whole, of_basis, whole, -1.0, Par::Seq);
    (0..centres.len()).for_each(|at| system[(at, at)] += SMOOTHING);
    (system, bent)
}

fn scaled(origin: &Point, point: &Point) -> Vector {
    (point - origin) / LENGTH_UNIT_M
}

/// `r² log r` from `r²`; 0 at 0. The logarithm is good to 2e-11, for which a plate moves by nanometres at most.
#[inline(always)]
fn kernel(square: f64) -> f64 {
    // A square of nearly zero keeps the logarithm finite, and gives zero all the same.
    0.5 * square * coarse_ln(square.max(1e-300))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SurfacePoint;

    #[derive(Debug)]
    struct Vectors {
        projections: Vec<Projection>,
        queries: Vec<Point>,
        expected: Vec<f64>,
    }

    fn at(point: &Point, height_m: f64) -> Projection {
        Projection { foot: SurfacePoint::new(point, &Vector::z_axis()), height_m }
    }

    fn vectors() -> Vectors {
        let file: serde_json::Value =
            serde_json::from_str(include_str!("../../tests/data/rbf.json")).unwrap();
        let numbers = |value: &serde_json::Value| -> Vec<f64> {
            value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
        };
        let points = |key: &str| -> Vec<Point> {
            file[key].as_array().unwrap().iter().map(|row| Point::from_slice(&numbers(row))).collect()
        };
        let projections = points("centres")
            .into_iter()
            .zip(numbers(&file["d"]))
            .map(|(point, height_m)| at(&point, height_m))
            .collect();
        Vectors { projections, queries: points("query"), expected: numbers(&file["r2log"]) }
    }

    #[test]
    fn the_plate_agrees_with_the_reference_vectors() {
        let Vectors { projections, queries, expected } = vectors();
        let plate = ThinPlate::fit(&projections);
        for (query, expected) in queries.iter().zip(expected) {
            assert!((plate.displacement_m(query) - expected).abs() < 1e-9);
        }
    }

    /// Attractors around an ellipsoid whose heights are `noise_m` off, up and down.
    fn bumpy(count: u32, noise_m: f64) -> Vec<Projection> {
        let place = |k: f64| Point::new(0.03 * k.sin() + 0.4, 0.05 * (1.7 * k).cos(), 0.08 * (2.3 * k).sin());
        let bump = |k: f64| 0.004 * (0.9 * k.sin()).cos() + noise_m * (37.0 * k).sin();
        (0..count).map(f64::from).map(|k| at(&place(k), bump(k))).collect()
    }

    #[test]
    fn heights_are_the_sum_of_the_formula_and_the_plate_solves_its_equations() {
        for (count, noise_m) in [(3, 0.0), (40, 0.0), (300, 0.0), (300, 0.003)] {
            let projections = bumpy(count, noise_m);
            let plate = ThinPlate::fit(&projections);
            let centres: Vec<(Vector, f64)> = (0..count as usize)
                .map(|row| {
                    let (block, lane) = (&plate.centres[row / LANES], row % LANES);
                    (Vector::new(block[0][lane], block[1][lane], block[2][lane]), block[4][lane])
                })
                .collect();
            let sum = |point: &Point| {
                let x = scaled(&plate.origin, point);
                let bending = centres.iter().map(|(centre, weight)| {
                    let r = (x - centre).norm();
                    if r > 0.0 { weight * r * r * r.ln() } else { 0.0 }
                });
                let [a, b, c, d] = plate.linear;
                bending.sum::<f64>() + a + b * x.x + c * x.y + d * x.z
            };
            let queries: Vec<Point> =
                bumpy(200, 0.0).iter().map(|p| Point::from(p.foot.point + Vector::repeat(0.001))).collect();
            let feet: Vec<Point> = projections.iter().map(|p| p.foot.point.into()).collect();
            for points in [&queries, &feet] {
                for (found, point) in plate.heights_m(points).iter().zip(points) {
                    assert!((found - sum(point)).abs() < 1e-8, "{found} for {} with {noise_m}", sum(point));
                }
            }
            // The smoothing's share of each height; and weights are orthogonal to all affine functions.
            for ((foot, (_, weight)), projection) in feet.iter().zip(&centres).zip(&projections) {
                assert!((sum(foot) + SMOOTHING * weight - projection.height_m).abs() < 1e-8);
            }
            let balance: Vector = centres.iter().map(|(centre, weight)| centre * *weight).sum();
            assert!(centres.iter().map(|(_, weight)| weight).sum::<f64>().abs() < 1e-12);
            assert!(balance.norm() < 1e-12, "{balance}");
        }
    }

    #[test]
    fn centres_kilometres_apart_give_a_finite_plate() {
        let far =
            |k: f64| at(&Point::new(9e3 * k.sin(), 9e3 * (1.7 * k).cos(), 9e3 * (2.3 * k).sin()), 0.001);
        let projections: Vec<_> = (0..60).map(f64::from).map(far).collect();
        let plate = ThinPlate::fit(&projections);
        assert!((plate.displacement_m(&Point::new(10.0, -20.0, 30.0)) - 0.001).abs() < 1e-3);
    }

    #[test]
    fn affine_displacements_are_reproduced_everywhere() {
        let affine = |p: &Point| 0.002 + 0.1 * p.x - 0.05 * p.y + 0.02 * p.z;
        let projections: Vec<_> = vectors()
            .projections
            .iter()
            .map(|p| Projection { height_m: affine(&p.foot.point.into()), ..*p })
            .collect();
        let plate = ThinPlate::fit(&projections);
        for query in [Point::new(0.2, -0.1, 0.05), Point::new(-0.3, 0.0, 0.4)] {
            assert!((plate.displacement_m(&query) - affine(&query)).abs() < 1e-9);
        }
        assert!(plate.residual_m() < 1e-9);
    }

    #[test]
    fn coincident_and_coplanar_attractors_give_a_finite_plate() {
        let flat = |x: f64, y: f64, d: f64| at(&Point::new(x, y, 0.1), d);
        let projections =
            [flat(0.0, 0.0, 0.001), flat(0.0, 0.0, 0.002), flat(0.02, 0.0, 0.0), flat(0.0, 0.02, 0.001)];
        let plate = ThinPlate::fit(&projections);
        assert!(plate.displacement_m(&Point::new(0.01, 0.01, 0.1)).abs() < 0.01);
        assert!(plate.displacement_m(&Point::new(0.01, 0.01, 0.2)).is_finite());
    }
}
