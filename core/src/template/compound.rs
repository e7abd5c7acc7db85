//! The compound template: a union of at most three superquadrics, seen from a point inside.
//!
//! A neck on a body, or a cap on a bottle, is a second part. The union is meshed along rays from
//! its hub, so that it keeps the icosphere's faces whatever the number of its parts; what the hub
//! cannot see is bridged over.

use nalgebra::Matrix3;

use super::superquadric::Superquadric;
use crate::geometry::{Icosphere, Point, TriangleMesh, Vector};
use crate::symmetry::Symmetry;

/// Points that are tried as the hub between the body and another part.
const HUB_STEPS: u32 = 20;
/// The hub lies at least this deep in the body, by its gauge.
const HUB_DEPTH: f64 = 0.05;
/// Where no point is in all parts: a depth in the body beyond this counts no further,
const ENOUGH_DEPTH: f64 = 0.3;
/// and nearness to the other parts decides, with this weight.
const NEARNESS: f64 = 0.01;
/// Exponents below this look square.
const SQUARE_BELOW: f64 = 0.5;
/// What lies deeper in the union than this is not its surface, in metres.
const VISIBLE_M: f64 = 1e-6;

/// A union of superquadrics.
#[derive(Clone, Debug, PartialEq)]
pub struct Compound {
    /// The first part, whose axes are those of the template.
    pub body: Superquadric,
    /// The other parts, limbs among them.
    pub others: Vec<Superquadric>,
}

impl Compound {
    /// The body, then the others.
    pub fn parts(&self) -> impl Iterator<Item = &Superquadric> {
        std::iter::once(&self.body).chain(&self.others)
    }

    /// The signed distance to first order, that of the nearest part, in metres.
    pub fn distance_m(&self, point: &Point) -> f64 {
        self.parts().map(|part| part.distance_m(point)).fold(f64::INFINITY, f64::min)
    }

    /// How far it is from having a symmetry about the axes of its body: the mean distance from the
    /// surface of points that the symmetry should leave on it, in metres, under its worst motion.
    pub(crate) fn asymmetry_m(&self, symmetry: Symmetry) -> f64 {
        let directions = &Icosphere::get(1).directions;
        let points =
            self.parts().flat_map(|part| directions.iter().map(|d| part.centre + part.offset_towards(d)));
        let visible: Vec<Point> = points.filter(|point| self.distance_m(point) > -VISIBLE_M).collect();
        let (centre, axes) = (self.body.centre, self.body.base_from_template);
        let moved = |motion: &Matrix3<f64>, point: &Point| {
            centre + axes * (motion * axes.inverse_transform_vector(&(point - centre)))
        };
        let of = |motion: &Matrix3<f64>| {
            let distances = visible.iter().map(|point| self.distance_m(&moved(motion, point)).abs());
            distances.sum::<f64>() / visible.len() as f64
        };
        symmetry.motions().iter().map(of).fold(0.0, f64::max)
    }

    /// What it looks like, in a word.
    pub fn family(&self) -> &'static str {
        match (self.others.len(), self.body.exponents) {
            (0, [e1, e2]) if e1 < SQUARE_BELOW && e2 < SQUARE_BELOW => "box",
            (0, [e1, _]) if e1 < SQUARE_BELOW => "cylinder",
            (0, [_, e2]) if e2 < SQUARE_BELOW => "prism",
            (0, _) => "ellipsoid",
            (1, _) => "compound of 2",
            _ => "compound of 3",
        }
    }

    /// The icosphere mapped onto the union, along rays from the hub.
    pub fn mesh(&self, sphere: &Icosphere) -> TriangleMesh {
        if self.others.is_empty() {
            return self.body.mesh(sphere);
        }
        let hub = self.hub();
        let reach = self.reach(&hub);
        sphere.mesh_of(|direction| {
            let ray = self.body.base_from_template * direction.component_mul(&reach);
            hub + ray * self.exit(&hub, &ray)
        })
    }

    /// Where a ray from the hub leaves the union, in lengths of the ray.
    fn exit(&self, hub: &Point, ray: &Vector) -> f64 {
        self.parts().fold(0.0, |last, part| part.exit(hub, ray, last).unwrap_or(last))
    }

    /// The point inside the body, between its centre and that of another part, that lies deepest in the union's parts.
    fn hub(&self) -> Point {
        let mut best = (f64::NEG_INFINITY, self.body.centre);
        for other in &self.others {
            for step in 0..=HUB_STEPS {
                let at = self.body.centre
                    + (other.centre - self.body.centre) * (f64::from(step) / f64::from(HUB_STEPS));
                let in_body = 1.0 - self.body.gauge(&at);
                let in_all = self.parts().map(|part| 1.0 - part.gauge(&at)).fold(f64::INFINITY, f64::min);
                // Where no point is in all parts, one in the body and near the others has to do.
                let depth =
                    if in_all > 0.0 { 1.0 + in_all } else { in_body.min(ENOUGH_DEPTH) + NEARNESS * in_all };
                if in_body > HUB_DEPTH && depth > best.0 {
                    best = (depth, at);
                }
            }
        }
        best.1
    }

    /// How far the union reaches from the hub along each of the body's axes, in metres: rays are
    /// spread in proportion, so that a long object has its share of vertices.
    fn reach(&self, hub: &Point) -> Vector {
        let offsets = self.parts().flat_map(|part| {
            let directions = &Icosphere::get(2).directions;
            directions.iter().map(move |direction| part.centre - hub + part.offset_towards(direction))
        });
        offsets.fold(Vector::repeat(1e-6), |reach, offset| {
            reach.sup(&self.body.base_from_template.inverse_transform_vector(&offset).abs())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    /// A body with a neck, as on a bottle.
    fn bottle() -> Compound {
        let part = |z: f64, radius: f64, half_height: f64| Superquadric {
            centre: Point::new(0.1, 0.2, z),
            semi_axes: Vector::new(radius, radius, half_height),
            base_from_template: Rotation3::identity(),
            exponents: [0.2, 1.0],
        };
        Compound { body: part(0.0, 0.035, 0.09), others: vec![part(0.1, 0.013, 0.05)] }
    }

    #[test]
    fn the_mesh_of_a_union_lies_on_the_union() {
        let bottle = bottle();
        let mesh = bottle.mesh(Icosphere::get(4));
        for vertex in &mesh.vertices {
            assert!(bottle.distance_m(vertex).abs() < 1e-4, "{vertex}");
        }
        let highest = mesh.vertices.iter().map(|v| v.z).fold(0.0, f64::max);
        assert!((highest - 0.15).abs() < 1e-3, "{highest}");
        assert!(mesh.volume() > 0.0);
    }

    #[test]
    fn a_bottle_is_round_about_its_axis_and_not_alike_at_its_ends() {
        let asymmetry_m = |shape: &Compound, symmetry| 1e3 * shape.asymmetry_m(symmetry);
        let upright = bottle();
        assert!(asymmetry_m(&upright, Symmetry::Revolution(2)) < 0.1);
        assert!(asymmetry_m(&upright, Symmetry::Mirror([true, true, false])) < 0.1);
        assert!(asymmetry_m(&upright, Symmetry::Mirror([false, false, true])) > 5.0);
        assert!(asymmetry_m(&upright, Symmetry::Revolution(0)) > 5.0);
        // A square section turns onto itself, but not by half as much.
        let body = Superquadric { exponents: [0.2, 0.2], ..upright.body };
        let square = Compound { body, others: Vec::new() };
        assert!(asymmetry_m(&square, Symmetry::Revolution(2)) > 2.0);
        assert!(asymmetry_m(&square, Symmetry::Mirror([true; 3])) < 0.1);
    }

    #[test]
    fn a_template_without_other_parts_is_its_body() {
        let alone = Compound { others: Vec::new(), ..bottle() };
        assert_eq!(alone.mesh(Icosphere::get(2)), alone.body.mesh(Icosphere::get(2)));
        assert_eq!((alone.family(), bottle().family()), ("cylinder", "compound of 2"));
    }
}
