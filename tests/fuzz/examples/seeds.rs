//! Writes the seeds that are made of real encodings: `cargo run --locked -p palpate-fuzz --example seeds`.
//!
//! Beside them lie inputs that were found: those of `contact_steps`, and whatever once failed.

use std::error::Error;
use std::f64::consts::FRAC_1_SQRT_2;
use std::path::Path;

use palpate_fuzz::CALLS;
use palpate_proto::{Duration, Timestamp, v1};
use palpate_server::dry_run;
use prost::Message;

/// A candidate id as the server writes it.
const CANDIDATE: &str = "2-107-Gy_dJAaB4T-NKO0NvjCJP_hT46WbxMA_MzMzMzMz4z8AAAAAAAAAAJqZmZmZmek_.c670cb2c";

type Seeds = Vec<(&'static str, Vec<u8>)>;

fn main() -> Result<(), Box<dyn Error>> {
    for (target, seeds) in [
        ("candidate_ids", candidate_ids()),
        ("cloud_files", cloud_files()),
        ("packed_points", packed_points()),
        ("depth_images", depth_images()?),
        ("reference_meshes", reference_meshes()),
        ("grpc_requests", requests(|_, bytes| Ok(bytes))?),
        (
            "json_requests",
            requests(|call, bytes| match dry_run::message(call, &bytes) {
                Ok(json) => Ok(json.into_bytes()),
                Err(refusal) => Err(refusal.problem.into()),
            })?,
        ),
    ] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds").join(target);
        std::fs::create_dir_all(&folder)?;
        for (name, bytes) in seeds {
            std::fs::write(folder.join(name), bytes)?;
        }
    }
    Ok(())
}

fn candidate_ids() -> Seeds {
    let earlier = CANDIDATE.split('.').next().unwrap_or_default();
    vec![("of-a-session", CANDIDATE.into()), ("of-an-earlier-version", earlier.into())]
}

/// Twelve points of a bowl, in metres.
fn bowl() -> Vec<[f32; 3]> {
    let point = |i: u8| {
        let (x, y) = (0.01 * f32::from(i % 4), 0.01 * f32::from(i / 4));
        [x, y, 5.0 * (x * x + y * y)]
    };
    (0..12).map(point).collect()
}

fn packed(points: &[[f32; 3]]) -> Vec<u8> {
    points.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
}

fn rows(points: &[[f32; 3]]) -> Vec<u8> {
    points.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect::<String>().into_bytes()
}

fn cloud_files() -> Seeds {
    let points = bowl();
    let ply = |format: &str, body: Vec<u8>| {
        let header = format!(
            "ply\nformat {format} 1.0\ncomment a bowl\nelement vertex 12\nproperty float x\nproperty float y\n\
             property float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n"
        );
        [vec![0], header.into_bytes(), body].concat()
    };
    let pcd = |data: &str, body: Vec<u8>| {
        let header = format!(
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4\nHEIGHT 3\n\
             VIEWPOINT 0.5 0 0.6 1 0 0 0\nPOINTS 12\nDATA {data}\n"
        );
        [vec![1], header.into_bytes(), body].concat()
    };
    let most_significant_first = points.iter().flatten().flat_map(|x| x.to_be_bytes()).collect();
    vec![
        ("ascii.ply", ply("ascii", rows(&points))),
        ("little-endian.ply", ply("binary_little_endian", packed(&points))),
        ("big-endian.ply", ply("binary_big_endian", most_significant_first)),
        ("ascii.pcd", pcd("ascii", rows(&points))),
        ("binary.pcd", pcd("binary", packed(&points))),
        ("compressed.pcd", pcd("binary_compressed", compressed(&points))),
    ]
}

/// The points column by column, as literal runs of LZF between the lengths before and after.
fn compressed(points: &[[f32; 3]]) -> Vec<u8> {
    let column = |axis: usize| points.iter().flat_map(move |point| point[axis].to_le_bytes());
    let body: Vec<u8> = (0..3).flat_map(column).collect();
    let runs: Vec<u8> = body.chunks(32).flat_map(|run| [&[run.len() as u8 - 1], run].concat()).collect();
    let lengths = [runs.len(), body.len()].map(|length| (length as u32).to_le_bytes()).concat();
    [lengths, runs].concat()
}

fn packed_points() -> Seeds {
    // In the order of the target's fields: four flags, step, offsets, width, bytes of a row, no wish for voxels.
    let declared = |flags: [u8; 4], numbers: [u32; 6], points: Vec<u8>| {
        let numbers = numbers.map(u32::to_le_bytes).concat();
        [flags.to_vec(), numbers, vec![0], points].concat()
    };
    let padded: Vec<u8> = bowl().iter().flat_map(|point| [packed(&[*point]), vec![0; 4]].concat()).collect();
    let doubles = bowl().iter().flatten().flat_map(|&x| f64::from(x).to_be_bytes()).collect();
    vec![
        ("triples", declared([0; 4], [0; 6], packed(&bowl()))),
        ("padded", declared([1, 0, 0, 0], [16, 0, 4, 8, 0, 0], padded.clone())),
        ("in-rows", declared([1, 0, 0, 1], [16, 0, 4, 8, 4, 64], padded)),
        ("doubles-most-significant-first", declared([1, 1, 1, 0], [24, 0, 8, 16, 0, 0], doubles)),
    ]
}

fn depth_images() -> Result<Seeds, Box<dyn Error>> {
    const SIZE: [u16; 2] = [8, 6];
    let pixels: Vec<u16> = (0..SIZE[0] * SIZE[1]).map(|i| 500 + (i % 8) * (i / 8)).collect();
    // In the order of the target's fields: form, clutter, mask, size, lens, scale, range, place.
    let taken = |is_png: u8, mask: &[u8], image: Vec<u8>| {
        let numbers = [400.0, 400.0, 3.6, 2.8, 0.001, 0.1, 2.0, 0.5, 0.0, 0.6];
        let numbers = numbers.map(f64::to_le_bytes).concat();
        let size = SIZE.map(u16::to_le_bytes).concat();
        [vec![is_png, 1], mask.to_vec(), size, numbers, image].concat()
    };
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, SIZE[0].into(), SIZE[1].into());
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data: Vec<u8> = pixels.iter().flat_map(|pixel| pixel.to_be_bytes()).collect();
    encoder.write_header()?.write_image_data(&data)?;
    let raw: Vec<u8> = pixels.iter().flat_map(|pixel| pixel.to_le_bytes()).collect();
    Ok(vec![
        ("png", taken(1, &[0], file)),
        ("raw", taken(0, &[0], raw.clone())),
        ("masked", taken(0, &[1, 48, 0, 1], raw)),
    ])
}

fn reference_meshes() -> Seeds {
    let corners = [[0.0_f32; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
    let faces = [[0_usize, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             element face 4\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let text: String = faces.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n")).collect();
    let indices = faces.iter().flat_map(|face| {
        let corners = face.iter().flat_map(|&corner| (corner as i32).to_le_bytes());
        std::iter::once(3).chain(corners).collect::<Vec<u8>>()
    });
    let ascii = [header("ascii").into_bytes(), rows(&corners), text.into_bytes()].concat();
    let binary = [header("binary_little_endian").into_bytes(), packed(&corners), indices.collect()].concat();
    let vertices: String = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let obj_faces: String =
        faces.iter().map(|face| format!("f {} {} {}\n", face[0] + 1, face[1] + 1, face[2] + 1)).collect();
    let triangles = faces
        .iter()
        .flat_map(|face| [vec![0; 12], packed(&face.map(|corner| corners[corner])), vec![0; 2]].concat());
    let stl = [vec![0; 80], 4_u32.to_le_bytes().to_vec(), triangles.collect()].concat();
    let facets: String = faces.iter().map(|face| facet(face.map(|corner| corners[corner]))).collect();
    let text_stl = format!("solid a\n{facets}endsolid a\n").into_bytes();
    vec![
        ("ascii.ply", [vec![0], ascii].concat()),
        ("binary.ply", [vec![0], binary].concat()),
        ("binary.stl", [vec![1], stl].concat()),
        ("ascii.stl", [vec![1], text_stl].concat()),
        ("text.obj", [vec![2], format!("{vertices}{obj_faces}").into_bytes()].concat()),
    ]
}

fn facet(corners: [[f32; 3]; 3]) -> String {
    let corners: String = corners.iter().map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).collect();
    format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
}

/// A request of each call, written by `write` behind the byte that says which call it is.
fn requests(
    write: impl Fn(dry_run::Call, Vec<u8>) -> Result<Vec<u8>, Box<dyn Error>>,
) -> Result<Seeds, Box<dyn Error>> {
    let encoded = [
        ("create", 0, creation().encode_to_vec()),
        ("add-a-view", 1, view().encode_to_vec()),
        ("report-a-contact", 2, report(contact()).encode_to_vec()),
        ("report-a-miss", 2, report(miss()).encode_to_vec()),
        ("report-a-motion", 2, report(motion()).encode_to_vec()),
        ("propose", 3, question().encode_to_vec()),
    ];
    let seed = |(name, call, bytes)| {
        let body = write(CALLS[usize::from(call)], bytes)?;
        Ok((name, [vec![call], body].concat()))
    };
    encoded.into_iter().map(seed).collect()
}

fn vector(x: f64, y: f64, z: f64) -> Option<v1::Vector3> {
    Some(v1::Vector3 { x, y, z })
}

fn pose() -> Option<v1::Pose> {
    let orientation = v1::Quaternion { x: 0.0, y: -FRAC_1_SQRT_2, z: 0.0, w: FRAC_1_SQRT_2 };
    Some(v1::Pose { position: vector(0.54, 0.0, 0.1), orientation: Some(orientation) })
}

fn table() -> v1::HalfSpace {
    v1::HalfSpace { normal: vector(0.0, 0.0, 1.0), offset_m: 0.06 }
}

fn robot() -> Option<v1::RobotContext> {
    let ball = v1::Ball { center: vector(0.2, 0.0, 0.3), radius_m: 0.05 };
    let regions = [v1::keep_out::Shape::HalfSpace(table()), v1::keep_out::Shape::Ball(ball)];
    let keep_out = regions.map(|shape| v1::KeepOut { shape: Some(shape) }).to_vec();
    Some(v1::RobotContext { robot_id: "arm-1".into(), tool_pose: pose(), keep_out })
}

fn creation() -> v1::CreateSessionRequest {
    let pad = v1::Sensor {
        id: "left".into(),
        tool_from_sensor: pose(),
        pad_half_side_m: 0.009,
        ..Default::default()
    };
    let config = v1::SessionConfig {
        method: v1::Method::Palpate.into(),
        sensors: vec![pad],
        support: Some(table()),
        ..Default::default()
    };
    v1::CreateSessionRequest {
        session_id: "first-ball".into(),
        frame_id: "table".into(),
        labels: [("object".to_owned(), "ball".to_owned())].into(),
        config: Some(config),
        request_id: "create-1".into(),
        ..Default::default()
    }
}

fn view() -> v1::AddVisualPriorRequest {
    let prior = v1::VisualPrior {
        encoding: v1::PointEncoding::XyzF32Le.into(),
        points: packed(&bowl()).into(),
        viewpoint: vector(0.0, 0.0, 1.0),
        capture_time: Some(Timestamp { seconds: 1_700_000_000, nanos: 5_000_000 }),
        ..Default::default()
    };
    v1::AddVisualPriorRequest {
        session_id: "first-ball".into(),
        prior: Some(prior),
        propose: 1,
        ..Default::default()
    }
}

fn report(outcome: v1::contact_result::Outcome) -> v1::ReportContactRequest {
    let result = v1::ContactResult {
        candidate_id: CANDIDATE.into(),
        robot_id: "arm-1".into(),
        observe_time: Some(Timestamp { seconds: 1_700_000_000, nanos: 0 }),
        outcome: Some(outcome),
    };
    v1::ReportContactRequest {
        session_id: "first-ball".into(),
        result: Some(result),
        expected_revision: Some(2),
        propose: 1,
        robot: robot(),
        ..Default::default()
    }
}

fn contact() -> v1::contact_result::Outcome {
    let wrench = v1::Wrench { force: vector(0.0, 0.0, -2.0), torque: vector(0.001, 0.0, 0.0) };
    v1::contact_result::Outcome::Contact(v1::Contact {
        sensor_pose: pose(),
        wrench: Some(wrench),
        swept_from: vector(0.6, 0.0, 0.1),
        normal: vector(1.0, 0.0, 0.0),
        ..Default::default()
    })
}

fn miss() -> v1::contact_result::Outcome {
    v1::contact_result::Outcome::NoContact(v1::NoContact {
        swept_from: vector(0.6, 0.0, 0.1),
        swept_to: vector(0.5, 0.0, 0.1),
        sweep_radius_m: 0.004,
    })
}

fn motion() -> v1::contact_result::Outcome {
    v1::contact_result::Outcome::ObjectMoved(v1::ObjectMoved {
        new_from_old: pose(),
        std_m: 0.002,
        detail: "pushed".into(),
    })
}

fn question() -> v1::ProposeContactsRequest {
    v1::ProposeContactsRequest {
        session_id: "first-ball".into(),
        top_k: 3,
        robot: robot(),
        lease: Some(Duration { seconds: 30, nanos: 0 }),
        explain_vertices: vec![0, 17],
        ..Default::default()
    }
}
