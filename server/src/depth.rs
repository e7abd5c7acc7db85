//! A depth camera's image as points: what each pixel saw, put into the session's frame by the camera's pose.

mod edges;
mod png;
mod values;

use palpate_core::error::FieldError;
use palpate_core::geometry::{Point, Pose};

pub(crate) use values::Encoding;

use crate::mesh_format::Cloud;
use values::Values;

/// Where the optical centre is and how long the lens, in pixels; the centre of the top left pixel is (0, 0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Intrinsics {
    pub(crate) fx: f64,
    pub(crate) fy: f64,
    pub(crate) cx: f64,
    pub(crate) cy: f64,
}

/// How a depth image was taken, and which of its pixels are wanted.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DepthImage<'a> {
    /// Columns and rows; 0 where a file says it.
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) intrinsics: Intrinsics,
    /// Metres per stored unit, > 0.
    pub(crate) scale_m: f64,
    /// The optical frame has x right, y down and z forward.
    pub(crate) base_from_camera: Pose,
    /// One byte for each pixel, not 0 where the object is; empty for the whole image.
    pub(crate) mask: &'a [u8],
    /// Nearest and farthest wanted depth along the optical axis, in metres.
    pub(crate) range_m: [f64; 2],
    /// Keep pixels at depth edges.
    pub(crate) keep_flying: bool,
}

/// Reads the image in `bytes` and projects its pixels back.
///
/// # Errors
/// Bytes that are no such image, or a mask of another size; the error names the field.
pub(crate) fn read(image: &DepthImage, encoding: Encoding, bytes: &[u8]) -> Result<Cloud, FieldError> {
    let values = Values::read(encoding, image.width, image.height, bytes)?;
    if !image.mask.is_empty() && image.mask.len() != values.width * values.height {
        let reason = format!(
            "{} bytes are not one for each of {} x {} pixels",
            image.mask.len(),
            values.width,
            values.height
        );
        return Err(FieldError::invalid("depth.mask_u8", reason));
    }
    let (points, flying) = back_project(image, &values);
    if points.is_empty() {
        let reason = format!(
            "none of {} x {} pixels has a depth where the mask and the range allow one, {flying} at depth edges not counted",
            values.width, values.height
        );
        return Err(FieldError::invalid("points", reason));
    }
    let viewpoint = Some(Point::from(image.base_from_camera.translation.vector));
    Ok(Cloud { points, viewpoint, non_finite: 0, flying })
}

/// The points of the wanted pixels, and how many lie at a depth edge.
fn back_project(image: &DepthImage, values: &Values) -> (Vec<Point>, usize) {
    let Intrinsics { fx, fy, cx, cy } = image.intrinsics;
    let [nearest_m, farthest_m] = image.range_m;
    let edges = edges::Edges::new(&image.intrinsics, image.scale_m);
    let (mut points, mut flying) = (Vec::new(), 0);
    for row in 0..values.height {
        for column in 0..values.width {
            let depth_m = image.scale_m * f64::from(values.at(column, row));
            let is_wanted = image.mask.get(row * values.width + column).is_none_or(|&mask| mask != 0);
            if depth_m == 0.0 || !is_wanted || depth_m < nearest_m || depth_m > farthest_m {
                continue;
            }
            if !image.keep_flying && edges.is_at(values, column, row) {
                flying += 1;
                continue;
            }
            let in_camera =
                Point::new((column as f64 - cx) / fx * depth_m, (row as f64 - cy) / fy * depth_m, depth_m);
            points.push(image.base_from_camera * in_camera);
        }
    }
    (points, flying)
}

#[cfg(test)]
mod tests;
