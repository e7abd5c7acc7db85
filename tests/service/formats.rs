//! Clouds in the forms in which robots have them: the same points give the same session, whatever their form.

use palpate_proto::v1;
use reqwest::Method;

use crate::harness::{Server, Transport, accepted, cap, cloud, creation, from_json, prior};

/// Where the camera was, as the samples have it.
const VIEWPOINT: &str = "1,0,0.3";

/// The sample's points.
fn points() -> Vec<[f32; 3]> {
    let bytes = cap().points;
    let numbers = bytes.chunks(4).map(|four| f32::from_le_bytes(four.try_into().unwrap()));
    let numbers: Vec<f32> = numbers.collect();
    numbers.chunks(3).map(|point| point.try_into().unwrap()).collect()
}

/// An ascii PLY file as a viewer writes it that breaks lines before colours, with two rows of NaN.
fn ply() -> Vec<u8> {
    let rows: String = points().iter().map(|[x, y, z]| format!("{x} {y} {z} \r\n125 137 139 \r\n")).collect();
    let header = "ply\r\nformat ascii 1.0\r\ncomment a viewer\r\nobj_info a camera\r\nelement vertex 122\r\n\
                  property float x\r\nproperty float y\r\nproperty float z\r\nproperty uchar red\r\n\
                  property uchar green\r\nproperty uchar blue\r\nend_header\r\n";
    format!("{header}nan nan nan\r\n0 0 0\r\n{rows}-nan NaN inf 0 0 0\r\n").into_bytes()
}

const PCD_HEADER: &str = "# .PCD v0.7\nVERSION 0.7\nFIELDS intensity z y x\nSIZE 2 4 4 4\nTYPE U F F F\nCOUNT 1 1 1 1\n\
                          WIDTH 120\nHEIGHT 1\nVIEWPOINT 1 0 0.3 1 0 0 0\nPOINTS 120\n";

fn pcd(data: &str) -> Vec<u8> {
    let fields =
        |[x, y, z]: &[f32; 3]| [&[7, 0][..], &z.to_le_bytes(), &y.to_le_bytes(), &x.to_le_bytes()].concat();
    let body = match data {
        "ascii" => {
            points().iter().map(|[x, y, z]| format!("7 {z} {y} {x}\n")).collect::<String>().into_bytes()
        }
        "binary" => points().iter().flat_map(fields).collect(),
        _ => compressed(),
    };
    [format!("{PCD_HEADER}DATA {data}\n").into_bytes(), body].concat()
}

/// Field by field, as literal runs of LZF.
fn compressed() -> Vec<u8> {
    let axis = |axis: usize| points().iter().flat_map(|point| point[axis].to_le_bytes()).collect::<Vec<u8>>();
    let columns = [[7, 0].repeat(120), axis(2), axis(1), axis(0)].concat();
    let runs = columns.chunks(32).flat_map(|run| [&[run.len() as u8 - 1], run].concat());
    let runs: Vec<u8> = runs.collect();
    let lengths = [runs.len(), columns.len()].map(|length| (length as u32).to_le_bytes()).concat();
    [lengths, runs].concat()
}

/// Rows of eight points of 20 bytes, most significant byte first, each row padded by four bytes.
fn packed() -> (v1::PackedPoints, Vec<u8>) {
    let layout = v1::PackedPoints {
        point_step: 20,
        x_offset: 8,
        y_offset: 4,
        z_offset: 16,
        is_double: false,
        is_bigendian: true,
        width: 8,
        row_step: 164,
    };
    let point = |[x, y, z]: &[f32; 3]| {
        let [x, y, z] = [x, y, z].map(|number| number.to_be_bytes());
        [[0xff; 4], y, x, [0xff; 4], z].concat()
    };
    let rows = points()
        .chunks(8)
        .flat_map(|row| [row.iter().flat_map(point).collect(), vec![0xff; 4]].concat())
        .collect();
    (layout, rows)
}

fn file(encoding: v1::PointEncoding, points: Vec<u8>) -> v1::VisualPrior {
    let viewpoint = match encoding {
        // The file says it.
        v1::PointEncoding::Pcd => None,
        _ => cap().viewpoint,
    };
    v1::VisualPrior { encoding: encoding.into(), points: points.into(), viewpoint, ..Default::default() }
}

async fn hash(server: &Server, session_id: &str) -> String {
    server.grpc().log(session_id).await.remove(1).state_hash
}

#[tokio::test]
async fn the_same_points_give_the_same_session_in_every_form_and_over_both_transports() {
    let server = Server::start().await;
    server.grpc().begin("floats").await;
    let expected = hash(&server, "floats").await;
    let (layout, packed) = packed();
    let forms = [
        ("ply", file(v1::PointEncoding::Ply, ply()), 2),
        ("ascii", file(v1::PointEncoding::Pcd, pcd("ascii")), 0),
        ("binary", file(v1::PointEncoding::Pcd, pcd("binary")), 0),
        ("compressed", file(v1::PointEncoding::Pcd, pcd("binary_compressed")), 0),
        ("packed", v1::VisualPrior { packed: Some(layout), ..file(v1::PointEncoding::Packed, packed) }, 0),
    ];
    for (form, view, non_finite) in forms {
        for transport in Transport::BOTH {
            let (caller, name) = (server.caller(transport), format!("{form}-{}", transport.name()));
            caller.create(creation(&name)).await.unwrap();
            let view = v1::AddVisualPriorRequest { prior: Some(view.clone()), ..prior(&name) };
            let reply = caller.add_prior(view).await.unwrap();
            assert_eq!((reply.accepted_points, reply.non_finite_points), (120, non_finite), "{name}");
            let codes: Vec<_> = reply.warning_details.iter().map(v1::Warning::code).collect();
            let said = if non_finite > 0 { vec![v1::WarningCode::NonFinitePoints] } else { Vec::new() };
            assert_eq!(codes, said, "{name}: {:?}", reply.warnings);
            assert_eq!(hash(&server, &name).await, expected, "{name}");
        }
    }
}

#[tokio::test]
async fn files_are_taken_over_http_by_their_media_type() {
    let server = Server::start().await;
    server.grpc().begin("floats").await;
    let expected = hash(&server, "floats").await;
    let layout = "point_step=20&x_offset=8&y_offset=4&z_offset=16&is_bigendian=true&width=8&row_step=164";
    let stepped = format!("viewpoint={VIEWPOINT}&{layout}");
    for (name, media_type, query, body) in [
        ("ply", "application/ply", &format!("viewpoint={VIEWPOINT}"), ply()),
        ("pcd", "application/pcd", &String::new(), pcd("binary_compressed")),
        ("packed", "application/octet-stream", &stepped, packed().1),
    ] {
        server.grpc().create(creation(name)).await.unwrap();
        let path = format!("/v1/sessions/{name}/priors?{query}");
        let request =
            server.http().request(Method::POST, &path).header("content-type", media_type).body(body);
        let text = accepted(request).await.unwrap().text().await.unwrap();
        let reply: v1::AddVisualPriorResponse = from_json(&text);
        assert_eq!(reply.accepted_points, 120, "{name}");
        assert_eq!(hash(&server, name).await, expected, "{name}");
    }
}

#[tokio::test]
async fn the_callers_viewpoint_counts_more_than_the_files() {
    let server = Server::start().await;
    let mut hashes = Vec::new();
    for (name, viewpoint) in [("floats", cap()), ("pcd", file(v1::PointEncoding::Pcd, pcd("binary")))] {
        server.grpc().create(creation(name)).await.unwrap();
        let viewpoint =
            v1::VisualPrior { viewpoint: Some(v1::Vector3 { x: 0.5, y: 0.5, z: 0.5 }), ..viewpoint };
        let request = v1::AddVisualPriorRequest { prior: Some(viewpoint), ..prior(name) };
        server.grpc().add_prior(request).await.unwrap();
        hashes.push(hash(&server, name).await);
    }
    assert_eq!(hashes[0], hashes[1]);
    let replayed = server.restart().await;
    assert_eq!(hash(&replayed, "pcd").await, hashes[1]);
    let again = v1::AddVisualPriorRequest { request_id: "again".into(), ..prior("pcd") };
    replayed.grpc().add_prior(again).await.unwrap();
}

#[tokio::test]
async fn repeated_points_count_once_and_are_told() {
    let server = Server::start().await;
    let mut sent = points();
    sent.extend_from_within(..10);
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let request = v1::AddVisualPriorRequest { prior: Some(cloud(&sent)), ..prior(name) };
        let reply = caller.add_prior(request).await.unwrap();
        assert_eq!((reply.accepted_points, reply.dropped_points), (120, 0));
        assert_eq!(reply.set_aside.unwrap().repeated_points, 10);
        assert_eq!(reply.warning_details[0].code(), v1::WarningCode::RepeatedPoints);
        assert_eq!(reply.warning_details[0].parameters["repeated_points"], 10.0);
    }
}
