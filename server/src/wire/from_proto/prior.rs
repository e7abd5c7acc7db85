//! Visual priors: bytes to points, points thinned and checked.

use palpate_core::evidence::{MAX_COORDINATE_M, VisualPrior};
use palpate_core::geometry::Point;
use palpate_proto::v1;

use super::geometry::optional_vector;
use super::{at, check_timestamp, non_finite};
use crate::error::Error;
use crate::mesh_format::{PointEncoding, read_points};
use crate::voxel;

/// A cloud ready to be absorbed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Prior {
    pub(crate) evidence: VisualPrior,
    /// Points that thinning dropped, exact duplicates included.
    pub(crate) dropped: u32,
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
    check_finite(path, &read)?;
    let thinned = match *voxel_m {
        None => voxel::without_duplicates(&read),
        Some(voxel_m) => {
            check_voxel(path, voxel_m)?;
            voxel::one_per_voxel(&read, voxel_m)
        }
    };
    let dropped = u32::try_from(read.len() - thinned.len()).unwrap_or(u32::MAX);
    let evidence = VisualPrior::new(thinned, *uncertainty, viewpoint).map_err(|error| at(path, error))?;
    Ok(Prior { evidence, dropped })
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

fn check_finite(path: &str, points: &[Point]) -> Result<(), Error> {
    let bad = points.iter().position(|point| !point.iter().all(|x| x.abs() <= MAX_COORDINATE_M));
    bad.map_or(Ok(()), |index| {
        let Point { coords } = points[index];
        let (x, y, z) = (coords.x, coords.y, coords.z);
        let description =
            format!("point {index} is ({x}, {y}, {z}): not finite or beyond {MAX_COORDINATE_M} m");
        Err(non_finite(format!("{path}.points"), description))
    })
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
