//! The process at the vertices of an estimate: what a touch at one of them says about the others.

use faer::Mat;

use super::process::Displacement;
use crate::geometry::SurfacePoint;
use crate::symmetry::SymmetryFrame;

/// The process at the vertices of an estimate.
#[derive(Clone, Debug)]
pub struct VertexProcess {
    process: Displacement,
    points: Vec<SurfacePoint>,
    deviations_m: Vec<f64>,
}

impl VertexProcess {
    /// The process with, for each vertex, the point of the template that it was displaced from and
    /// the process's deviation there, in metres.
    pub fn new(process: Displacement, points: Vec<SurfacePoint>, deviations_m: Vec<f64>) -> Self {
        Self { process, points, deviations_m }
    }

    /// What its matrices take in memory, in bytes.
    pub(crate) fn bytes(&self) -> usize {
        self.process.bytes()
    }

    /// The symmetry that the process assumes.
    pub fn symmetry(&self) -> &SymmetryFrame {
        &self.process.prior().frame
    }

    /// Correlations that are left between some vertices (rows) and others (columns), in [-1, 1].
    pub fn correlation(&self, rows: &[u32], columns: &[u32]) -> Mat<f32> {
        let points = |vertices: &[u32]| -> Vec<SurfacePoint> {
            vertices.iter().map(|&vertex| self.points[vertex as usize]).collect()
        };
        let mut correlation = self.process.covariance(&points(rows), &points(columns));
        let deviation_m = |vertex: u32| self.deviations_m[vertex as usize];
        for (row, &from) in rows.iter().enumerate() {
            for (column, &to) in columns.iter().enumerate() {
                // Where nothing is left to learn nothing is said about others.
                let scale = (deviation_m(from) * deviation_m(to)).max(self.process.prior().jitter()) as f32;
                correlation[(row, column)] = (correlation[(row, column)] / scale).clamp(-1.0, 1.0);
            }
        }
        correlation
    }
}
