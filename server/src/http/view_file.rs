//! A camera's view as a file: what JSON says in fields, the media type and the query say here.

use axum::body::Bytes;
use palpate_proto::v1;
use serde::Deserialize;

use crate::error::Error;

/// The media types of files that are taken, for refusals.
pub(super) const TAKEN: &str = "application/json, application/ply, application/pcd, image/png (a depth image) or \
                                application/octet-stream (packed little-endian f32 x, y, z, or as point_step says)";

/// What goes with a view that is sent as a file; a JSON body says these things itself.
#[derive(Default, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ViewParams {
    /// Uncertainty of these points, in [0, 1]; without it the session's.
    uncertainty: Option<f64>,
    /// The camera's position `x,y,z` in metres, in the session's frame. Without it, that of the PCD file's VIEWPOINT
    /// line or of the depth image's pose.
    viewpoint: Option<String>,
    /// Edge of the voxels of which each gives the mean of its points, in metres; without it only exact duplicates are
    /// dropped. What is over the limit of a session is thinned to it in any case.
    voxel_m: Option<f64>,
    /// Keep what is set aside otherwise, such as pixels at a depth edge.
    keep_clutter: Option<bool>,
    /// How many candidates to propose in the reply.
    propose: Option<u32>,
    /// The session must be at this revision.
    expected_revision: Option<i64>,
    /// Makes a repeated call safe; the `Idempotency-Key` header does the same.
    request_id: Option<String>,
    /// For `image/png`: focal length along the columns, in pixels.
    fx: Option<f64>,
    /// For `image/png`: focal length along the rows, in pixels.
    fy: Option<f64>,
    /// For `image/png`: column of the principal point, in pixels; the centre of the top left pixel is 0.
    cx: Option<f64>,
    /// For `image/png`: row of the principal point, in pixels; the centre of the top left pixel is 0.
    cy: Option<f64>,
    /// For `image/png`: metres per stored unit; 0.001 without it. A stored 0 means no measurement.
    depth_scale_m: Option<f64>,
    /// For `image/png`: pose `x,y,z,qx,qy,qz,qw` of the camera's optical frame (x right, y down, z forward) in the
    /// session's frame, in metres and as a unit quaternion.
    base_from_camera: Option<String>,
    /// For `image/png`: nearer pixels are dropped, in metres along the optical axis.
    min_depth_m: Option<f64>,
    /// For `image/png`: farther pixels are dropped, in metres along the optical axis.
    max_depth_m: Option<f64>,
    /// For `application/octet-stream`: bytes from one point to the next, as in `sensor_msgs/PointCloud2`; without it
    /// the points are packed little-endian `f32` x, y, z.
    point_step: Option<u32>,
    /// With `point_step`: where x begins in a point, in bytes.
    x_offset: Option<u32>,
    /// With `point_step`: where y begins in a point, in bytes.
    y_offset: Option<u32>,
    /// With `point_step`: where z begins in a point, in bytes.
    z_offset: Option<u32>,
    /// With `point_step`: true for 64-bit floats.
    is_double: Option<bool>,
    /// With `point_step`: true where the most significant byte comes first.
    is_bigendian: Option<bool>,
    /// With `point_step`: points in a row; without it all are one row.
    width: Option<u32>,
    /// With `point_step`: bytes from one row to the next; without it rows have no padding.
    row_step: Option<u32>,
}

/// How a body of this media type is to be read; `None` where it is no view.
pub(super) fn encoding(media_type: &str, params: &ViewParams) -> Option<v1::PointEncoding> {
    match media_type {
        "application/ply" | "application/x-ply" | "model/ply" => Some(v1::PointEncoding::Ply),
        "application/pcd" | "application/x-pcd" => Some(v1::PointEncoding::Pcd),
        "image/png" => Some(v1::PointEncoding::DepthPng),
        "application/octet-stream" if params.point_step.is_some() => Some(v1::PointEncoding::Packed),
        "application/octet-stream" => Some(v1::PointEncoding::XyzF32Le),
        _ => None,
    }
}

/// The request that such a file is, but for the session's id.
///
/// # Errors
/// A parameter that cannot be read, is missing, or belongs to another kind of file.
pub(super) fn request(
    encoding: v1::PointEncoding,
    points: Bytes,
    params: ViewParams,
) -> Result<v1::AddVisualPriorRequest, Error> {
    let is_image = encoding == v1::PointEncoding::DepthPng;
    let is_packed = encoding == v1::PointEncoding::Packed;
    if let Some(name) = params.of_images().filter(|_| !is_image) {
        return Err(Error::field(name, "is for depth images, which come as image/png"));
    }
    if let Some(name) = params.of_packed_points().filter(|_| !is_packed) {
        return Err(Error::field(name, "is for application/octet-stream with point_step"));
    }
    let prior = v1::VisualPrior {
        encoding: encoding.into(),
        points,
        uncertainty: params.uncertainty,
        viewpoint: params.viewpoint.as_deref().map(parse_viewpoint).transpose()?,
        voxel_m: params.voxel_m,
        capture_time: None,
        depth: if is_image { Some(params.depth()?) } else { None },
        packed: if is_packed { Some(params.packed()?) } else { None },
        keep_clutter: params.keep_clutter.unwrap_or_default(),
    };
    Ok(v1::AddVisualPriorRequest {
        session_id: String::new(),
        prior: Some(prior),
        expected_revision: params.expected_revision,
        request_id: params.request_id.unwrap_or_default(),
        propose: params.propose.unwrap_or_default(),
    })
}

impl ViewParams {
    /// A parameter that only depth images have, if one is given.
    fn of_images(&self) -> Option<&'static str> {
        let given = [
            ("fx", self.fx.is_some()),
            ("fy", self.fy.is_some()),
            ("cx", self.cx.is_some()),
            ("cy", self.cy.is_some()),
            ("depth_scale_m", self.depth_scale_m.is_some()),
            ("base_from_camera", self.base_from_camera.is_some()),
            ("min_depth_m", self.min_depth_m.is_some()),
            ("max_depth_m", self.max_depth_m.is_some()),
        ];
        given.into_iter().find_map(|(name, is_given)| is_given.then_some(name))
    }

    /// A parameter that only packed points have, if one is given.
    fn of_packed_points(&self) -> Option<&'static str> {
        let given = [
            ("point_step", self.point_step.is_some()),
            ("x_offset", self.x_offset.is_some()),
            ("y_offset", self.y_offset.is_some()),
            ("z_offset", self.z_offset.is_some()),
            ("is_double", self.is_double.is_some()),
            ("is_bigendian", self.is_bigendian.is_some()),
            ("width", self.width.is_some()),
            ("row_step", self.row_step.is_some()),
        ];
        given.into_iter().find_map(|(name, is_given)| is_given.then_some(name))
    }

    fn depth(&self) -> Result<v1::DepthImage, Error> {
        Ok(v1::DepthImage {
            // The file says them.
            width: 0,
            height: 0,
            fx: needed("prior.depth.fx", self.fx)?,
            fy: needed("prior.depth.fy", self.fy)?,
            cx: needed("prior.depth.cx", self.cx)?,
            cy: needed("prior.depth.cy", self.cy)?,
            depth_scale_m: self.depth_scale_m.unwrap_or(0.001),
            base_from_camera: self.base_from_camera.as_deref().map(parse_pose).transpose()?,
            mask_u8: Bytes::new(),
            min_depth_m: self.min_depth_m.unwrap_or_default(),
            max_depth_m: self.max_depth_m.unwrap_or_default(),
        })
    }

    fn packed(&self) -> Result<v1::PackedPoints, Error> {
        Ok(v1::PackedPoints {
            point_step: needed("prior.packed.point_step", self.point_step)?,
            x_offset: needed("prior.packed.x_offset", self.x_offset)?,
            y_offset: needed("prior.packed.y_offset", self.y_offset)?,
            z_offset: needed("prior.packed.z_offset", self.z_offset)?,
            is_double: self.is_double.unwrap_or_default(),
            is_bigendian: self.is_bigendian.unwrap_or_default(),
            width: self.width.unwrap_or_default(),
            row_step: self.row_step.unwrap_or_default(),
        })
    }
}

fn needed<T>(field: &str, value: Option<T>) -> Result<T, Error> {
    value.ok_or_else(|| {
        let name = field.rsplit('.').next().unwrap_or_default();
        Error::field(field, format!("is missing: say it in the query, {name}=..."))
    })
}

/// Exactly `N` numbers between commas.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    numbers?.try_into().ok()
}

fn parse_viewpoint(text: &str) -> Result<v1::Vector3, Error> {
    match numbers(text) {
        Some([x, y, z]) => Ok(v1::Vector3 { x, y, z }),
        None => Err(Error::field("viewpoint", format!("{text:?} is not x,y,z in metres"))),
    }
}

fn parse_pose(text: &str) -> Result<v1::Pose, Error> {
    let Some([x, y, z, qx, qy, qz, qw]) = numbers(text) else {
        let description =
            format!("{text:?} is not x,y,z,qx,qy,qz,qw: a place in metres and a unit quaternion");
        return Err(Error::field("base_from_camera", description));
    };
    Ok(v1::Pose {
        position: Some(v1::Vector3 { x, y, z }),
        orientation: Some(v1::Quaternion { x: qx, y: qy, z: qz, w: qw }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_viewpoint_is_three_numbers_and_a_pose_seven() {
        assert_eq!(parse_viewpoint("0.5, -1,2e-1").unwrap(), v1::Vector3 { x: 0.5, y: -1.0, z: 0.2 });
        for bad in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,3,x"] {
            assert_eq!(parse_viewpoint(bad).unwrap_err().fields()[0].field, "viewpoint", "{bad}");
            assert_eq!(parse_pose(bad).unwrap_err().fields()[0].field, "base_from_camera", "{bad}");
        }
        let pose = parse_pose("1,2,3,0,0,0.6,0.8").unwrap();
        assert_eq!(pose.orientation.unwrap(), v1::Quaternion { x: 0.0, y: 0.0, z: 0.6, w: 0.8 });
    }

    #[test]
    fn parameters_that_are_missing_or_of_another_kind_of_file_are_named() {
        let field =
            |encoding, params| request(encoding, Bytes::new(), params).unwrap_err().fields()[0].field.clone();
        let fx = || ViewParams { fx: Some(600.0), ..ViewParams::default() };
        assert_eq!(field(v1::PointEncoding::Ply, fx()), "fx");
        assert_eq!(field(v1::PointEncoding::DepthPng, fx()), "prior.depth.fy");
        let stepped = || ViewParams { point_step: Some(16), ..ViewParams::default() };
        assert_eq!(encoding("application/octet-stream", &stepped()), Some(v1::PointEncoding::Packed));
        assert_eq!(field(v1::PointEncoding::Packed, stepped()), "prior.packed.x_offset");
        assert_eq!(field(v1::PointEncoding::Pcd, stepped()), "point_step");
        let offset = ViewParams { z_offset: Some(16), ..ViewParams::default() };
        assert_eq!(field(v1::PointEncoding::XyzF32Le, offset), "z_offset");
    }
}
