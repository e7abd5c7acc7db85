//! Clouds of visual points out of bytes that somebody sent: nothing in them is believed before it is checked.

mod column;
mod lzf;
mod packed;
mod pcd;
mod ply;
mod text;

use palpate_core::error::FieldError;
use palpate_core::evidence::MAX_COORDINATE_M;
use palpate_core::geometry::Point;

pub(crate) use packed::{Declared, Layout};

/// The field that every error here names.
const FIELD: &str = "points";
/// A surface takes this many points.
const LEAST_POINTS: usize = 4;

/// How a cloud is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PointEncoding {
    /// Little-endian `f32` x, y, z, x, y, z, ...
    XyzF32Le,
    /// A PLY file.
    Ply,
    /// A PCD file.
    Pcd,
    /// Points of a fixed size in bytes.
    Packed(Layout),
}

/// What was read of a view.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Cloud {
    /// Points with finite coordinates, in metres.
    pub(crate) points: Vec<Point>,
    /// Where the camera was, as far as the view itself says so.
    pub(crate) viewpoint: Option<Point>,
    /// Points with a NaN or an infinity, as depth cameras mark what they did not see. They are dropped.
    pub(crate) non_finite: usize,
    /// Pixels between an edge and what lies behind it. They are dropped.
    pub(crate) flying: usize,
}

/// Reads a cloud, in metres. Whether it shows a surface is for the core to say.
///
/// # Errors
/// Bytes that are not what `encoding` says, a point that is absurdly far away, or hardly any finite one; the error
/// names the field `points`.
pub(crate) fn read_points(encoding: PointEncoding, bytes: &[u8]) -> Result<Cloud, FieldError> {
    let invalid = |reason| FieldError::invalid(FIELD, reason);
    let (points, viewpoint) = match encoding {
        PointEncoding::XyzF32Le => (Layout::XYZ_F32_LE.read(bytes).map_err(invalid)?, None),
        PointEncoding::Packed(layout) => (layout.read(bytes).map_err(invalid)?, None),
        PointEncoding::Ply => (ply::read(bytes).map_err(invalid)?, None),
        PointEncoding::Pcd => {
            let pcd::Pcd { points, viewpoint } = pcd::read(bytes).map_err(invalid)?;
            (points, viewpoint)
        }
    };
    let (points, non_finite) = finite(points)?;
    Ok(Cloud { points, viewpoint, non_finite, flying: 0 })
}

/// The points without those that have a NaN or an infinity, which are counted.
///
/// # Errors
/// One is far away, which is a mistake of another kind, or fewer finite ones are left than make a surface.
fn finite(mut points: Vec<Point>) -> Result<(Vec<Point>, usize), FieldError> {
    let far = |point: &Point| point.iter().any(|x| x.is_finite() && x.abs() > MAX_COORDINATE_M);
    if let Some(index) = points.iter().position(far) {
        let Point { coords } = points[index];
        let (x, y, z) = (coords.x, coords.y, coords.z);
        let reason = format!(
            "point {index} is ({x}, {y}, {z}), beyond {MAX_COORDINATE_M} m: are these metres, and 32-bit floats?"
        );
        return Err(FieldError::non_finite(FIELD, reason));
    }
    let all = points.len();
    points.retain(|point| point.iter().all(|x| x.is_finite()));
    if points.len() < LEAST_POINTS && points.len() < all {
        let reason = format!(
            "{} of {all} points are finite, and at least {LEAST_POINTS} are needed: the others are NaN or infinite",
            points.len()
        );
        return Err(FieldError::non_finite(FIELD, reason));
    }
    let non_finite = all - points.len();
    Ok((points, non_finite))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed(points: &[[f32; 3]]) -> Vec<u8> {
        points.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
    }

    #[test]
    fn packed_floats_that_break_off_inside_a_point_are_refused() {
        let error = read_points(PointEncoding::XyzF32Le, &[0; 25]).unwrap_err();
        assert!(error.reason.starts_with("25 bytes are no whole number of points"), "{}", error.reason);
        assert!(error.reason.ends_with("each takes 12 bytes, x, y, z as f32"), "{}", error.reason);
    }

    #[test]
    fn what_is_not_finite_is_dropped_and_counted_and_what_is_far_is_refused() {
        let mut points = [[0.5; 3]; 6];
        points[1][2] = f32::NAN;
        points[4][0] = f32::NEG_INFINITY;
        let cloud = read_points(PointEncoding::XyzF32Le, &packed(&points)).unwrap();
        assert_eq!((cloud.points.len(), cloud.non_finite), (4, 2));
        points[0][0] = f32::NAN;
        let few = read_points(PointEncoding::XyzF32Le, &packed(&points)).unwrap_err();
        assert!(few.non_finite && few.reason.starts_with("3 of 6 points are finite"), "{}", few.reason);
        points[5][1] = 2e4;
        let far = read_points(PointEncoding::XyzF32Le, &packed(&points)).unwrap_err();
        assert!(far.non_finite && far.reason.starts_with("point 5 is"), "{}", far.reason);
    }

    #[test]
    fn text_that_says_nan_is_read_like_bytes_that_do() {
        let header =
            "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n";
        let file = format!("{header}end_header\n0 0 0\n1 0 0\nnan nan nan\n0 1 0\n1 1 0\n");
        let cloud = read_points(PointEncoding::Ply, file.as_bytes()).unwrap();
        assert_eq!((cloud.points.len(), cloud.non_finite, cloud.viewpoint), (4, 1, None));
    }
}
