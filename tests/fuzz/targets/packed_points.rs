//! Clouds as packed points of a declared layout, and as plain triples of `f32`.

#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use palpate_fuzz::assert_sound_view;
use palpate_proto::v1;

/// What a caller declares of an array, and the array.
#[derive(Arbitrary, Debug)]
struct Packed<'a> {
    is_declared: bool,
    is_double: bool,
    is_bigendian: bool,
    keep_clutter: bool,
    point_step: u32,
    offsets: [u32; 3],
    width: u32,
    row_step: u32,
    voxel_m: Option<f64>,
    points: &'a [u8],
}

fuzz_target!(|packed: Packed| {
    let [x_offset, y_offset, z_offset] = packed.offsets;
    let layout = v1::PackedPoints {
        point_step: packed.point_step,
        x_offset,
        y_offset,
        z_offset,
        is_double: packed.is_double,
        is_bigendian: packed.is_bigendian,
        width: packed.width,
        row_step: packed.row_step,
    };
    let encoding = if packed.is_declared { v1::PointEncoding::Packed } else { v1::PointEncoding::XyzF32Le };
    assert_sound_view(&v1::VisualPrior {
        encoding: encoding.into(),
        points: packed.points.to_vec().into(),
        packed: packed.is_declared.then_some(layout),
        voxel_m: packed.voxel_m,
        keep_clutter: packed.keep_clutter,
        ..Default::default()
    });
});
