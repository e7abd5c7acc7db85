//! `sensor_msgs/Image` and `CameraInfo` to a depth image of the contract.
//!
//! REP 118: `16UC1` is millimetres with 0 for no measurement, `32FC1` is metres with NaN for none. The server takes 16-bit
//! values, so metres become tenths of a millimetre; what is farther than 6.5 m is no object within reach of an arm.
//! The image is taken as rectified, so its lens is P; K where P is not set. Binning and regions are reckoned in.

use palpate_client::proto::v1;

use crate::messages::{CameraInfo, Image};

/// Metres in one unit of `16UC1`.
const MILLIMETRE_M: f64 = 0.001;
/// Metres in one unit of what is made of `32FC1`.
const TENTH_MILLIMETRE_M: f64 = 0.0001;

/// A depth image with its camera, where the camera is not yet known in the session's frame.
///
/// # Errors
/// Names the message and its field that is wrong, and what would be right.
pub fn read(image: &Image, camera: &CameraInfo) -> Result<(Vec<u8>, v1::DepthImage), String> {
    let lens = Lens::of(camera)?;
    let (width, height) = (image.width, image.height);
    if (lens.width, lens.height) != (width, height) {
        return Err(format!(
            "the image has {width} x {height} pixels, and camera_info is for {} x {}: they are of different cameras",
            lens.width, lens.height
        ));
    }
    let (bytes_per_pixel, depth_scale_m) = match image.encoding.as_str() {
        "16UC1" => (2, MILLIMETRE_M),
        "32FC1" => (4, TENTH_MILLIMETRE_M),
        "mono16" => {
            return Err("encoding mono16 is brightness and not depth: give the depth image, 16UC1 in mm or 32FC1 in m".to_owned());
        }
        other => return Err(format!("encoding {other:?} is no depth: give 16UC1 in mm, or 32FC1 in m")),
    };
    let row_bytes = width as usize * bytes_per_pixel;
    let step = if image.step == 0 { row_bytes } else { image.step as usize };
    let needed = (height as usize - 1).checked_mul(step).and_then(|bytes| bytes.checked_add(row_bytes));
    if step < row_bytes || needed.is_none_or(|needed| image.data.len() < needed) {
        return Err(format!(
            "data has {} bytes with a step of {step}, too few for {height} rows of {row_bytes} bytes",
            image.data.len()
        ));
    }
    let is_bigendian = image.is_bigendian != 0;
    let rows = image.data.chunks(step).take(height as usize).map(|row| &row[..row_bytes]);
    let values: Vec<u8> = match bytes_per_pixel {
        2 => rows
            .flat_map(|row| row.as_chunks::<2>().0)
            .flat_map(|&pixel| {
                if is_bigendian { u16::from_be_bytes(pixel) } else { u16::from_le_bytes(pixel) }.to_le_bytes()
            })
            .collect(),
        _ => rows
            .flat_map(|row| row.as_chunks::<4>().0)
            .flat_map(|&pixel| {
                let depth_m =
                    if is_bigendian { f32::from_be_bytes(pixel) } else { f32::from_le_bytes(pixel) };
                tenths_of_mm(depth_m).to_le_bytes()
            })
            .collect(),
    };
    let depth = v1::DepthImage {
        width,
        height,
        fx: lens.fx,
        fy: lens.fy,
        cx: lens.cx,
        cy: lens.cy,
        depth_scale_m,
        ..Default::default()
    };
    Ok((values, depth))
}

/// A depth in tenths of a millimetre; 0, no measurement, for what is none or does not fit.
fn tenths_of_mm(depth_m: f32) -> u16 {
    let units = (f64::from(depth_m) / TENTH_MILLIMETRE_M).round();
    if (1.0..=f64::from(u16::MAX)).contains(&units) { units as u16 } else { 0 }
}

/// The lens for the pixels that are in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Lens {
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
}

impl Lens {
    fn of(camera: &CameraInfo) -> Result<Self, String> {
        let (k, p) = (&camera.k, &camera.p);
        let [fx, fy, cx, cy] = if p[0] != 0.0 { [p[0], p[5], p[2], p[6]] } else { [k[0], k[4], k[2], k[5]] };
        if !(fx > 0.0 && fy > 0.0 && [fx, fy, cx, cy].iter().all(|part| part.is_finite())) {
            return Err("camera_info has no focal length in P or K: calibrate the camera".to_owned());
        }
        let roi = camera.roi;
        let (full_width, full_height) = if roi.width == 0 || roi.height == 0 {
            (camera.width, camera.height)
        } else {
            (roi.width, roi.height)
        };
        let (bin_x, bin_y) = (camera.binning_x.max(1), camera.binning_y.max(1));
        let (width, height) = (full_width / bin_x, full_height / bin_y);
        if width == 0 || height == 0 {
            return Err("camera_info has no width or height: set them to those of the image".to_owned());
        }
        let (bin_x, bin_y) = (f64::from(bin_x), f64::from(bin_y));
        Ok(Self {
            width,
            height,
            fx: fx / bin_x,
            fy: fy / bin_y,
            cx: (cx - f64::from(roi.x_offset)) / bin_x,
            cy: (cy - f64::from(roi.y_offset)) / bin_y,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::RegionOfInterest;

    fn camera() -> CameraInfo {
        let mut camera = CameraInfo { width: 3, height: 2, ..CameraInfo::default() };
        camera.k = [500.0, 0.0, 1.5, 0.0, 510.0, 0.5, 0.0, 0.0, 1.0];
        camera
    }

    /// 3 x 2 pixels of 1, 2, ... 6 units, with three bytes after each row.
    fn image(encoding: &str, is_bigendian: bool, pixel: impl Fn(u16) -> Vec<u8>) -> Image {
        let mut data = Vec::new();
        for row in 0..2 {
            (1..=3).for_each(|column| data.extend(pixel(3 * row + column)));
            data.extend([0xff; 3]);
        }
        let step = data.len() as u32 / 2;
        let encoding = encoding.to_owned();
        Image {
            width: 3,
            height: 2,
            encoding,
            is_bigendian: is_bigendian.into(),
            step,
            data,
            ..Image::default()
        }
    }

    fn values(image: &Image) -> (Vec<u16>, f64) {
        let (bytes, depth) = read(image, &camera()).unwrap();
        let values = bytes.as_chunks::<2>().0.iter().map(|&pair| u16::from_le_bytes(pair)).collect();
        (values, depth.depth_scale_m)
    }

    #[test]
    fn millimetres_in_either_byte_order_with_padded_rows_are_kept() {
        let expected = (vec![1, 2, 3, 4, 5, 6], 0.001);
        assert_eq!(values(&image("16UC1", false, |mm| mm.to_le_bytes().to_vec())), expected);
        assert_eq!(values(&image("16UC1", true, |mm| mm.to_be_bytes().to_vec())), expected);
    }

    #[test]
    fn metres_become_tenths_of_a_millimetre_and_what_is_none_becomes_zero() {
        let metres = |at: u16| [0.5, f32::NAN, 0.123_44, 9.0, -1.0, f32::INFINITY][usize::from(at) - 1];
        let expected = (vec![5000, 0, 1234, 0, 0, 0], 0.0001);
        assert_eq!(values(&image("32FC1", false, |at| metres(at).to_le_bytes().to_vec())), expected);
        assert_eq!(values(&image("32FC1", true, |at| metres(at).to_be_bytes().to_vec())), expected);
    }

    #[test]
    fn the_lens_is_p_and_k_where_p_is_not_set() {
        assert_eq!(Lens::of(&camera()).unwrap().fy, 510.0);
        let mut rectified = camera();
        rectified.p = [400.0, 0.0, 1.0, 0.0, 0.0, 410.0, 0.25, 0.0, 0.0, 0.0, 1.0, 0.0];
        let lens = Lens::of(&rectified).unwrap();
        assert_eq!([lens.fx, lens.fy, lens.cx, lens.cy], [400.0, 410.0, 1.0, 0.25]);
        let error = Lens::of(&CameraInfo { width: 3, height: 2, ..CameraInfo::default() }).unwrap_err();
        assert!(error.contains("calibrate"), "{error}");
    }

    #[test]
    fn binning_and_a_region_move_and_shrink_the_lens() {
        let mut camera = camera();
        (camera.width, camera.height, camera.binning_x, camera.binning_y) = (640, 480, 2, 2);
        camera.roi =
            RegionOfInterest { x_offset: 100, y_offset: 40, width: 320, height: 240, do_rectify: false };
        let lens = Lens::of(&camera).unwrap();
        assert_eq!((lens.width, lens.height), (160, 120));
        assert_eq!([lens.fx, lens.cx, lens.cy], [250.0, -49.25, -19.75]);
    }

    #[test]
    fn what_is_no_depth_is_refused_in_words_that_say_what_is() {
        let refused = |image: &Image| read(image, &camera()).unwrap_err();
        let bright = image("mono16", false, |mm| mm.to_le_bytes().to_vec());
        assert!(refused(&bright).contains("mono16 is brightness"));
        assert!(refused(&image("rgb8", false, |_| vec![0; 3])).contains("\"rgb8\""));
        let mut cut = image("16UC1", false, |mm| mm.to_le_bytes().to_vec());
        cut.data.truncate(14);
        assert!(refused(&cut).starts_with("data has 14 bytes"));
        let mut other = image("16UC1", false, |mm| mm.to_le_bytes().to_vec());
        other.width = 2;
        assert!(refused(&other).contains("2 x 2 pixels, and camera_info is for 3 x 2"));
    }
}
