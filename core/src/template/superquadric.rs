//! The superquadric: an ellipsoid whose sections may square up, from ball over cylinder to box.
//!
//! Its gauge is `G(y) = ((|y1|^(2/e2) + |y2|^(2/e2))^(e2/e1) + |y3|^(2/e1))^(e1/2)` with
//! `y = diag(1/a) Rᵀ (x - t)`: 1 on the surface and homogeneous of degree one.

use nalgebra::Rotation3;

use crate::geometry::{Icosphere, Point, TriangleMesh, Vector};

/// Exponents of an ellipsoid, of a cylinder about the third axis, of a box, of a round plate, and of a limb to
/// begin with: `e1` along the axis, `e2` across it.
pub(super) const ELLIPSOID: [f64; 2] = [1.0, 1.0];
pub(super) const CYLINDER: [f64; 2] = [0.2, 1.0];
pub(super) const BOX: [f64; 2] = [0.2, 0.2];
pub(super) const SLAB: [f64; 2] = [0.2, 0.6];
pub(super) const LIMB: [f64; 2] = [0.5, 1.0];
/// Added to the size of every coordinate: keeps the logarithms finite on the planes of symmetry.
const GUARD: f64 = 1e-6;
const LEAST_SUM: f64 = 1e-300;

/// A superquadric in the session's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Superquadric {
    /// Its centre, in metres.
    pub centre: Point,
    /// Its semi-axes, in metres.
    pub semi_axes: Vector,
    /// The directions of its axes, as columns.
    pub base_from_template: Rotation3<f64>,
    /// `e1` squares the profile along the third axis, `e2` the section across it; both 1 for an
    /// ellipsoid, towards 0 for edges.
    pub exponents: [f64; 2],
}

/// The gauge at scaled coordinates, with its derivatives by them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gauge {
    pub(super) value: f64,
    pub(super) by_y: Vector,
}

impl Gauge {
    pub(super) fn at(y: &Vector, exponents: [f64; 2]) -> Self {
        let [value, by_x, by_y, by_z, _, _] = gauge([y.x, y.y, y.z], exponents, f64::exp, f64::ln);
        Self { value, by_y: Vector::new(by_x, by_y, by_z) }
    }
}

/// The gauge at scaled coordinates, then its derivatives by them and by the exponents; with the exponential and
/// the logarithm that suit the caller.
#[inline(always)]
pub(super) fn gauge(
    y: [f64; 3],
    [e1, e2]: [f64; 2],
    exp: impl Fn(f64) -> f64,
    ln: impl Fn(f64) -> f64,
) -> [f64; 6] {
    let size = [y[0].abs() + GUARD, y[1].abs() + GUARD, y[2].abs() + GUARD];
    let log = [ln(size[0]), ln(size[1]), ln(size[2])];
    let (first, second) = (exp(2.0 / e2 * log[0]), exp(2.0 / e2 * log[1]));
    let ring = (first + second).max(LEAST_SUM);
    let ring_log = ln(ring);
    let disc = exp(e2 / e1 * ring_log);
    let axial = exp(2.0 / e1 * log[2]);
    let sum = (disc + axial).max(LEAST_SUM);
    let sum_log = ln(sum);
    let value = exp(0.5 * e1 * sum_log);
    let (per_ring, per_sum) = (disc / ring, value / sum);
    let ring_by_e2 = -2.0 / (e2 * e2) * (first * log[0] + second * log[1]);
    let sum_by_e1 = -(e2 * disc * ring_log + 2.0 * axial * log[2]) / (e1 * e1);
    let sum_by_e2 = (disc * ring_log + e2 * ring_by_e2 * per_ring) / e1;
    [
        value,
        (per_sum * per_ring * first / size[0]).copysign(y[0]),
        (per_sum * per_ring * second / size[1]).copysign(y[1]),
        (per_sum * axial / size[2]).copysign(y[2]),
        0.5 * (value * sum_log + e1 * per_sum * sum_by_e1),
        0.5 * e1 * per_sum * sum_by_e2,
    ]
}

impl Superquadric {
    /// A vector in units of the semi-axes, along them.
    fn unit_from_base(&self, vector: &Vector) -> Vector {
        self.base_from_template.inverse_transform_vector(vector).component_div(&self.semi_axes)
    }

    /// The gauge: 1 on the surface, less inside, more outside.
    pub fn gauge(&self, point: &Point) -> f64 {
        Gauge::at(&self.unit_from_base(&(point - self.centre)), self.exponents).value
    }

    /// The signed distance to first order (Taubin), `(G - 1) / |grad G|`, in metres.
    pub fn distance_m(&self, point: &Point) -> f64 {
        let gauge = Gauge::at(&self.unit_from_base(&(point - self.centre)), self.exponents);
        (gauge.value - 1.0) / gauge.by_y.component_div(&self.semi_axes).norm()
    }

    /// The geometric mean of its semi-axes, in metres.
    pub fn size_m(&self) -> f64 {
        self.semi_axes.product().cbrt()
    }

    /// The point of the surface in a direction of its own scaled frame, from the centre.
    pub(super) fn offset_towards(&self, direction: &Vector) -> Vector {
        let radius = Gauge::at(direction, self.exponents).value.recip();
        self.base_from_template * direction.component_mul(&self.semi_axes) * radius
    }

    /// The icosphere mapped onto the surface: `R diag(a) S / G(S) + t`.
    pub fn mesh(&self, sphere: &Icosphere) -> TriangleMesh {
        sphere.mesh_of(|direction| self.centre + self.offset_towards(direction))
    }

    /// Where a ray leaves the body, in lengths of the ray; `None` where it does not enter it, or
    /// leaves it no farther out than `beyond`.
    pub(super) fn exit(&self, from: &Point, ray: &Vector, beyond: f64) -> Option<f64> {
        let (from, along) = (self.unit_from_base(&(from - self.centre)), self.unit_from_base(ray));
        // The body lies within the unit cube of its scaled frame. The gauge is convex along the
        // ray: from where the ray leaves the cube, Newton's steps come down to the exit and never
        // pass it.
        let at_side =
            |side: f64, axis: usize| (side * 1.0_f64.copysign(along[axis]) - from[axis]) / along[axis];
        // Minima and maxima of floats pass over the 0/0 of a ray within a face of the cube.
        let mut s = (0..3).map(|axis| at_side(1.0, axis)).fold(f64::INFINITY, f64::min);
        if (0..3).map(|axis| at_side(-1.0, axis)).fold(f64::NEG_INFINITY, f64::max) > s {
            return None;
        }
        for _ in 0..30 {
            if s <= beyond {
                return None;
            }
            let gauge = Gauge::at(&(from + along * s), self.exponents);
            if gauge.value <= 1.0 + 1e-6 {
                return Some(s);
            }
            let slope = gauge.by_y.dot(&along);
            if slope <= 0.0 {
                return None;
            }
            s -= (gauge.value - 1.0) / slope;
        }
        Some(s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    fn numbers(value: &Value) -> Vec<f64> {
        value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    }

    fn box_like() -> Superquadric {
        Superquadric {
            centre: Point::new(0.3, -0.1, 0.2),
            semi_axes: Vector::new(0.02, 0.05, 0.08),
            base_from_template: Rotation3::from_euler_angles(0.4, -0.8, 1.3),
            exponents: [0.2, 0.3],
        }
    }

    #[test]
    fn distances_and_their_slopes_agree_with_the_reference_vectors() {
        let file: Value = serde_json::from_str(include_str!("../../tests/data/residuals.json")).unwrap();
        let q = numbers(&file["q"]);
        let matrix: Vec<f64> = file["R"].as_array().unwrap().iter().flat_map(numbers).collect();
        let shape = Superquadric {
            centre: Point::new(q[0], q[1], q[2]),
            semi_axes: Vector::new(q[3].exp(), q[4].exp(), q[5].exp()),
            base_from_template: Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_row_slice(&matrix)),
            exponents: [q[9], q[10]],
        };
        let rows =
            |key: &str| -> Vec<Vec<f64>> { file[key].as_array().unwrap().iter().map(numbers).collect() };
        let round = Superquadric { exponents: [1.0, 1.0], ..shape };
        for (point, distance) in rows("X").iter().zip(numbers(&file["ellipsoid_taubin"])) {
            assert!((round.distance_m(&Point::from_slice(point)) - distance).abs() < 1e-9);
        }
        let expected = numbers(&file["sq_taubin"]);
        for ((point, distance), slope) in rows("X").iter().zip(expected).zip(rows("sq_grad_unit")) {
            let point = Point::from_slice(point);
            assert!((shape.distance_m(&point) - distance).abs() < 1e-9);
            let y = shape.unit_from_base(&(point - shape.centre));
            let by_y = Gauge::at(&y, shape.exponents).by_y;
            let found = (shape.base_from_template * by_y.component_div(&shape.semi_axes)).normalize();
            assert!((found - Vector::from_row_slice(&slope)).norm() < 1e-9);
        }
    }

    #[test]
    fn every_vertex_of_the_mesh_lies_on_the_surface() {
        for vertex in box_like().mesh(Icosphere::get(3)).vertices {
            assert!((box_like().gauge(&vertex) - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn a_ray_leaves_the_body_on_its_surface_and_may_pass_it_by() {
        let shape = box_like();
        let from = shape.centre + Vector::new(0.004, 0.006, -0.01);
        for direction in &Icosphere::get(2).directions {
            let exit = shape.exit(&from, direction, 0.0).unwrap();
            assert!((shape.gauge(&(from + direction.into_inner() * exit)) - 1.0).abs() < 1e-5);
            assert!(shape.exit(&from, direction, 0.99 * exit).is_some());
            assert_eq!(shape.exit(&from, direction, 1.01 * exit), None);
        }
        let aside = shape.centre + Vector::new(0.5, 0.0, 0.0);
        assert_eq!(shape.exit(&aside, &Vector::new(0.1, 1.0, 0.0), 0.0), None);
    }

    #[test]
    fn a_ray_within_a_face_of_the_box_around_a_body_has_no_exit_that_is_not_a_number() {
        let shape =
            Superquadric { centre: Point::origin(), base_from_template: Rotation3::identity(), ..box_like() };
        // A limb begins at the centre of its host: the hub may lie just there.
        let from = shape.centre + Vector::new(0.0, 0.0, shape.semi_axes.z);
        for ray in [Vector::x(), Vector::new(0.3, -0.7, 0.0), -Vector::x(), -Vector::z()] {
            assert!(shape.exit(&from, &ray, 0.0).is_none_or(f64::is_finite), "{ray}");
        }
    }

    #[test]
    fn derivatives_of_the_gauge_are_those_of_differences() {
        let (y, e) = ([0.7, -0.5, 0.9], [0.4, 0.8]);
        let at = |y: [f64; 3], e: [f64; 2]| gauge(y, e, f64::exp, f64::ln);
        let here = at(y, e);
        let step = 1e-6;
        for k in 0..5 {
            let (mut other, mut exponents) = (y, e);
            if k < 3 {
                other[k] += step;
            } else {
                exponents[k - 3] += step;
            }
            let difference = (at(other, exponents)[0] - here[0]) / step;
            assert!((difference - here[1 + k]).abs() < 1e-5);
        }
    }
}
