//! The frame of the visual patch: where a fit is well scaled, and where its prior expects the object.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::evidence::attractor::{Attractor, Sense};
use crate::fingerprint::Fingerprint;
use crate::geometry::{Point, Vector};

/// A patch is at least this long, in metres: points may coincide once their coordinates are rounded.
const LEAST_M: f64 = 1e-9;

/// Bounds of the logarithm of a semi-axis over the patch's length.
pub(crate) const LOG_SIZE: (f64, f64) = (-3.0, 3.5);

pub(crate) fn clamp_log_size(log_size: f64) -> f64 {
    log_size.clamp(LOG_SIZE.0, LOG_SIZE.1)
}

/// The frame in which a fit is well scaled, and where its prior expects the object.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct PatchFrame {
    /// Centroid of the visual points.
    pub(crate) origin: Point,
    /// Their root mean square distance from it, in metres.
    pub(crate) length_m: f64,
    /// How many visual points there are, at least one.
    pub(crate) visual_points: f64,
    /// Where the prior expects the centre, in lengths from the origin: one length behind the
    /// patch, seen from the camera; at the patch where no camera is known.
    pub(crate) centre: Vector,
}

impl PatchFrame {
    pub(crate) fn of(attractors: &[Attractor], viewpoint: Option<&Point>) -> Self {
        let visual = || attractors.iter().filter(|a| a.sense == Sense::Vision).map(|a| &a.point);
        let visual_points = visual().count().max(1) as f64;
        let origin = Point::from(visual().map(|point| point.coords).sum::<Vector>() / visual_points);
        let mean_square = visual().map(|point| (point - origin).norm_squared()).sum::<f64>() / visual_points;
        let to_camera = viewpoint.and_then(|viewpoint| (viewpoint - origin).try_normalize(1e-9));
        Self {
            origin,
            length_m: mean_square.sqrt().max(LEAST_M),
            visual_points,
            centre: to_camera.map_or_else(Vector::zeros, |direction| -direction),
        }
    }

    /// Adds itself to a fingerprint.
    pub(crate) fn fingerprint(&self, fingerprint: &mut Fingerprint) {
        let Self { origin, length_m, visual_points, centre } = self;
        fingerprint.vector(&origin.coords);
        fingerprint.vector(centre);
        fingerprint.numbers(&[*length_m, *visual_points]);
    }

    /// A point in lengths from the origin.
    pub(crate) fn local(&self, point: &Point) -> Vector {
        (point - self.origin) / self.length_m
    }

    /// A point of the session's frame from one in lengths.
    pub(crate) fn base(&self, local: &Vector) -> Point {
        self.origin + local * self.length_m
    }
}

/// The principal direction of rank `rank` (0 = least spread), with the sign of its third moment.
pub(crate) fn principal_axis(offsets: &[Vector], rank: usize) -> Vector {
    let covariance: Matrix3<f64> = offsets.iter().map(|v| v * v.transpose()).sum();
    let eigen = covariance.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let axis = eigen.eigenvectors.column(order[rank]).into_owned();
    let skew: f64 = offsets.iter().map(|v| v.dot(&axis).powi(3)).sum();
    if skew < 0.0 { -axis } else { axis }
}
