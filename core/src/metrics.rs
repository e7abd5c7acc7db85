//! How far a reconstruction is from the truth, computed from the triangles of both.
//!
//! The headline is [`Comparison::surface_distance_m`]: exact point-to-triangle distances, so that a
//! perfect reconstruction scores zero. The chamfer distance between samples is what the paper
//! prints (Table I); identical surfaces score `0.5 sqrt(A/n)` a direction under it, which
//! [`Reference::chamfer_floor`] measures, so a figure near its floor says nothing.

mod nearest;
mod reliability;
mod samples;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use self::nearest::NearestPoints;
pub use self::reliability::{
    DeviationBin, RiskBin, StatedError, StatedRisk, coverage, deviation_bins, normal_coverage, risk_bins,
};
pub use self::samples::{SurfacePoint, SurfaceSampler};
use crate::geometry::{Point, SurfaceIndex, TriangleMesh};

/// Within this distance of the other surface a point counts for the F-score, in metres.
pub const F_SCORE_DISTANCE_M: f64 = 0.001;
/// Within this distance of the reconstruction a true point counts as covered, in metres.
pub const COVERAGE_DISTANCE_M: f64 = 0.002;

/// How many samples each metric takes, and from which seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// Stratified points on each surface for the exact distances.
    pub surface_points: usize,
    /// Independent points on each surface for the chamfer distances.
    pub chamfer_points: usize,
    /// The seed of both.
    pub seed: u64,
}

impl Default for Sampling {
    /// 13,000 chamfer points is the strict end of what the paper's own figures allow.
    fn default() -> Self {
        Self { surface_points: 5_000, chamfer_points: 13_000, seed: 0 }
    }
}

/// Why two surfaces cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MetricsError {
    /// The true surface has no area.
    #[error("the true surface has no area: it needs at least one face that is not a line or a point")]
    EmptyTruth,
    /// The reconstruction has no area.
    #[error("the reconstruction has no area: it needs at least one face that is not a line or a point")]
    EmptyReconstruction,
    /// A vertex is NaN or infinite.
    #[error("a vertex of the mesh is not a finite number")]
    NotFinite,
    /// Standard deviations and vertices differ in number.
    #[error("{deviations} standard deviations were given for {vertices} vertices")]
    DeviationCount {
        /// Vertices of the reconstruction.
        vertices: usize,
        /// Standard deviations given.
        deviations: usize,
    },
}

/// The two directed distances between two surfaces and their spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Mean of the two directed mean point-to-surface distances, in metres.
    pub surface_distance_m: f64,
    /// The greatest point-to-surface distance found in either direction, in metres.
    pub hausdorff_m: f64,
    /// Harmonic mean of the shares of either surface within [`F_SCORE_DISTANCE_M`] of the other.
    pub f_score_1mm: f64,
    /// Share of the true surface within [`COVERAGE_DISTANCE_M`] of the reconstruction.
    pub coverage: f64,
    /// Reconstructed volume over true volume.
    pub volume_ratio: f64,
    /// Chamfer distances between samples.
    pub chamfer: Chamfer,
}

/// The chamfer distance between random samples of two surfaces, under its two conventions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chamfer {
    /// Sum of the two directed mean distances to the nearest sample, in metres.
    pub sum_m: f64,
    /// Half of the sum, in metres.
    pub mean_m: f64,
}

/// A true surface, prepared once and compared with many reconstructions.
#[derive(Debug)]
pub struct Reference {
    truth: TriangleMesh,
    index: SurfaceIndex,
    surface_points: Vec<Point>,
    chamfer_points: Vec<[f64; 3]>,
    chamfer_nearest: NearestPoints,
    sampling: Sampling,
}

/// One stream of random numbers for each set of samples.
#[derive(Clone, Copy)]
enum Stream {
    TruthSurface,
    TruthChamfer,
    ReconstructionSurface,
    ReconstructionChamfer,
}

impl Reference {
    /// Indexes and samples the true surface.
    ///
    /// # Errors
    /// [`MetricsError::EmptyTruth`] or [`MetricsError::NotFinite`].
    pub fn new(truth: TriangleMesh, sampling: Sampling) -> Result<Self, MetricsError> {
        require_finite(&truth)?;
        let index = SurfaceIndex::new(&truth).ok_or(MetricsError::EmptyTruth)?;
        let sampler = SurfaceSampler::new(&truth).ok_or(MetricsError::EmptyTruth)?;
        let surface_points = surface_points(&sampler, sampling, Stream::TruthSurface);
        let chamfer_points = chamfer_points(&sampler, sampling, Stream::TruthChamfer);
        let chamfer_nearest = NearestPoints::new(chamfer_points.clone());
        Ok(Self { truth, index, surface_points, chamfer_points, chamfer_nearest, sampling })
    }

    /// The true surface.
    pub fn truth(&self) -> &TriangleMesh {
        &self.truth
    }

    /// Mean of the two directed mean point-to-surface distances, in metres.
    ///
    /// # Errors
    /// If the reconstruction has no area or is not finite.
    pub fn surface_distance_m(&self, reconstruction: &TriangleMesh) -> Result<f64, MetricsError> {
        let (to_truth, to_reconstruction) = self.directed_distances(reconstruction)?;
        Ok(0.5 * (mean(&to_truth) + mean(&to_reconstruction)))
    }

    /// The chamfer distances between samples of both surfaces.
    ///
    /// # Errors
    /// If the reconstruction has no area or is not finite.
    pub fn chamfer(&self, reconstruction: &TriangleMesh) -> Result<Chamfer, MetricsError> {
        require_finite(reconstruction)?;
        let sampler = SurfaceSampler::new(reconstruction).ok_or(MetricsError::EmptyReconstruction)?;
        let points = chamfer_points(&sampler, self.sampling, Stream::ReconstructionChamfer);
        let nearest = NearestPoints::new(points.clone());
        let sum_m =
            mean_nearest_m(&points, &self.chamfer_nearest) + mean_nearest_m(&self.chamfer_points, &nearest);
        Ok(Chamfer { sum_m, mean_m: 0.5 * sum_m })
    }

    /// What a perfect reconstruction scores: the true surface against other samples of itself.
    ///
    /// # Errors
    /// None that [`Self::new`] has not refused already.
    pub fn chamfer_floor(&self) -> Result<Chamfer, MetricsError> {
        self.chamfer(&self.truth)
    }

    /// All metrics at once.
    ///
    /// # Errors
    /// If the reconstruction has no area or is not finite.
    pub fn compare(&self, reconstruction: &TriangleMesh) -> Result<Comparison, MetricsError> {
        let (to_truth, to_reconstruction) = self.directed_distances(reconstruction)?;
        let precision = share_within(&to_truth, F_SCORE_DISTANCE_M);
        let recall = share_within(&to_reconstruction, F_SCORE_DISTANCE_M);
        let f_score_1mm =
            if precision + recall > 0.0 { 2.0 * precision * recall / (precision + recall) } else { 0.0 };
        Ok(Comparison {
            surface_distance_m: 0.5 * (mean(&to_truth) + mean(&to_reconstruction)),
            hausdorff_m: to_truth
                .iter()
                .chain(&to_reconstruction)
                .fold(0.0, |greatest: f64, &distance| greatest.max(distance)),
            f_score_1mm,
            coverage: share_within(&to_reconstruction, COVERAGE_DISTANCE_M),
            volume_ratio: reconstruction.volume() / self.truth.volume(),
            chamfer: self.chamfer(reconstruction)?,
        })
    }

    /// Share of the reconstruction's vertices whose true error lies within two of their stated
    /// standard deviations (metres); 0.95 is what an honest statement reaches.
    ///
    /// # Errors
    /// As those of [`Self::stated_errors`].
    pub fn calibration_2sigma(
        &self,
        reconstruction: &TriangleMesh,
        std_m: &[f64],
    ) -> Result<f64, MetricsError> {
        Ok(coverage(&self.stated_errors(reconstruction, std_m)?, 2.0))
    }

    /// The true error of each vertex of the reconstruction beside its stated standard deviation,
    /// in metres; every vertex counts the same.
    ///
    /// # Errors
    /// If there is no vertex, not one deviation a vertex, or a vertex that is not finite.
    pub fn stated_errors(
        &self,
        reconstruction: &TriangleMesh,
        std_m: &[f64],
    ) -> Result<Vec<StatedError>, MetricsError> {
        require_finite(reconstruction)?;
        if reconstruction.vertices.is_empty() {
            return Err(MetricsError::EmptyReconstruction);
        }
        if std_m.len() != reconstruction.vertices.len() {
            return Err(MetricsError::DeviationCount {
                vertices: reconstruction.vertices.len(),
                deviations: std_m.len(),
            });
        }
        let errors = distances(&reconstruction.vertices, &self.index);
        Ok(std_m.iter().zip(errors).map(|(&std_m, error_m)| StatedError { std_m, error_m }).collect())
    }

    /// Distances from the reconstruction to the truth, and from the truth to the reconstruction.
    fn directed_distances(
        &self,
        reconstruction: &TriangleMesh,
    ) -> Result<(Vec<f64>, Vec<f64>), MetricsError> {
        require_finite(reconstruction)?;
        let index = SurfaceIndex::new(reconstruction).ok_or(MetricsError::EmptyReconstruction)?;
        let sampler = SurfaceSampler::new(reconstruction).ok_or(MetricsError::EmptyReconstruction)?;
        let points = surface_points(&sampler, self.sampling, Stream::ReconstructionSurface);
        Ok((distances(&points, &self.index), distances(&self.surface_points, &index)))
    }
}

fn require_finite(mesh: &TriangleMesh) -> Result<(), MetricsError> {
    let finite = |point: &Point| point.coords.iter().all(|x| x.is_finite());
    if mesh.vertices.iter().all(finite) { Ok(()) } else { Err(MetricsError::NotFinite) }
}

fn generator(sampling: Sampling, stream: Stream) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(sampling.seed);
    rng.set_stream(stream as u64);
    rng
}

fn surface_points(sampler: &SurfaceSampler, sampling: Sampling, stream: Stream) -> Vec<Point> {
    sampler
        .stratified(sampling.surface_points, &mut generator(sampling, stream))
        .into_iter()
        .map(|sample| sample.point)
        .collect()
}

fn chamfer_points(sampler: &SurfaceSampler, sampling: Sampling, stream: Stream) -> Vec<[f64; 3]> {
    sampler
        .independent(sampling.chamfer_points, &mut generator(sampling, stream))
        .into_iter()
        .map(|sample| sample.point.into())
        .collect()
}

fn distances(points: &[Point], surface: &SurfaceIndex) -> Vec<f64> {
    points.iter().map(|point| surface.closest(point).distance_m).collect()
}

fn mean_nearest_m(points: &[[f64; 3]], others: &NearestPoints) -> f64 {
    let distances: Vec<f64> = points.iter().map(|point| others.distance(point)).collect();
    mean(&distances)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn share_within(distances: &[f64], reach_m: f64) -> f64 {
    let within = distances.iter().filter(|&&d| d <= reach_m).count();
    within as f64 / distances.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Icosphere, Vector};

    fn sphere(radius_m: f64) -> TriangleMesh {
        Icosphere::get(5).mesh_of(|direction| Point::from(radius_m * direction.into_inner()))
    }

    /// A square plate of side 0.1 m at height `z`.
    fn plate(z: f64) -> TriangleMesh {
        TriangleMesh {
            vertices: [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]
                .map(|(x, y)| Point::new(x, y, z))
                .to_vec(),
            faces: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    #[test]
    fn concentric_spheres_are_apart_by_the_difference_of_their_radii() {
        let reference = Reference::new(sphere(0.05), Sampling::default()).unwrap();
        let found = reference.compare(&sphere(0.053)).unwrap();
        assert!((found.surface_distance_m - 0.003).abs() < 2e-5);
        assert!((found.hausdorff_m - 0.003).abs() < 6e-5);
        assert!((found.volume_ratio - (0.053_f64 / 0.05).powi(3)).abs() < 1e-9);
        assert_eq!(found.f_score_1mm, 0.0);
        assert_eq!(found.coverage, 0.0);
        let near = reference.compare(&sphere(0.0505)).unwrap();
        assert_eq!(near.f_score_1mm, 1.0);
        assert_eq!(near.coverage, 1.0);
    }

    #[test]
    fn parallel_plates_are_apart_by_their_distance() {
        let reference = Reference::new(plate(0.0), Sampling::default()).unwrap();
        let distance = reference.surface_distance_m(&plate(0.007)).unwrap();
        assert!((distance - 0.007).abs() < 1e-12);
    }

    #[test]
    fn half_a_plate_is_half_covered_and_the_directions_are_averaged() {
        let mut half = plate(0.0);
        half.vertices[1].x = 0.05;
        half.vertices[2].x = 0.05;
        let reference = Reference::new(plate(0.0), Sampling::default()).unwrap();
        let found = reference.compare(&half).unwrap();
        // The uncovered half is a mean 25 mm away; the other direction is exact.
        assert!((found.surface_distance_m - 0.5 * 0.5 * 0.025).abs() < 1e-4);
        assert!((found.coverage - 0.52).abs() < 0.01);
        assert!((found.hausdorff_m - 0.05).abs() < 1e-3);
    }

    #[test]
    fn the_exact_surface_scores_zero_and_its_chamfer_is_the_sampling_floor() {
        let truth = sphere(0.0638);
        let area = truth.area();
        let reference = Reference::new(truth.clone(), Sampling::default()).unwrap();
        assert!(reference.surface_distance_m(&truth).unwrap() < 1e-12);
        let floor = reference.chamfer_floor().unwrap();
        let expected = 0.5 * (area / 13_000.0).sqrt();
        assert!((floor.mean_m / expected - 1.0).abs() < 0.02);
        assert!((floor.sum_m - 2.0 * floor.mean_m).abs() < 1e-15);
    }

    #[test]
    fn the_chamfer_distance_of_far_surfaces_is_their_distance() {
        let reference = Reference::new(plate(0.0), Sampling::default()).unwrap();
        let chamfer = reference.chamfer(&plate(0.5)).unwrap();
        assert!((chamfer.mean_m - 0.5).abs() < 1e-5);
    }

    #[test]
    fn a_shift_of_both_surfaces_changes_nothing() {
        let shift = Vector::new(0.3, -0.2, 0.1);
        let moved = |mut mesh: TriangleMesh| {
            mesh.vertices.iter_mut().for_each(|vertex| *vertex += shift);
            mesh
        };
        let here = Reference::new(sphere(0.05), Sampling::default()).unwrap();
        let there = Reference::new(moved(sphere(0.05)), Sampling::default()).unwrap();
        let found = here.surface_distance_m(&sphere(0.06)).unwrap();
        let found_moved = there.surface_distance_m(&moved(sphere(0.06))).unwrap();
        assert!((found - found_moved).abs() < 1e-9);
    }

    #[test]
    fn calibration_counts_vertices_within_two_sigma() {
        let reference = Reference::new(sphere(0.05), Sampling::default()).unwrap();
        let estimate = sphere(0.053);
        let half = estimate.vertices.len() / 2;
        let mut std_m = vec![0.002; estimate.vertices.len()];
        std_m[..half].fill(0.001);
        let share = reference.calibration_2sigma(&estimate, &std_m).unwrap();
        assert!((share - 0.5).abs() < 1e-3);
        assert!(matches!(
            reference.calibration_2sigma(&estimate, &std_m[1..]),
            Err(MetricsError::DeviationCount { .. })
        ));
    }

    #[test]
    fn the_same_seed_gives_the_same_figures_to_the_last_bit() {
        let figures = || {
            let reference = Reference::new(sphere(0.05), Sampling::default()).unwrap();
            reference.compare(&sphere(0.051)).unwrap()
        };
        assert_eq!(figures(), figures());
    }

    #[test]
    fn a_mesh_without_area_or_with_nan_is_refused() {
        let reference = Reference::new(plate(0.0), Sampling::default()).unwrap();
        let nothing = TriangleMesh::default();
        assert_eq!(reference.compare(&nothing).unwrap_err(), MetricsError::EmptyReconstruction);
        let mut broken = plate(0.0);
        broken.vertices[0].x = f64::NAN;
        assert_eq!(reference.surface_distance_m(&broken).unwrap_err(), MetricsError::NotFinite);
        assert!(Reference::new(nothing, Sampling::default()).is_err());
    }
}
