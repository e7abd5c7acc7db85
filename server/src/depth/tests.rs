//! An analytic scene, a ball in front of a plane, as a depth camera stores it.

use nalgebra::{Translation3, UnitQuaternion};
use palpate_core::geometry::Vector;

use super::*;

const WIDTH: usize = 160;
const HEIGHT: usize = 120;
const BALL_RADIUS_M: f64 = 0.04;
const BALL_DEPTH_M: f64 = 0.5;
const PLANE_DEPTH_M: f64 = 0.62;
const SCALE_M: f64 = 0.0005;
/// Rays through each pixel, in both directions.
const RAYS: usize = 6;

fn intrinsics() -> Intrinsics {
    Intrinsics { fx: 610.0, fy: 600.0, cx: 79.3, cy: 60.2 }
}

/// A camera that stands askew.
fn pose() -> Pose {
    let rotation = UnitQuaternion::from_euler_angles(2.9, 0.2, -0.4);
    Pose::from_parts(Translation3::new(0.3, -0.1, 0.7), rotation)
}

fn whole() -> DepthImage<'static> {
    DepthImage {
        width: WIDTH,
        height: HEIGHT,
        intrinsics: intrinsics(),
        scale_m: SCALE_M,
        base_from_camera: pose(),
        mask: &[],
        range_m: [0.0, f64::INFINITY],
        keep_flying: false,
    }
}

/// The depth along the optical axis that a ray sees, and whether it is the ball's.
fn ray(column: f64, row: f64) -> (f64, bool) {
    let Intrinsics { fx, fy, cx, cy } = intrinsics();
    let direction = Vector::new((column - cx) / fx, (row - cy) / fy, 1.0);
    let center = Vector::new(0.0, 0.0, BALL_DEPTH_M);
    let (a, b) = (direction.norm_squared(), direction.dot(&center));
    let root = b * b - a * (center.norm_squared() - BALL_RADIUS_M * BALL_RADIUS_M);
    if root >= 0.0 { ((b - root.sqrt()) / a, true) } else { (PLANE_DEPTH_M, false) }
}

/// What a pixel is in truth.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Seen {
    Ball,
    Plane,
    /// Part of its rays meet the ball and part the plane; its depth is their mean.
    Mixed,
}

fn render() -> (Vec<u8>, Vec<Seen>) {
    let (mut bytes, mut truth) = (Vec::new(), Vec::new());
    for (row, column) in (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |column| (row, column))) {
        let part = |i: usize| (i as f64 + 0.5) / RAYS as f64 - 0.5;
        let rays = (0..RAYS * RAYS)
            .map(|i| ray(column as f64 + part(i % RAYS), row as f64 + part(i / RAYS)))
            .collect::<Vec<_>>();
        let on_ball = rays.iter().filter(|(_, on_ball)| *on_ball).count();
        let depth_m = rays.iter().map(|(depth_m, _)| depth_m).sum::<f64>() / rays.len() as f64;
        bytes.extend(((depth_m / SCALE_M).round() as u16).to_le_bytes());
        truth.push(match on_ball {
            0 => Seen::Plane,
            all if all == rays.len() => Seen::Ball,
            _ => Seen::Mixed,
        });
    }
    (bytes, truth)
}

/// The distance of a point from the ball's surface and from the plane, in metres.
fn distances(point: &Point) -> (f64, f64) {
    let in_camera = pose().inverse() * point;
    let from_center = (in_camera - Point::new(0.0, 0.0, BALL_DEPTH_M)).norm();
    ((from_center - BALL_RADIUS_M).abs(), (in_camera.z - PLANE_DEPTH_M).abs())
}

#[test]
fn every_mixed_pixel_goes_and_of_the_true_ones_a_rim_of_two_at_most() {
    let (bytes, truth) = render();
    let values = Values::read(Encoding::U16Le, WIDTH, HEIGHT, &bytes).unwrap();
    let edges = edges::Edges::new(&intrinsics(), SCALE_M);
    let (mut mixed, mut ball, mut lost) = (0, 0, 0);
    let is_mixed = |column: usize, row: usize| truth[row * WIDTH + column] == Seen::Mixed;
    for (row, column) in (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |column| (row, column))) {
        let is_dropped = edges.is_at(&values, column, row);
        match truth[row * WIDTH + column] {
            Seen::Mixed => {
                mixed += 1;
                assert!(is_dropped, "({column}, {row}) hangs between ball and plane");
            }
            seen => {
                ball += usize::from(seen == Seen::Ball);
                lost += usize::from(seen == Seen::Ball && is_dropped);
                let near = (row.saturating_sub(2)..=row + 2).any(|row| {
                    let columns = column.saturating_sub(2)..=column + 2;
                    row < HEIGHT && columns.into_iter().any(|column| column < WIDTH && is_mixed(column, row))
                });
                assert!(!is_dropped || near, "({column}, {row}) is not at the silhouette");
            }
        }
    }
    assert!(mixed > 200, "{mixed} mixed pixels are worth a test");
    assert!(lost * 20 < 3 * ball, "{lost} of {ball} pixels of the ball are lost");
}

#[test]
fn what_is_left_lies_on_the_surfaces_in_the_sessions_frame() {
    let (bytes, _) = render();
    let cloud = read(&whole(), Encoding::U16Le, &bytes).unwrap();
    assert_eq!(cloud.points.len() + cloud.flying, WIDTH * HEIGHT);
    assert_eq!(cloud.viewpoint, Some(Point::new(0.3, -0.1, 0.7)));
    for point in &cloud.points {
        let (from_ball, from_plane) = distances(point);
        assert!(from_ball.min(from_plane) < 0.001, "{from_ball} and {from_plane}");
    }
    let kept = read(&DepthImage { keep_flying: true, ..whole() }, Encoding::U16Le, &bytes).unwrap();
    assert_eq!((kept.points.len(), kept.flying), (WIDTH * HEIGHT, 0));
    let astray = kept.points.iter().map(distances).filter(|(ball, plane)| ball.min(*plane) > 0.005).count();
    assert!(astray > 100, "{astray} pixels would hang in the air");
}

#[test]
fn mask_and_range_choose_pixels_but_edges_are_seen_beyond_them() {
    let (bytes, truth) = render();
    let mask: Vec<u8> = truth.iter().map(|seen| if *seen == Seen::Plane { 0 } else { 200 }).collect();
    let masked = read(&DepthImage { mask: &mask, ..whole() }, Encoding::U16Le, &bytes).unwrap();
    let ranged = read(&DepthImage { range_m: [0.3, 0.55], ..whole() }, Encoding::U16Le, &bytes).unwrap();
    for cloud in [masked, ranged] {
        assert!(cloud.points.len() > 4000 && cloud.flying > 200, "{}", cloud.flying);
        assert!(cloud.points.iter().all(|point| distances(point).0 < 0.001), "the rim of the mask is gone");
    }
    let beyond = DepthImage { range_m: [2.0, 3.0], ..whole() };
    assert_eq!(read(&beyond, Encoding::U16Le, &bytes).unwrap_err().field, "points");
    let wrong = DepthImage { mask: &mask[1..], ..whole() };
    assert_eq!(read(&wrong, Encoding::U16Le, &bytes).unwrap_err().field, "depth.mask_u8");
}

#[test]
fn a_plane_that_is_slanted_by_79_degrees_has_no_edges_and_a_step_has() {
    let depth = |slope: f64, column: f64| 1.0 / (1.0 / BALL_DEPTH_M - slope * (column - 80.0));
    // Along a plane the inverse depth is linear; straight ahead its slope is the slant's tangent over f z.
    let slope = 79_f64.to_radians().tan() / 610.0 / BALL_DEPTH_M;
    let image = |depth_m: &dyn Fn(f64) -> f64| -> Values {
        let row: Vec<u8> = (70..90)
            .flat_map(|column| ((depth_m(f64::from(column)) / 0.0001).round() as u16).to_le_bytes())
            .collect();
        Values::read(Encoding::U16Le, 20, 10, &row.repeat(10)).unwrap()
    };
    let edges = edges::Edges::new(&intrinsics(), 0.0001);
    let slanted = image(&|column| depth(slope, column));
    assert!((0..20).all(|column| !edges.is_at(&slanted, column, 5)));
    let stepped = image(&|column| if column < 80.0 { 0.5 } else { 0.506 });
    let at_step: Vec<usize> = (0..20).filter(|&column| edges.is_at(&stepped, column, 5)).collect();
    assert_eq!(at_step, [9, 10]);
    let noisy = image(&|column| 0.1 + if column % 2.0 == 0.0 { 0.0 } else { 0.0018 });
    assert!((0..20).all(|column| !edges.is_at(&noisy, column, 0)), "noise at short range is no edge");
}

#[test]
fn where_nothing_was_measured_there_is_neither_a_point_nor_an_edge() {
    let row = [0_u16, 1000, 1000, 0].map(u16::to_le_bytes).concat();
    let image = DepthImage { width: 4, height: 4, ..whole() };
    let cloud = read(&image, Encoding::U16Le, &row.repeat(4)).unwrap();
    assert_eq!((cloud.points.len(), cloud.flying), (8, 0));
}

fn png(width: u32, height: u32, color: ::png::ColorType, depth: ::png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut file, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    file
}

/// The scene as a PNG file, which has the most significant byte first.
fn scene_png() -> Vec<u8> {
    let mut data = render().0;
    data.as_chunks_mut::<2>().0.iter_mut().for_each(|pair| pair.reverse());
    png(WIDTH as u32, HEIGHT as u32, ::png::ColorType::Grayscale, ::png::BitDepth::Sixteen, &data)
}

#[test]
fn a_png_file_is_the_same_image_and_says_its_size() {
    let raw = read(&whole(), Encoding::U16Le, &render().0).unwrap();
    let file = scene_png();
    assert_eq!(read(&whole(), Encoding::Png, &file).unwrap(), raw);
    assert_eq!(read(&DepthImage { width: 0, height: 0, ..whole() }, Encoding::Png, &file).unwrap(), raw);
    let other = DepthImage { height: 121, ..whole() };
    assert_eq!(read(&other, Encoding::Png, &file).unwrap_err().field, "depth.height");
}

#[test]
fn pictures_and_damaged_files_are_refused_and_never_a_panic() {
    use ::png::{BitDepth, ColorType};
    for (color, depth, bytes) in [
        (ColorType::Grayscale, BitDepth::Eight, 4),
        (ColorType::Rgb, BitDepth::Eight, 12),
        (ColorType::Rgb, BitDepth::Sixteen, 24),
        (ColorType::Grayscale, BitDepth::One, 2),
    ] {
        let file = png(2, 2, color, depth, &vec![0; bytes]);
        let image = DepthImage { width: 0, height: 0, ..whole() };
        let error = read(&image, Encoding::Png, &file).unwrap_err();
        assert!(error.field == "points" && error.reason.contains("greyscale of 16 bits"), "{}", error.reason);
    }
    let tiny = DepthImage { width: 0, height: 0, keep_flying: true, ..whole() };
    let data: Vec<u8> = (1..=32).collect();
    let file = png(4, 4, ColorType::Grayscale, BitDepth::Sixteen, &data);
    assert_eq!(read(&tiny, Encoding::Png, &file).unwrap().points.len(), 16);
    for length in 0..file.len() - 16 {
        assert!(read(&tiny, Encoding::Png, &file[..length]).is_err(), "cut to {length} bytes");
    }
    for index in 0..file.len() {
        for flip in [0x01, 0x15, 0x80, 0xff] {
            let mut damaged = file.clone();
            damaged[index] ^= flip;
            let _ = read(&tiny, Encoding::Png, &damaged);
        }
    }
}

#[test]
fn a_size_that_is_missing_wrong_or_over_the_limit_is_refused_by_name() {
    let field = |width, height, bytes: &[u8]| {
        read(&DepthImage { width, height, ..whole() }, Encoding::U16Le, bytes).unwrap_err().field
    };
    assert_eq!(field(0, 4, &[]), "depth.width");
    assert_eq!(field(4, 0, &[]), "depth.height");
    assert_eq!(field(4, 4, &[0; 31]), "points");
    assert_eq!(field(usize::MAX, 2, &[]), "depth.width");
    assert_eq!(field(2049, 2048, &[]), "depth.width");
    // A file that declares a huge image is refused before memory is taken for it.
    let mut file = png(1, 1, ::png::ColorType::Grayscale, ::png::BitDepth::Sixteen, &[0, 1]);
    file[16..24].copy_from_slice(&[0, 0, 0x80, 0, 0, 0, 0x80, 0]);
    let crc = crc32(&file[12..29]);
    file[29..33].copy_from_slice(&crc.to_be_bytes());
    let image = DepthImage { width: 0, height: 0, ..whole() };
    let error = read(&image, Encoding::Png, &file).unwrap_err();
    assert_eq!(error.field, "depth.width", "{}", error.reason);
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    })
}
