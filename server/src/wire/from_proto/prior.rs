//! Visual priors: bytes to points, points thinned and checked.

use palpate_core::evidence::{MAX_COORDINATE_M, VisualPrior};
use palpate_core::geometry::Point;
use palpate_proto::v1;

use super::geometry::optional_vector;
use super::{at, check_timestamp, non_finite};
use crate::error::Error;
use crate::mesh_format::{PointEncoding, read_points};
use crate::voxel;

/// A surface takes this many points.
const LEAST_POINTS: usize = 4;

/// A cloud ready to be absorbed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Prior {
    pub(crate) evidence: VisualPrior,
    /// Points with finite coordinates.
    pub(crate) finite: usize,
    /// Points with a NaN or an infinity, as depth cameras mark what they did not see. They are dropped.
    pub(crate) non_finite: usize,
    /// The edge of the voxels that the caller wants, in metres.
    pub(crate) voxel_m: Option<f64>,
}

/// Reads a cloud that the caller wrote at `path`. Costs milliseconds for a large one.
///
/// # Errors
/// Bytes that are no cloud, numbers that are none, or too few points to show a surface.
pub(crate) fn visual_prior(path: &str, prior: &v1::VisualPrior) -> Result<Prior, Error> {
    let v1::VisualPrior {
        encoding: wanted_encoding,
        points,
        uncertainty,
        viewpoint,
        voxel_m,
        capture_time,
        depth,
    } = prior;
    if depth.is_some() {
        return Err(Error::unimplemented(format!("{path}.depth")));
    }
    let encoding = encoding(&format!("{path}.encoding"), *wanted_encoding)?;
    check_timestamp(&format!("{path}.capture_time"), capture_time.as_ref())?;
    let viewpoint = optional_vector(&format!("{path}.viewpoint"), viewpoint.as_ref())?.map(Point::from);
    let read = read_points(encoding, points).map_err(|error| at(path, error))?;
    let all = read.len();
    let finite = finite_points(path, read)?;
    let thinned = match *voxel_m {
        None => voxel::without_duplicates(&finite),
        Some(voxel_m) => {
            check_voxel(path, voxel_m)?;
            voxel::means(&finite, voxel_m)
        }
    };
    let evidence = VisualPrior::new(thinned, *uncertainty, viewpoint).map_err(|error| at(path, error))?;
    Ok(Prior { evidence, finite: finite.len(), non_finite: all - finite.len(), voxel_m: *voxel_m })
}

/// Whether clouds in this encoding can be read.
pub(crate) fn is_readable(encoding: v1::PointEncoding) -> bool {
    match encoding {
        v1::PointEncoding::XyzF32Le | v1::PointEncoding::Ply => true,
        v1::PointEncoding::Unspecified | v1::PointEncoding::DepthU16 => false,
    }
}

fn encoding(field: &str, value: i32) -> Result<PointEncoding, Error> {
    match v1::PointEncoding::try_from(value) {
        Ok(v1::PointEncoding::XyzF32Le) => Ok(PointEncoding::XyzF32Le),
        Ok(v1::PointEncoding::Ply) => Ok(PointEncoding::Ply),
        Ok(v1::PointEncoding::DepthU16) => {
            Err(Error::unimplemented(format!("{field} POINT_ENCODING_DEPTH_U16")))
        }
        Ok(v1::PointEncoding::Unspecified) => {
            Err(Error::field(field, "is missing: say POINT_ENCODING_XYZ_F32_LE or POINT_ENCODING_PLY"))
        }
        Err(_) => Err(Error::field(field, format!("{value} is no encoding"))),
    }
}

/// The points without those that have a NaN or an infinity; one far away is a mistake of another kind.
fn finite_points(path: &str, mut points: Vec<Point>) -> Result<Vec<Point>, Error> {
    let far = |point: &Point| point.iter().any(|x| x.is_finite() && x.abs() > MAX_COORDINATE_M);
    let field = || format!("{path}.points");
    if let Some(index) = points.iter().position(far) {
        let Point { coords } = points[index];
        let (x, y, z) = (coords.x, coords.y, coords.z);
        let description = format!(
            "point {index} is ({x}, {y}, {z}), beyond {MAX_COORDINATE_M} m: are these metres, and 32-bit floats?"
        );
        return Err(non_finite(field(), description));
    }
    let all = points.len();
    points.retain(|point| point.iter().all(|x| x.is_finite()));
    if points.len() < LEAST_POINTS && points.len() < all {
        let description = format!(
            "{} of {all} points are finite, and at least {LEAST_POINTS} are needed: the others are NaN or infinite",
            points.len()
        );
        return Err(non_finite(field(), description));
    }
    Ok(points)
}

fn check_voxel(path: &str, voxel_m: f64) -> Result<(), Error> {
    let field = format!("{path}.voxel_m");
    if !voxel_m.is_finite() {
        return Err(non_finite(field, format!("{voxel_m} is not finite")));
    }
    if (1e-5..=1.0).contains(&voxel_m) {
        return Ok(());
    }
    Err(Error::field(field, format!("{voxel_m} m is not between 0.00001 m and 1 m")))
}
