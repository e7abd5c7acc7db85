//! Local deformation: a thin plate over the template's surface, pinned to the attractors
//! (Section III-E).

use faer::linalg::solvers::Solve;
use faer::{Col, Mat, Side};

use crate::geometry::{Point, Vector};
use crate::template::Projection;
use crate::vectorised::{ln, widest};

/// Coordinates are divided by this before the kernel, in metres.
const LENGTH_UNIT_M: f64 = 0.05;
/// Added to the kernel's diagonal: lets the plate miss an attractor a little, and coincident
/// attractors share their place.
const SMOOTHING: f64 = 1e-3;
/// Centres whose kernels are evaluated at a time.
const LANES: usize = 16;
/// Keeps the system regular when the centres span no volume.
const POLYNOMIAL_RIDGE: f64 = -1e-9;

/// A smooth displacement over space, `F` of Section III-E: `Σ w φ(|x - c|) + linear(x)`, with
/// `φ(r) = r² log r`.
#[derive(Clone, Debug)]
pub struct ThinPlate {
    origin: Point,
    centres: Vec<Centres>,
    linear: [f64; 4],
    residual_m: f64,
}

/// The coordinates of some centres and their weights. The last ones are filled up with weights of zero.
type Centres = [[f64; LANES]; 4];

impl ThinPlate {
    /// The plate through the given displacements, at least one.
    pub fn fit(projections: &[Projection]) -> Self {
        let count = projections.len();
        let sum: Vector = projections.iter().map(|projection| projection.foot.point).sum();
        let origin = Point::from(sum / count.max(1) as f64);
        let centres: Vec<Vector> =
            projections.iter().map(|projection| scaled(&origin, &projection.foot.point.into())).collect();
        let basis = |row: usize, power: usize| if power == 0 { 1.0 } else { centres[row][power - 1] };
        // Below its diagonal; it is symmetric.
        let mut system = Mat::<f64>::zeros(count + 4, count + 4);
        widest(
            #[inline(always)]
            || {
                for (column, centre) in centres.iter().enumerate() {
                    let below = &mut system.col_as_slice_mut(column)[column..count];
                    for (entry, other) in below.iter_mut().zip(&centres[column..]) {
                        let (dx, dy, dz) = (other.x - centre.x, other.y - centre.y, other.z - centre.z);
                        *entry = kernel(dx * dx + dy * dy + dz * dz);
                    }
                    below[0] = SMOOTHING;
                }
            },
        );
        for power in 0..4 {
            (0..count).for_each(|column| system[(count + power, column)] = basis(column, power));
            system[(count + power, count + power)] = POLYNOMIAL_RIDGE;
        }
        let displacement = |row: usize| projections.get(row).map_or(0.0, |p| p.height_m);
        let factor = system.lblt(Side::Lower);
        let solution = factor.solve(Col::from_fn(count + 4, displacement));
        let weights: Vec<f64> = (0..count).map(|row| solution[row]).collect();
        // The smoothing term is exactly what separates the plate from its data.
        let mean_square = weights.iter().map(|w| (SMOOTHING * w).powi(2)).sum::<f64>() / count.max(1) as f64;
        let linear = std::array::from_fn(|power| solution[count + power]);
        let block = |from: usize| {
            let mut block = [[0.0; LANES]; 4];
            for (lane, row) in (from..count.min(from + LANES)).enumerate() {
                (0..3).for_each(|axis| block[axis][lane] = centres[row][axis]);
                block[3][lane] = weights[row];
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
        let mut bending = [0.0; LANES];
        for [xs, ys, zs, weights] in &self.centres {
            for lane in 0..LANES {
                let (dx, dy, dz) = (xs[lane] - at.x, ys[lane] - at.y, zs[lane] - at.z);
                bending[lane] += weights[lane] * kernel(dx * dx + dy * dy + dz * dz);
            }
        }
        let flat = self.linear[0] + self.linear[1] * at.x + self.linear[2] * at.y + self.linear[3] * at.z;
        let mut sum = flat;
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

fn scaled(origin: &Point, point: &Point) -> Vector {
    (point - origin) / LENGTH_UNIT_M
}

/// `r² log r` from `r²`; 0 at 0.
#[inline(always)]
fn kernel(square: f64) -> f64 {
    // A square of nearly zero keeps the logarithm finite, and gives zero all the same.
    let square = square.max(1e-300);
    0.5 * square * ln(square)
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
