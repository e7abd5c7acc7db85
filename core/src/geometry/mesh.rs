//! An indexed triangle mesh with outward (counter-clockwise) winding.

use super::{Direction, Plane, Point, Vector};

/// Vertices in metres and faces as triples of vertex indices, wound so that normals point outwards.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions, in metres.
    pub vertices: Vec<Point>,
    /// Three vertex indices a face, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// The foot of its lowest vertex over a plane, and that vertex's height, in metres.
    pub(crate) fn lowest_over(&self, plane: &Plane) -> Option<(Point, f64)> {
        let height_m = |vertex: &Point| plane.height_m(vertex);
        let lowest = self.vertices.iter().min_by(|a, b| height_m(a).total_cmp(&height_m(b)))?;
        Some((plane.foot(lowest), height_m(lowest)))
    }

    /// The same mesh with what lies behind a plane moved onto it.
    pub(crate) fn above(self, plane: &Plane) -> Self {
        let above = |vertex: Point| if plane.height_m(&vertex) < 0.0 { plane.foot(&vertex) } else { vertex };
        Self { vertices: self.vertices.into_iter().map(above).collect(), faces: self.faces }
    }

    /// The three corners of face `face`.
    pub fn corners(&self, face: usize) -> [Point; 3] {
        self.faces[face].map(|vertex| self.vertices[vertex as usize])
    }

    /// The normal of face `face` with a length of twice its area, in square metres.
    pub fn area_normal(&self, face: usize) -> Vector {
        let [a, b, c] = self.corners(face);
        (b - a).cross(&(c - a))
    }

    /// The outward unit normal of face `face`; a face without area gets the x axis.
    pub fn face_normal(&self, face: usize) -> Direction {
        Direction::try_new(self.area_normal(face), 0.0).unwrap_or_else(Vector::x_axis)
    }

    /// Unit normals at the vertices, weighted by the areas of the faces around each.
    pub fn vertex_normals(&self) -> Vec<Direction> {
        let mut sums = vec![Vector::zeros(); self.vertices.len()];
        for (face, corners) in self.faces.iter().enumerate() {
            let normal = self.area_normal(face);
            for &vertex in corners {
                sums[vertex as usize] += normal;
            }
        }
        sums.into_iter().map(|sum| Direction::try_new(sum, 0.0).unwrap_or_else(Vector::x_axis)).collect()
    }

    /// The share of each vertex in the area of the faces around it, in square metres.
    pub fn vertex_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.vertices.len()];
        for (face, corners) in self.faces.iter().enumerate() {
            let share = self.area_normal(face).norm() / 6.0;
            for &vertex in corners {
                areas[vertex as usize] += share;
            }
        }
        areas
    }

    /// The area of the surface, in square metres.
    pub fn area(&self) -> f64 {
        (0..self.faces.len()).map(|face| 0.5 * self.area_normal(face).norm()).sum()
    }

    /// The enclosed volume, in cubic metres; positive for outward winding.
    pub fn volume(&self) -> f64 {
        (0..self.faces.len())
            .map(|face| {
                let [a, b, c] = self.corners(face);
                a.coords.dot(&b.coords.cross(&c.coords)) / 6.0
            })
            .sum()
    }

    /// The mean of the vertices.
    pub fn centroid(&self) -> Point {
        let sum: Vector = self.vertices.iter().map(|vertex| vertex.coords).sum();
        Point::from(sum / self.vertices.len().max(1) as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Icosphere;

    #[test]
    fn a_fine_icosphere_has_the_area_and_volume_of_the_sphere() {
        let mesh = Icosphere::get(5).mesh_of(|direction| Point::from(2.0 * direction.into_inner()));
        let pi = std::f64::consts::PI;
        assert!((mesh.area() / (16.0 * pi) - 1.0).abs() < 2e-3);
        assert!((mesh.volume() / (32.0 / 3.0 * pi) - 1.0).abs() < 3e-3);
    }

    #[test]
    fn vertex_normals_of_a_sphere_point_away_from_its_centre() {
        let mesh = Icosphere::get(4).mesh_of(|direction| Point::from(direction.into_inner()));
        for (normal, vertex) in mesh.vertex_normals().iter().zip(&mesh.vertices) {
            assert!(normal.dot(&vertex.coords) > 0.9999);
        }
    }
}
