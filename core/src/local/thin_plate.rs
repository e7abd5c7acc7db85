//! Local deformation: a thin plate over the template's surface, pinned to the attractors
//! (Section III-E).

use faer::linalg::solvers::Solve;
use faer::{Col, Mat};
use wide::f64x4;

use crate::geometry::{Point, Vector};
use crate::template::Projection;

/// Coordinates are divided by this before the kernel, in metres.
const LENGTH_UNIT_M: f64 = 0.05;
/// Added to the kernel's diagonal: lets the plate miss an attractor a little, and coincident
/// attractors share their place.
const SMOOTHING: f64 = 1e-3;
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

/// Four centres with their weights: the kernel is evaluated four at a time. The last ones are
/// filled up with weights of zero.
#[derive(Clone, Copy, Debug)]
struct Centres {
    x: f64x4,
    y: f64x4,
    z: f64x4,
    weight: f64x4,
}

impl ThinPlate {
    /// The plate through the given displacements, at least one.
    pub fn fit(projections: &[Projection]) -> Self {
        let count = projections.len();
        let sum: Vector = projections.iter().map(|projection| projection.foot.point).sum();
        let origin = Point::from(sum / count.max(1) as f64);
        let centres: Vec<Vector> =
            projections.iter().map(|projection| scaled(&origin, &projection.foot.point.into())).collect();
        let basis = |row: usize, power: usize| if power == 0 { 1.0 } else { centres[row][power - 1] };
        let system = Mat::from_fn(count + 4, count + 4, |row, column| match (row < count, column < count) {
            (true, true) if row == column => SMOOTHING,
            (true, true) => kernel((centres[row] - centres[column]).norm_squared()),
            (true, false) => basis(row, column - count),
            (false, true) => basis(column, row - count),
            (false, false) if row == column => POLYNOMIAL_RIDGE,
            (false, false) => 0.0,
        });
        let displacement = |row: usize| projections.get(row).map_or(0.0, |p| p.height_m);
        let factor = system.partial_piv_lu();
        let solution = factor.solve(Col::from_fn(count + 4, displacement));
        let weights: Vec<f64> = (0..count).map(|row| solution[row]).collect();
        // The smoothing term is exactly what separates the plate from its data.
        let mean_square = weights.iter().map(|w| (SMOOTHING * w).powi(2)).sum::<f64>() / count.max(1) as f64;
        let linear = std::array::from_fn(|power| solution[count + power]);
        let lanes = |from: usize, value: &dyn Fn(usize) -> f64| {
            f64x4::from(std::array::from_fn(
                |lane| if from + lane < count { value(from + lane) } else { 0.0 },
            ))
        };
        let centres = (0..count)
            .step_by(4)
            .map(|from| Centres {
                x: lanes(from, &|row| centres[row].x),
                y: lanes(from, &|row| centres[row].y),
                z: lanes(from, &|row| centres[row].z),
                weight: lanes(from, &|row| weights[row]),
            })
            .collect();
        Self { origin, centres, linear, residual_m: mean_square.sqrt() }
    }

    /// The displacement at a point, in metres.
    pub fn displacement_m(&self, point: &Point) -> f64 {
        let x = scaled(&self.origin, point);
        let mut bending = f64x4::ZERO;
        for centres in &self.centres {
            let (dx, dy, dz) = (centres.x - x.x, centres.y - x.y, centres.z - x.z);
            // A square of nearly zero keeps the logarithm finite, and gives zero all the same.
            let square = (dx * dx + dy * dy + dz * dz).max(f64x4::splat(1e-300));
            bending += centres.weight * square * square.ln();
        }
        let flat = self.linear[0] + self.linear[1] * x.x + self.linear[2] * x.y + self.linear[3] * x.z;
        0.5 * bending.reduce_add() + flat
    }

    /// The displacements at some points, in metres.
    pub fn heights_m(&self, points: &[Point]) -> Vec<f64> {
        points.iter().map(|point| self.displacement_m(point)).collect()
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
fn kernel(square: f64) -> f64 {
    if square > 0.0 { 0.5 * square * square.ln() } else { 0.0 }
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
