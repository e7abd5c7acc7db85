//! Points spread over a surface by area: what every metric, and the simulated camera, measures at.

use rand::{Rng, RngExt};

use crate::geometry::{Point, TriangleMesh};

/// A point of a surface and the face it lies on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Where, in metres.
    pub point: Point,
    /// On which face.
    pub face: usize,
}

/// Draws points of a surface with equal probability per area.
#[derive(Clone, Debug)]
pub struct SurfaceSampler<'a> {
    mesh: &'a TriangleMesh,
    /// Twice the area of the faces up to and including each, in square metres.
    cumulative: Vec<f64>,
}

impl<'a> SurfaceSampler<'a> {
    /// Prepares the areas; `None` for a mesh without area.
    pub fn new(mesh: &'a TriangleMesh) -> Option<Self> {
        let mut total = 0.0;
        let cumulative: Vec<f64> = (0..mesh.faces.len())
            .map(|face| {
                total += mesh.area_normal(face).norm();
                total
            })
            .collect();
        (total > 0.0 && total.is_finite()).then_some(Self { mesh, cumulative })
    }

    /// `n` independent points, uniform over the surface.
    pub fn independent(&self, n: usize, rng: &mut impl Rng) -> Vec<SurfacePoint> {
        (0..n)
            .map(|_| {
                let at = rng.random();
                self.point_at(at, rng)
            })
            .collect()
    }

    /// `n` points, one in each of `n` strips of equal area: the same mean with less spread.
    pub fn stratified(&self, n: usize, rng: &mut impl Rng) -> Vec<SurfacePoint> {
        (0..n)
            .map(|strip| {
                let at = (strip as f64 + rng.random::<f64>()) / n as f64;
                self.point_at(at, rng)
            })
            .collect()
    }

    /// A uniform point of the face at which the share `at` of the area is reached.
    fn point_at(&self, at: f64, rng: &mut impl Rng) -> SurfacePoint {
        let total = self.cumulative.last().copied().unwrap_or(0.0);
        let face = self.cumulative.partition_point(|&area| area <= at * total).min(self.cumulative.len() - 1);
        let [a, b, c] = self.mesh.corners(face);
        let (mut u, mut v) = (rng.random::<f64>(), rng.random::<f64>());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        SurfacePoint { point: a + (b - a) * u + (c - a) * v, face }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Two triangles of one plane: areas 1 and 3, the larger one above x = 10.
    fn unequal_pair() -> TriangleMesh {
        TriangleMesh {
            vertices: vec![
                Point::new(0.0, 0.0, 0.0),
                Point::new(2.0, 0.0, 0.0),
                Point::new(0.0, 1.0, 0.0),
                Point::new(10.0, 0.0, 0.0),
                Point::new(12.0, 0.0, 0.0),
                Point::new(10.0, 3.0, 0.0),
            ],
            faces: vec![[0, 1, 2], [3, 4, 5]],
        }
    }

    #[test]
    fn faces_are_drawn_by_their_area_and_evenly_within() {
        let mesh = unequal_pair();
        let sampler = SurfaceSampler::new(&mesh).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for points in [sampler.independent(20_000, &mut rng), sampler.stratified(20_000, &mut rng)] {
            let large: Vec<_> = points.iter().filter(|sample| sample.face == 1).collect();
            assert!((large.len() as f64 / 20_000.0 - 0.75).abs() < 0.01);
            let mean_y = large.iter().map(|sample| sample.point.y).sum::<f64>() / large.len() as f64;
            assert!((mean_y - 1.0).abs() < 0.02, "the centroid of the triangle is at y = 1, not {mean_y}");
        }
    }

    #[test]
    fn a_face_without_area_is_never_drawn() {
        let mut mesh = unequal_pair();
        mesh.faces.insert(0, [0, 0, 1]);
        let sampler = SurfaceSampler::new(&mesh).unwrap();
        let points = sampler.stratified(500, &mut ChaCha8Rng::seed_from_u64(2));
        assert!(points.iter().all(|sample| sample.face != 0));
        assert!(SurfaceSampler::new(&TriangleMesh::default()).is_none());
    }
}
