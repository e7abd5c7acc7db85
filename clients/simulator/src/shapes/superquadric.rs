//! Superquadrics: from ellipsoids to rounded boxes and cylinders, by two exponents.

use nalgebra::{Quaternion, UnitQuaternion};
use palpate_core::geometry::{Direction, Icosphere, Point, TriangleMesh, Vector};
use rand::RngExt;

use crate::random::{Stream, generator, standard_normal};

const SUBDIVISIONS: usize = 5;

/// A ball of 128 mm, the size of a mini football.
pub(super) fn ball() -> TriangleMesh {
    Icosphere::get(SUBDIVISIONS).mesh_of(|direction| Point::from(0.064 * direction.into_inner()))
}

/// Semi-axes of 20 to 75 mm, exponents from boxy (0.2) to slightly pinched (1.2), any orientation.
pub(super) fn random(seed: u64) -> TriangleMesh {
    let mut rng = generator(seed, Stream::Shape);
    let semi_axes = Vector::from_fn(|_, _| rng.random_range(0.020..0.075));
    let exponents = [rng.random_range(0.2..1.2), rng.random_range(0.2..1.2)];
    let orientation = UnitQuaternion::new_normalize(Quaternion::from(nalgebra::Vector4::from_fn(|_, _| {
        standard_normal(&mut rng)
    })));
    Icosphere::get(SUBDIVISIONS).mesh_of(|direction| {
        let on_unit = direction.into_inner() / gauge(direction, exponents);
        Point::from(orientation * on_unit.component_mul(&semi_axes))
    })
}

/// The factor by which a direction lies beyond the unit superquadric.
fn gauge(direction: &Direction, [e1, e2]: [f64; 2]) -> f64 {
    let [x, y, z] = [direction.x, direction.y, direction.z].map(f64::abs);
    let around = x.powf(2.0 / e2) + y.powf(2.0 / e2);
    (around.powf(e2 / e1) + z.powf(2.0 / e1)).powf(e1 / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_of_one_give_the_sphere_and_small_ones_the_box() {
        let diagonal = Direction::new_normalize(Vector::repeat(1.0));
        assert!((gauge(&diagonal, [1.0, 1.0]) - 1.0).abs() < 1e-12);
        // The corner of a box lies where every coordinate is one.
        assert!((gauge(&diagonal, [0.01, 0.01]) - 1.0 / 3_f64.sqrt()).abs() < 0.01);
    }

    #[test]
    fn seeds_give_different_objects_and_the_same_seed_the_same() {
        assert_eq!(random(1), random(1));
        assert_ne!(random(1).volume(), random(2).volume());
    }
}
