//! The compound template: a union of at most three superquadrics, seen from a point inside.
//!
//! A neck on a body, or a cap on a bottle, is a second part. The union is meshed along rays from
//! its hub, so that it keeps the icosphere's faces whatever the number of its parts; what the hub
//! cannot see is bridged over.

use nalgebra::Matrix3;

use super::superquadric::Superquadric;
use crate::geometry::{Icosphere, Point, TriangleMesh, Vector};
use crate::symmetry::Symmetry;

/// Parts run into each other over this share of the body's least semi-axis: few real things have
/// an edge where a neck begins.
const FILLET: f64 = 0.15;

/// What lies deeper in the union than this is not its surface, in metres.
const VISIBLE_M: f64 = 1e-6;

/// A union of superquadrics.
#[derive(Clone, Debug, PartialEq)]
pub struct Compound {
    /// The largest part, whose axes are those of the template.
    pub body: Superquadric,
    /// What else belongs to it.
    pub limbs: Vec<Superquadric>,
    /// Whether parts run into each other in a fillet; otherwise in an edge.
    pub fillets: bool,
}

impl Compound {
    /// The body and then the limbs.
    pub fn parts(&self) -> impl Iterator<Item = &Superquadric> {
        std::iter::once(&self.body).chain(&self.limbs)
    }

    /// The signed distance to first order, that of the nearest part, in metres.
    pub fn distance_m(&self, point: &Point) -> f64 {
        self.parts().map(|part| part.distance_m(point)).fold(f64::INFINITY, f64::min)
    }

    /// How far it is from having a symmetry about the axes of its body: the mean distance from the
    /// surface of what the symmetry should leave on it, in metres, under the worst of its motions.
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
        match (self.limbs.len(), self.body.exponents) {
            (0, [e1, e2]) if e1 < 0.5 && e2 < 0.5 => "box",
            (0, [e1, _]) if e1 < 0.5 => "cylinder",
            (0, [_, e2]) if e2 < 0.5 => "prism",
            (0, _) => "ellipsoid",
            (1, _) => "compound of 2",
            _ => "compound of 3",
        }
    }

    /// The icosphere mapped onto the union, along rays from the hub.
    pub fn mesh(&self, sphere: &Icosphere) -> TriangleMesh {
        if self.limbs.is_empty() {
            return self.body.mesh(sphere);
        }
        let hub = self.hub();
        let reach = self.reach(&hub);
        sphere.mesh_of(|direction| {
            let ray = self.body.base_from_template * direction.component_mul(&reach);
            hub + ray * self.exit(&hub, &ray)
        })
    }

    /// Where a ray from the hub leaves the union, in lengths of the ray. Where it leaves two parts
    /// at nearly the same place, it leaves their fillet a little farther out.
    fn exit(&self, hub: &Point, ray: &Vector) -> f64 {
        let width = if self.fillets { FILLET * self.body.semi_axes.min() / ray.norm() } else { 0.0 };
        let (mut last, mut one_before) = (0.0, f64::NEG_INFINITY);
        for part in self.parts() {
            match part.exit(hub, ray, f64::max(last - width, 0.0)) {
                Some(exit) if exit > last => (last, one_before) = (exit, last),
                Some(exit) => one_before = one_before.max(exit),
                None => (),
            }
        }
        let overlap = (width - (last - one_before)).max(0.0);
        if overlap > 0.0 { last + overlap * overlap / (4.0 * width) } else { last }
    }

    /// The point inside the body, on the way to a limb, that lies deepest in the union's parts.
    fn hub(&self) -> Point {
        let mut best = (f64::NEG_INFINITY, self.body.centre);
        for limb in &self.limbs {
            for step in 0..=20 {
                let at = self.body.centre + (limb.centre - self.body.centre) * (f64::from(step) / 20.0);
                let in_body = 1.0 - self.body.gauge(&at);
                let in_all = self.parts().map(|part| 1.0 - part.gauge(&at)).fold(f64::INFINITY, f64::min);
                // Where no point is in all parts, one in the body and near the others has to do.
                let depth = if in_all > 0.0 { 1.0 + in_all } else { in_body.min(0.3) + 0.01 * in_all };
                if in_body > 0.05 && depth > best.0 {
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
        Compound { body: part(0.0, 0.035, 0.09), limbs: vec![part(0.1, 0.013, 0.05)], fillets: false }
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
    fn a_fillet_fills_the_corner_and_nothing_else() {
        let sphere = Icosphere::get(4);
        let sharp = bottle().mesh(sphere);
        let round = Compound { fillets: true, ..bottle() };
        let mut filled = 0;
        for (before, after) in sharp.vertices.iter().zip(round.mesh(sphere).vertices) {
            let outwards_m = bottle().distance_m(&after);
            assert!((-1e-4..0.0035).contains(&outwards_m), "{outwards_m}");
            if outwards_m > 1e-4 {
                // The corner is where the neck of 13 mm comes out of the top at 90 mm.
                let radius_m = (before.x - 0.1).hypot(before.y - 0.2);
                assert!(radius_m < 0.03 && (0.07..0.11).contains(&before.z), "{before}");
                filled += 1;
            }
        }
        assert!(filled > 10);
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
        let square = Compound { body, limbs: Vec::new(), fillets: false };
        assert!(asymmetry_m(&square, Symmetry::Revolution(2)) > 2.0);
        assert!(asymmetry_m(&square, Symmetry::Mirror([true; 3])) < 0.1);
    }

    #[test]
    fn a_template_without_limbs_is_its_body() {
        let alone = Compound { limbs: Vec::new(), ..bottle() };
        assert_eq!(alone.mesh(Icosphere::get(2)), alone.body.mesh(Icosphere::get(2)));
        assert_eq!((alone.family(), bottle().family()), ("cylinder", "compound of 2"));
    }
}
