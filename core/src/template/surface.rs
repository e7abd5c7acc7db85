//! The template as a surface: its mesh, its normals, and a tree for closest points.

use crate::geometry::{Direction, FaceTree, Point, SurfacePoint, TriangleMesh};

/// A measured point seen from the template: `x = p + d n`, Eq. (2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// The point of the template's mesh closest to the measured one, and the normal of its face.
    pub foot: SurfacePoint,
    /// The measured point's height over it along that normal, in metres.
    pub height_m: f64,
}

/// A template's mesh, prepared for what the local stage asks of it.
#[derive(Debug)]
pub struct TemplateSurface {
    mesh: TriangleMesh,
    normals: Vec<Direction>,
    tree: FaceTree,
}

impl TemplateSurface {
    /// Prepares a mesh that has faces, such as an icosphere's.
    ///
    /// # Panics
    /// If the mesh has no face.
    pub fn new(mesh: TriangleMesh) -> Self {
        let tree = FaceTree::new(&mesh).expect("a template's mesh has faces");
        Self { normals: mesh.vertex_normals(), tree, mesh }
    }

    /// The mesh, in metres.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// Its vertices with their normals.
    pub fn vertices(&self) -> Vec<SurfacePoint> {
        self.mesh.vertices.iter().zip(&self.normals).map(|(p, n)| SurfacePoint::new(p, n)).collect()
    }

    /// A measured point seen from the template, Eq. (2).
    pub fn project(&self, point: &Point) -> Projection {
        let closest = self.tree.closest(&self.mesh, point);
        let normal = self.mesh.face_normal(closest.face);
        let height_m = (point - closest.point).dot(&normal); // Eq. (2)
        Projection { foot: SurfacePoint::new(&closest.point, &normal), height_m }
    }

    /// The mesh with each vertex moved along its normal by a height in metres: `v + F(v) n`.
    pub fn raised(&self, heights_m: &[f64]) -> TriangleMesh {
        let raise = |((vertex, normal), height_m): ((&Point, &Direction), &f64)| {
            vertex + normal.into_inner() * *height_m
        };
        let vertices = self.mesh.vertices.iter().zip(&self.normals).zip(heights_m).map(raise).collect();
        TriangleMesh { vertices, faces: self.mesh.faces.clone() }
    }
}
