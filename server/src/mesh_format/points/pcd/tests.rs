//! PCD files as robots store them, and damaged ones.

use super::*;
use crate::mesh_format::points::lzf::tests::compress;

const HEADER: &str = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS rgb z normal x y\n\
                      SIZE 4 8 4 4 4\nTYPE U F F F F\nCOUNT 1 1 3 1 1\nWIDTH 3\nHEIGHT 1\n\
                      VIEWPOINT 0.5 0 0.6 1 0 0 0\nPOINTS 3\n";

fn expected() -> Vec<Point> {
    [0.25, 0.5, -0.75].map(|x| Point::new(x, 2.0 * x, x + 1.0)).to_vec()
}

/// The bytes of one field of a point.
fn field(point: &Point, name: &str) -> Vec<u8> {
    match name {
        "rgb" => vec![1, 2, 3, 4],
        "z" => point.z.to_le_bytes().to_vec(),
        "normal" => vec![0x7f; 12],
        "x" => (point.x as f32).to_le_bytes().to_vec(),
        _ => (point.y as f32).to_le_bytes().to_vec(),
    }
}

fn ascii() -> Vec<u8> {
    let rows = expected().into_iter().map(|point| format!("7 {} 0 0 nan {} {}\n", point.z, point.x, point.y));
    format!("{HEADER}DATA ascii\n{}", rows.collect::<String>()).into_bytes()
}

fn binary() -> Vec<u8> {
    let fields = ["rgb", "z", "normal", "x", "y"];
    let body = expected().into_iter().flat_map(|point| fields.map(|name| field(&point, name)).concat());
    format!("{HEADER}DATA binary\n").into_bytes().into_iter().chain(body).collect()
}

fn compressed() -> Vec<u8> {
    let column = |name: &str| expected().iter().flat_map(|point| field(point, name)).collect::<Vec<u8>>();
    let body = ["rgb", "z", "normal", "x", "y"].map(column).concat();
    let packed = compress(&body);
    let lengths = [packed.len(), body.len()].map(|length| (length as u32).to_le_bytes()).concat();
    [format!("{HEADER}DATA binary_compressed\n").into_bytes(), lengths, packed].concat()
}

#[test]
fn fields_in_any_order_are_read_from_text_binary_and_compressed_files() {
    for file in [ascii(), binary(), compressed()] {
        let pcd = read(&file).unwrap();
        assert_eq!(pcd, Pcd { points: expected(), viewpoint: Some(Point::new(0.5, 0.0, 0.6)) });
    }
    let text = String::from_utf8(ascii()).unwrap();
    assert_eq!(read(text.replace('\n', "\r\n").as_bytes()).unwrap().points, expected());
}

#[test]
fn an_old_file_needs_neither_count_nor_points_nor_viewpoint() {
    let file = "COLUMNS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nDATA ascii\n1 2 3 nan nan nan";
    let pcd = read(file.as_bytes()).unwrap();
    assert_eq!((pcd.points[0], pcd.points.len(), pcd.viewpoint), (Point::new(1.0, 2.0, 3.0), 2, None));
}

#[test]
fn the_identity_says_nothing_of_where_the_camera_was() {
    let seen_from = |numbers: &str| {
        let file = String::from_utf8(ascii()).unwrap().replace("0.5 0 0.6 1 0 0 0", numbers);
        read(file.as_bytes()).map(|pcd| pcd.viewpoint)
    };
    assert_eq!(seen_from("0 0 0 1 0 0 0"), Ok(None));
    assert_eq!(seen_from("0 0 0 0 1 0 0"), Ok(Some(Point::origin())), "turned, so somebody set it");
    assert_eq!(seen_from("nan nan nan 1 0 0 0"), Ok(None));
    assert!(seen_from("1 2 3").unwrap_err().contains("7 numbers"));
}

#[test]
fn every_truncation_and_every_flipped_byte_gives_an_answer() {
    for file in [ascii(), binary(), compressed()] {
        // The last word and its end may be shorter: it is a number still.
        let whole = if file == ascii() { file.len() - 3 } else { file.len() };
        for length in 0..file.len() {
            assert_eq!(read(&file[..length]).is_ok(), length >= whole, "cut to {length} of {}", file.len());
        }
        for index in 0..file.len() {
            for flip in [0x01, 0x15, 0x80, 0xff] {
                let mut damaged = file.clone();
                damaged[index] ^= flip;
                let _ = read(&damaged);
            }
        }
    }
}

fn refused(file: &str, from: &str, to: &str) -> String {
    assert!(file.contains(from), "{from}");
    read(file.replacen(from, to, 1).as_bytes()).unwrap_err()
}

#[test]
fn what_the_header_cannot_mean_is_refused_in_words() {
    let text = String::from_utf8(ascii()).unwrap();
    assert!(refused(&text, "POINTS 3", "POINTS 4").contains("WIDTH * HEIGHT is 3"));
    assert!(refused(&text, "rgb z", "rgb w").contains("a field 'z'"));
    assert!(refused(&text, "TYPE U F", "TYPE U I").contains("a field 'z' of TYPE F"));
    assert!(refused(&text, "SIZE 4 8", "SIZE 4 16").contains("line 4"));
    assert!(refused(&text, "SIZE 4 8", "SIZE 8").contains("5 FIELDS"));
    assert!(refused(&text, "SIZE 4 8 4 4 4\n", "").contains("a field 'x'"));
    assert!(refused(&text, "DATA ascii", "DATA zip").contains("DATA zip"));
    assert!(refused(&text, "1.25", "1,25").contains("line 12: 1,25 is a number with a comma"));
    assert!(read(b"ply\n").unwrap_err().contains("no PCD header"));
    let many = format!("FIELDS{}\n", " f".repeat(300));
    assert!(read(many.as_bytes()).unwrap_err().contains("256 fields"));
}

#[test]
fn counts_beyond_the_bytes_are_refused_before_anything_is_read() {
    for data in ["ascii", "binary", "binary_compressed"] {
        for count in ["1000", "4000000000", "18446744073709551615"] {
            let file = format!(
                "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nPOINTS {count}\nDATA {data}\n1 2 3 4 5 6"
            );
            let reason = read(file.as_bytes()).unwrap_err();
            assert!(reason.contains("bytes"), "{reason}");
        }
    }
    let file = "FIELDS x y z w\nSIZE 4 4 4 8\nTYPE F F F F\nCOUNT 1 1 1 30000000\nWIDTH 2000000000\nDATA ascii\n1 2 3 4";
    assert!(read(file.as_bytes()).unwrap_err().contains("only 7 bytes"));
}

#[test]
fn what_would_be_too_large_decompressed_is_refused_with_the_limit() {
    let count = 3_000_000_u32;
    let header =
        format!("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH {count}\nHEIGHT 1\nDATA binary_compressed\n");
    let lengths = [10_u32.to_le_bytes(), (12 * count).to_le_bytes()].concat();
    let reason = read(&[header.as_bytes(), &lengths, &[0; 10]].concat()).unwrap_err();
    assert!(reason.contains("over the limit of 33554432"), "{reason}");
}
