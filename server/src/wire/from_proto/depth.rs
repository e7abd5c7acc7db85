//! How a depth image was taken.

use palpate_proto::v1;

use super::geometry::pose;
use super::non_finite;
use crate::depth::{DepthImage, Intrinsics};
use crate::error::Error;

/// Beyond any lens and any image, in pixels.
const MOST_PIXELS: f64 = 1e6;

/// # Errors
/// A field that is missing or impossible.
pub(super) fn depth_image<'a>(
    path: &str,
    image: &'a v1::DepthImage,
    keep_flying: bool,
) -> Result<DepthImage<'a>, Error> {
    let &v1::DepthImage {
        width,
        height,
        fx,
        fy,
        cx,
        cy,
        depth_scale_m,
        ref base_from_camera,
        ref mask_u8,
        min_depth_m,
        max_depth_m,
    } = image;
    let intrinsics = Intrinsics {
        fx: number(path, "fx", fx, focal_length)?,
        fy: number(path, "fy", fy, focal_length)?,
        cx: number(path, "cx", cx, principal_point)?,
        cy: number(path, "cy", cy, principal_point)?,
    };
    let scale_m = number(path, "depth_scale_m", depth_scale_m, scale)?;
    let nearest_m = number(path, "min_depth_m", min_depth_m, depth)?;
    // Zero is no bound.
    let farthest_m = match number(path, "max_depth_m", max_depth_m, depth)? {
        0.0 => f64::INFINITY,
        farthest_m => farthest_m,
    };
    if nearest_m > farthest_m {
        let description = format!("{farthest_m} m is below min_depth_m, {nearest_m} m");
        return Err(Error::field(format!("{path}.max_depth_m"), description));
    }
    Ok(DepthImage {
        width: width as usize,
        height: height as usize,
        intrinsics,
        scale_m,
        base_from_camera: pose(&format!("{path}.base_from_camera"), base_from_camera.as_ref())?,
        mask: mask_u8,
        range_m: [nearest_m, farthest_m],
        keep_flying,
    })
}

/// The number, unless `wrong` says what would be right.
fn number(path: &str, name: &str, value: f64, wrong: fn(f64) -> Option<&'static str>) -> Result<f64, Error> {
    let field = format!("{path}.{name}");
    if !value.is_finite() {
        return Err(non_finite(field, format!("{value} is not finite")));
    }
    match wrong(value) {
        None => Ok(value),
        // An unset number is 0, and none of those that are refused is one.
        Some(right) if value == 0.0 => Err(Error::field(field, format!("is missing or 0: say {right}"))),
        Some(right) => Err(Error::field(field, format!("{value} is not {right}"))),
    }
}

fn focal_length(pixels: f64) -> Option<&'static str> {
    let is_fine = pixels > 0.0 && pixels <= MOST_PIXELS;
    (!is_fine).then_some("a focal length between 0 and 1,000,000 pixels")
}

/// It may lie outside of an image that was cut out of a larger one. That it is exactly 0 is a field that was forgotten,
/// and would turn all that was seen.
fn principal_point(pixels: f64) -> Option<&'static str> {
    let is_fine = pixels != 0.0 && pixels.abs() <= MOST_PIXELS;
    (!is_fine).then_some("where the optical axis meets the image, in pixels, at most 1,000,000 from it")
}

fn scale(metres: f64) -> Option<&'static str> {
    let is_fine = metres > 0.0 && metres <= 1.0;
    (!is_fine).then_some("above 0 m and at most 1 m for a stored unit")
}

fn depth(metres: f64) -> Option<&'static str> {
    (metres < 0.0).then_some("a depth of 0 m or more")
}
