//! Clouds as files: PLY after an even first byte, PCD after an odd one.

#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_fuzz::assert_sound_view;
use palpate_proto::v1;

fuzz_target!(|bytes: &[u8]| {
    let [kind, file @ ..] = bytes else { return };
    let encoding = if kind % 2 == 0 { v1::PointEncoding::Ply } else { v1::PointEncoding::Pcd };
    assert_sound_view(&v1::VisualPrior {
        encoding: encoding.into(),
        points: file.to_vec().into(),
        ..Default::default()
    });
});
