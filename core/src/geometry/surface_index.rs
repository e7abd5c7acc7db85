//! Exact closest points and first hits on a mesh: the only file that knows the collision library.
//!
//! A query that is not finite would be answered silently with face 0; finiteness is a guarantee of
//! the types that hold evidence, and is asserted here in debug builds.

use parry3d_f64::math::Vector as ParryVector;
use parry3d_f64::query::{PointQuery, PointQueryWithLocation, Ray, RayCast};
use parry3d_f64::shape::{TriMesh, TriMeshFlags};

use super::{Direction, Point, TriangleMesh, Vector};

/// The point of a surface nearest to a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// Where on the surface, in metres.
    pub point: Point,
    /// On which face.
    pub face: usize,
    /// How far from the query, in metres; never negative.
    pub distance_m: f64,
}

/// Where a ray first meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Where on the surface, in metres.
    pub point: Point,
    /// Distance from the ray's origin, in metres.
    pub distance_m: f64,
    /// On which face.
    pub face: usize,
}

/// A bounding volume hierarchy over the triangles of a mesh.
#[derive(Clone)]
pub struct SurfaceIndex {
    mesh: TriMesh,
}

impl std::fmt::Debug for SurfaceIndex {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("SurfaceIndex").field("faces", &self.mesh.num_triangles()).finish()
    }
}

impl SurfaceIndex {
    /// Indexes a mesh for closest points and rays; `None` for a mesh without faces.
    pub fn new(mesh: &TriangleMesh) -> Option<Self> {
        Self::with_flags(mesh, TriMeshFlags::empty())
    }

    /// Indexes a closed mesh so that [`Self::contains`] can be asked as well.
    pub fn of_solid(mesh: &TriangleMesh) -> Option<Self> {
        Self::with_flags(mesh, TriMeshFlags::ORIENTED)
    }

    fn with_flags(mesh: &TriangleMesh, flags: TriMeshFlags) -> Option<Self> {
        let vertices = mesh.vertices.iter().map(to_parry).collect();
        TriMesh::with_flags(vertices, mesh.faces.clone(), flags).ok().map(|mesh| Self { mesh })
    }

    /// Moves the vertices of an indexed mesh and keeps its faces: cheaper than a new index.
    ///
    /// # Panics
    /// If the number of vertices differs.
    pub fn move_vertices(&mut self, vertices: &[Point]) {
        let vertices: Vec<_> = vertices.iter().map(to_parry).collect();
        self.mesh.set_vertices(&vertices);
    }

    /// The point of the surface nearest to `query`.
    pub fn closest(&self, query: &Point) -> ClosestPoint {
        debug_assert!(query.coords.iter().all(|x| x.is_finite()));
        let (projection, (face, _)) = self.mesh.project_local_point_and_get_location(to_parry(query), false);
        let point = from_parry(projection.point);
        ClosestPoint { point, face: face as usize, distance_m: (query - point).norm() }
    }

    /// The first face that a ray meets within `reach_m`, from whichever side.
    pub fn first_hit(&self, origin: &Point, direction: &Direction, reach_m: f64) -> Option<RayHit> {
        let ray = Ray::new(to_parry(origin), to_parry(&Point::from(direction.into_inner())));
        let hit = self.mesh.cast_local_ray_and_get_normal(&ray, reach_m, false)?;
        Some(RayHit {
            point: origin + direction.into_inner() * hit.time_of_impact,
            distance_m: hit.time_of_impact,
            face: hit.subshape as usize,
        })
    }

    /// Whether `query` lies inside; meaningful for an index made by [`Self::of_solid`].
    pub fn contains(&self, query: &Point) -> bool {
        self.mesh.contains_local_point(to_parry(query))
    }
}

fn to_parry(point: &Point) -> ParryVector {
    ParryVector::new(point.x, point.y, point.z)
}

fn from_parry(vector: ParryVector) -> Point {
    Point::from(Vector::new(vector.x, vector.y, vector.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Icosphere;

    fn unit_sphere() -> TriangleMesh {
        Icosphere::get(4).mesh_of(|direction| Point::from(direction.into_inner()))
    }

    #[test]
    fn the_closest_point_on_a_sphere_lies_on_the_radius() {
        let index = SurfaceIndex::new(&unit_sphere()).unwrap();
        for query in [Point::new(2.0, 0.3, -0.4), Point::new(0.1, 0.2, 0.3)] {
            let closest = index.closest(&query);
            let expected = query.coords.normalize();
            assert!((closest.point.coords - expected).norm() < 0.02);
            assert!((closest.distance_m - (query.coords.norm() - 1.0).abs()).abs() < 5e-3);
        }
    }

    #[test]
    fn a_ray_meets_the_near_side_from_outside_and_the_far_side_from_inside() {
        let index = SurfaceIndex::new(&unit_sphere()).unwrap();
        let towards = -Vector::x_axis();
        let outside = index.first_hit(&Point::new(3.0, 0.0, 0.0), &towards, 10.0).unwrap();
        assert!((outside.point.x - 1.0).abs() < 5e-3);
        let inside = index.first_hit(&Point::origin(), &towards, 10.0).unwrap();
        assert!((inside.point.x + 1.0).abs() < 5e-3);
        for hit in [outside, inside] {
            let normal = unit_sphere().face_normal(hit.face);
            assert!(normal.dot(&hit.point.coords) > 0.99, "the face is the one that was hit");
        }
        assert!(index.first_hit(&Point::new(3.0, 0.0, 0.0), &towards, 1.0).is_none());
    }

    #[test]
    fn a_solid_contains_its_centre_and_not_the_outside() {
        let index = SurfaceIndex::of_solid(&unit_sphere()).unwrap();
        assert!(index.contains(&Point::new(0.2, 0.1, 0.0)));
        assert!(!index.contains(&Point::new(0.9, 0.9, 0.0)));
    }

    #[test]
    fn moved_vertices_answer_like_a_new_index() {
        let mesh = unit_sphere();
        let stretched = Icosphere::get(4).mesh_of(|d| Point::new(3.0 * d.x + 0.1, 0.5 * d.y, 2.0 * d.z));
        let mut moved = SurfaceIndex::new(&mesh).unwrap();
        moved.move_vertices(&stretched.vertices);
        let fresh = SurfaceIndex::new(&stretched).unwrap();
        let query = Point::new(2.0, 1.0, -1.5);
        assert!((moved.closest(&query).point - fresh.closest(&query).point).norm() < 1e-12);
    }
}
