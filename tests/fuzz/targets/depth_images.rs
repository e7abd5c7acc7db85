//! Depth images, as PNG files and as plain values, from cameras of any kind.

#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use palpate_fuzz::assert_sound_view;
use palpate_proto::v1;

/// How an image was taken, and the image.
#[derive(Arbitrary, Debug)]
struct Image<'a> {
    is_png: bool,
    keep_clutter: bool,
    /// How many pixels a mask is for, and how many are left out between two of them.
    mask: Option<(u16, u8)>,
    size: [u16; 2],
    focal_lengths: [f64; 2],
    principal_point: [f64; 2],
    scale_m: f64,
    range_m: [f64; 2],
    pose: [f64; 3],
    values: &'a [u8],
}

fuzz_target!(|image: Image| {
    let [width, height] = image.size.map(u32::from);
    let [fx, fy] = image.focal_lengths;
    let [cx, cy] = image.principal_point;
    let [x, y, z] = image.pose;
    let mask = image.mask.map(|(count, every)| {
        (0..count).map(|place| u8::from(place % (u16::from(every) + 1) == 0)).collect::<Vec<u8>>()
    });
    let pose = v1::Pose {
        position: Some(v1::Vector3 { x, y, z }),
        orientation: Some(v1::Quaternion { x: 1.0, ..Default::default() }),
    };
    let encoding = if image.is_png { v1::PointEncoding::DepthPng } else { v1::PointEncoding::DepthU16 };
    assert_sound_view(&v1::VisualPrior {
        encoding: encoding.into(),
        points: image.values.to_vec().into(),
        depth: Some(v1::DepthImage {
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            depth_scale_m: image.scale_m,
            base_from_camera: Some(pose),
            mask_u8: mask.unwrap_or_default().into(),
            min_depth_m: image.range_m[0],
            max_depth_m: image.range_m[1],
        }),
        keep_clutter: image.keep_clutter,
        ..Default::default()
    });
});
