//! Visual priors: bytes to points, points thinned and checked.

use palpate_core::evidence::VisualPrior;
use palpate_core::geometry::Point;
use palpate_core::warning::{Warning, WarningKind};
use palpate_proto::v1;

use super::depth::depth_image;
use super::geometry::optional_vector;
use super::size::check_least_size;
use super::{at, check_showable, check_timestamp, non_finite, required};
use crate::depth;
use crate::error::Error;
use crate::mesh_format::{Cloud, Declared, Layout, PointEncoding, read_points};
use crate::voxel;

/// Points that were sent more than once are worth a warning from this many on, and from this share of all.
const REPEATED_POINTS: usize = 4;
const REPEATED_SHARE: f64 = 0.05;

/// A cloud ready to be absorbed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Prior {
    pub(crate) evidence: VisualPrior,
    /// Points with finite coordinates, each counted once.
    pub(crate) finite: usize,
    /// Points with a NaN or an infinity, as depth cameras mark what they did not see. They are dropped.
    pub(crate) non_finite: usize,
    /// Points that were sent before in the same cloud. They are dropped.
    pub(crate) repeated: usize,
    /// Pixels between an edge and what lies behind it. They are dropped.
    pub(crate) flying: usize,
    /// The edge of the voxels that the caller wants, in metres.
    pub(crate) voxel_m: Option<f64>,
    /// What was noticed about the points.
    pub(crate) warnings: Vec<Warning>,
}

/// Where the bytes of a view lead.
enum Form<'a> {
    Points(PointEncoding),
    Image(depth::Encoding, depth::DepthImage<'a>),
}

/// Reads a cloud that is sent now, of which more is asked than of one that is in a log.
///
/// # Errors
/// As [`visual_prior`]; a cloud smaller than any object, or a time that cannot be shown.
pub(crate) fn sent_prior(path: &str, prior: &v1::VisualPrior) -> Result<Prior, Error> {
    check_showable(&format!("{path}.capture_time"), prior.capture_time.as_ref())?;
    let read = visual_prior(path, prior)?;
    check_least_size(path, read.evidence.points())?;
    Ok(read)
}

/// Reads a cloud that the caller wrote at `path`. Costs milliseconds for a large one.
///
/// # Errors
/// Bytes that are no cloud, numbers that are none, or too few points to show a surface.
pub(crate) fn visual_prior(path: &str, prior: &v1::VisualPrior) -> Result<Prior, Error> {
    let v1::VisualPrior {
        encoding: _,
        points,
        uncertainty,
        viewpoint,
        voxel_m,
        capture_time,
        depth: _,
        packed: _,
        keep_clutter: _,
    } = prior;
    let form = form(path, prior)?;
    check_timestamp(&format!("{path}.capture_time"), capture_time.as_ref())?;
    let viewpoint = optional_vector(&format!("{path}.viewpoint"), viewpoint.as_ref())?.map(Point::from);
    let (read, is_image) = match form {
        Form::Points(encoding) => (read_points(encoding, points), false),
        Form::Image(encoding, image) => (depth::read(&image, encoding, points), true),
    };
    let Cloud { points: sent, viewpoint: own_viewpoint, non_finite, flying } =
        read.map_err(|error| at(path, error))?;
    let count = sent.len();
    // No two pixels look the same way.
    let unique = if is_image { sent } else { voxel::without_duplicates(&sent) };
    let (finite, repeated) = (unique.len(), count - unique.len());
    let warnings = warnings(count, non_finite, repeated);
    let thinned = match *voxel_m {
        None => unique,
        Some(voxel_m) => {
            check_voxel(path, voxel_m)?;
            voxel::means(&unique, voxel_m)
        }
    };
    let evidence = VisualPrior::new(thinned, *uncertainty, viewpoint.or(own_viewpoint));
    let evidence = evidence.map_err(|error| at(path, error))?;
    Ok(Prior { evidence, finite, non_finite, repeated, flying, voxel_m: *voxel_m, warnings })
}

/// Whether views in this encoding can be read.
pub(crate) fn is_readable(encoding: v1::PointEncoding) -> bool {
    match encoding {
        v1::PointEncoding::XyzF32Le
        | v1::PointEncoding::Ply
        | v1::PointEncoding::DepthU16
        | v1::PointEncoding::Pcd
        | v1::PointEncoding::Packed
        | v1::PointEncoding::DepthPng => true,
        v1::PointEncoding::Unspecified => false,
    }
}

fn form<'a>(path: &str, prior: &'a v1::VisualPrior) -> Result<Form<'a>, Error> {
    let field = format!("{path}.encoding");
    let encoding = match v1::PointEncoding::try_from(prior.encoding) {
        Ok(v1::PointEncoding::Unspecified) => {
            let description = "is missing: say POINT_ENCODING_XYZ_F32_LE, POINT_ENCODING_PLY, POINT_ENCODING_PCD, \
                               POINT_ENCODING_PACKED, POINT_ENCODING_DEPTH_U16 or POINT_ENCODING_DEPTH_PNG";
            return Err(Error::field(field, description));
        }
        Ok(encoding) => encoding,
        Err(_) => return Err(Error::field(field, format!("{} is no encoding", prior.encoding))),
    };
    let needless = |name: &str| {
        let description =
            format!("says nothing of {}: leave it out, or say another encoding", encoding.as_str_name());
        Err(Error::field(format!("{path}.{name}"), description))
    };
    let takes_depth = matches!(encoding, v1::PointEncoding::DepthU16 | v1::PointEncoding::DepthPng);
    if prior.depth.is_some() && !takes_depth {
        return needless("depth");
    }
    if prior.packed.is_some() && encoding != v1::PointEncoding::Packed {
        return needless("packed");
    }
    let image = |encoding| {
        let depth_path = format!("{path}.depth");
        let image = required(&depth_path, prior.depth.as_ref())?;
        // Who wants clutter wants its edges, too.
        Ok(Form::Image(encoding, depth_image(&depth_path, image, prior.keep_clutter)?))
    };
    match encoding {
        v1::PointEncoding::XyzF32Le | v1::PointEncoding::Unspecified => {
            Ok(Form::Points(PointEncoding::XyzF32Le))
        }
        v1::PointEncoding::Ply => Ok(Form::Points(PointEncoding::Ply)),
        v1::PointEncoding::Pcd => Ok(Form::Points(PointEncoding::Pcd)),
        v1::PointEncoding::Packed => {
            Ok(Form::Points(PointEncoding::Packed(layout(path, prior.packed.as_ref())?)))
        }
        v1::PointEncoding::DepthU16 => image(depth::Encoding::U16Le),
        v1::PointEncoding::DepthPng => image(depth::Encoding::Png),
    }
}

fn layout(path: &str, packed: Option<&v1::PackedPoints>) -> Result<Layout, Error> {
    let &v1::PackedPoints {
        point_step,
        x_offset,
        y_offset,
        z_offset,
        is_double,
        is_bigendian,
        width,
        row_step,
    } = required(&format!("{path}.packed"), packed)?;
    let offsets = [x_offset, y_offset, z_offset];
    let declared = Declared { point_step, offsets, is_double, is_bigendian, width, row_step };
    Layout::new(&declared).map_err(|error| at(path, error))
}

/// What to say of `finite` points, of which some are `repeated`, beside which others are not finite.
fn warnings(finite: usize, non_finite: usize, repeated: usize) -> Vec<Warning> {
    let mut warnings = Vec::new();
    if non_finite > 0 {
        let all = finite + non_finite;
        let message = format!("{non_finite} of {all} points are NaN or infinite and were dropped");
        let warning = Warning::new(WarningKind::NonFinitePoints, message);
        warnings.push(warning.with("non_finite_points", non_finite as f64).with("points", all as f64));
    }
    if repeated >= REPEATED_POINTS && repeated as f64 > REPEATED_SHARE * finite as f64 {
        let message = format!(
            "{repeated} of {finite} points repeat another one exactly and count once: if these are pixels without depth, \
             leave them out"
        );
        let warning = Warning::new(WarningKind::RepeatedPoints, message);
        warnings.push(warning.with("repeated_points", repeated as f64).with("points", finite as f64));
    }
    warnings
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
