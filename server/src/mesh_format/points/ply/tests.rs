//! What programs write as PLY, and what is none.

use super::*;
use crate::mesh_format::tests::{REMARK, tetrahedron};
use crate::mesh_format::{FileFormat, write_file};

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

fn ascii(vertices: usize, properties: &str, body: &str) -> String {
    format!("ply\nformat ascii 1.0\nelement vertex {vertices}\n{properties}end_header\n{body}")
}

fn reason(bytes: impl AsRef<[u8]>) -> String {
    read(bytes.as_ref()).unwrap_err()
}

#[test]
fn a_written_surface_is_read_back_as_its_vertices() {
    let surface = tetrahedron();
    let points = read(&write_file(FileFormat::Ply, &surface, &REMARK)).unwrap();
    assert_eq!(points.len(), 4);
    for (point, vertex) in points.iter().zip(&surface.mesh.vertices) {
        assert!((point - vertex).norm() < 1e-8);
    }
}

#[test]
fn text_with_doubles_other_properties_and_elements_before_is_read() {
    let file = "ply\nformat ascii 1.0\ncomment made by hand\nobj_info num_cols 2\nelement camera 1\n\
                property list uchar float view\nproperty int x\nelement vertex 2\nproperty uchar red\n\
                property double z\nproperty double y\nproperty list uchar int seen_by\nproperty double x\n\
                element face 3\nproperty list uchar int vertex_indices\n\
                end_header\n2 0.5 0.25 7\n255 0.3 0.2 2 1 1 0.1\n0 -3 2e-1 0 1\n";
    let expected = [Point::new(0.1, 0.2, 0.3), Point::new(1.0, 0.2, -3.0)];
    assert_eq!(read(file.as_bytes()).unwrap(), expected);
    assert_eq!(read(file.replace('\n', "\r\n").as_bytes()).unwrap(), expected);
    let (header, body) = file.split_once("end_header\n").unwrap();
    let torn = format!("{header}end_header\n{}", body.replace(' ', "\n\n"));
    assert_eq!(read(torn.as_bytes()).unwrap(), expected, "where the lines break says nothing");
}

#[test]
fn big_endian_numbers_of_every_kind_are_read_over() {
    let header = "ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty list short double weights\n\
                  property int16 a\nproperty float x\nproperty uint32 b\nproperty float64 y\nproperty float z\nend_header\n";
    let mut file = header.as_bytes().to_vec();
    file.extend([0, 2]);
    file.extend([7; 16 + 2]);
    file.extend(1.0_f32.to_be_bytes());
    file.extend([7; 4]);
    file.extend((-2.0_f64).to_be_bytes());
    file.extend(0.5_f32.to_be_bytes());
    assert_eq!(read(&file).unwrap(), [Point::new(1.0, -2.0, 0.5)]);
    file[header.len()] = 0x80;
    assert!(reason(&file).contains("a list of length -32766"), "{}", reason(&file));
}

#[test]
fn numbers_that_are_none_are_values_and_commas_are_named_with_their_line() {
    let points = read(ascii(2, XYZ, "nan -nan NaN\ninf 1 -inf\n").as_bytes()).unwrap();
    assert!(points[0].iter().all(|x| x.is_nan()) && points[1].x.is_infinite());
    let comma = reason(ascii(2, XYZ, "0.1 0.2 0.3\n0,1 0,2 0,3\n"));
    assert!(comma.contains("line 9: 0,1 is a number with a comma"), "{comma}");
    assert!(reason(ascii(1, XYZ, "1 2 three\n")).contains("line 8: \"three\" is no number"));
}

#[test]
fn counts_beyond_the_bytes_are_refused_before_anything_is_read() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for count in ["2", "4000000000", "18446744073709551615"] {
            let header = format!("ply\nformat {format} 1.0\nelement vertex {count}\n{XYZ}end_header\n1 2 ");
            assert!(reason(&header).contains("only 4 bytes follow"), "{header}");
        }
        let empty = format!(
            "ply\nformat {format} 1.0\nelement nothing 18446744073709551615\nelement vertex 1\n{XYZ}end_header\n1 2 3 4 5 6"
        );
        assert!(reason(&empty).contains("element 'nothing'"), "{empty}");
    }
}

#[test]
fn a_list_that_promises_more_than_there_is_is_refused() {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uint double corners\n\
         element vertex 1\n{XYZ}end_header\n"
    );
    assert!(reason([header.as_bytes(), &[0xff; 64]].concat()).contains("face 0 of 1"));
    let text = header.replace("binary_little_endian", "ascii") + "4000000000 1 2 3 4 5 6";
    assert!(reason(&text).contains("face 0 of 1 in the PLY file: it ends too early"), "{}", reason(&text));
}

#[test]
fn every_truncation_and_every_flipped_byte_gives_an_answer() {
    let file = write_file(FileFormat::Ply, &tetrahedron(), &REMARK);
    let vertices_end = file.len() - 4 * 13;
    for length in 0..file.len() {
        assert_eq!(read(&file[..length]).is_ok(), length >= vertices_end, "cut to {length} bytes");
    }
    let text = ascii(2, XYZ, "0.1 0.2 0.3 4 5 6");
    for length in 0..text.len() {
        assert!(read(&text.as_bytes()[..length]).is_err(), "cut to {length} bytes");
    }
    for file in [file, text.into_bytes()] {
        for index in 0..file.len() {
            for flip in [0x15, 0x80, 0xff] {
                let mut damaged = file.clone();
                damaged[index] ^= flip;
                let _ = read(&damaged);
            }
        }
    }
}

#[test]
fn a_header_beyond_a_limit_is_refused_with_it() {
    let lines = ascii(1, &format!("{XYZ}{}", "comment\n".repeat(1100)), "1 2 3");
    assert!(reason(&lines).contains("1024 lines"));
    let comment = ascii(1, &format!("{XYZ}comment {}\n", "x".repeat(5000)), "1 2 3");
    assert!(reason(&comment).contains("4096 bytes"));
    let properties = ascii(1, &format!("{XYZ}{}", "property float w\n".repeat(300)), "1 2 3");
    assert!(reason(&properties).contains("256 properties"));
    let elements = ascii(1, &format!("{XYZ}{}", "element e 0\n".repeat(65)), "1 2 3");
    assert!(reason(&elements).contains("64 elements"));
}

#[test]
fn what_is_no_cloud_is_refused_in_words() {
    assert!(reason("solid stl").contains("no PLY header"));
    assert!(reason("ply\nformat ascii 1.0\nelement vertex 3\n").contains("end_header"));
    assert!(reason(format!("ply\nelement vertex 0\n{XYZ}end_header\n")).contains("names no format"));
    let faces = "ply\nformat ascii 1.0\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n";
    assert!(reason(faces).contains("no element 'vertex'"));
    assert!(reason(ascii(1, "property float x\nproperty float y\n", "1 2")).contains("'z'"));
    let counts = "property int x\nproperty int y\nproperty int z\n";
    assert!(reason(ascii(1, counts, "1 2 3")).contains("float or double property 'x'"));
    assert!(reason(ascii(1, "property half x\n", "1")).contains("line 4 \"property half x\": the type"));
}
