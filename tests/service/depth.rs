//! Depth images: an analytic scene as a camera stores it, over both transports and as a PNG file.

use palpate_proto::v1;
use reqwest::Method;

use crate::harness::{Server, Transport, accepted, creation, from_json, prior};

const WIDTH: usize = 90;
const HEIGHT: usize = 80;
const FOCAL: f64 = 400.0;
const CENTER: [f64; 2] = [44.6, 39.8];
/// The plane behind the ball, in metres.
const PLANE_M: f64 = 0.7;

/// A ball of 40 mm, 0.5 m before the camera, in front of a plane; in millimetres, with mixed pixels at its silhouette,
/// and a corner without measurement.
fn scene() -> Vec<u16> {
    let ray = |column: f64, row: f64| {
        let (x, y) = ((column - CENTER[0]) / FOCAL, (row - CENTER[1]) / FOCAL);
        let (a, b) = (x * x + y * y + 1.0, 0.5);
        let root: f64 = b * b - a * (0.25 - 0.04 * 0.04);
        if root >= 0.0 { (b - root.sqrt()) / a } else { PLANE_M }
    };
    let pixel = |index: usize| {
        let (column, row) = ((index % WIDTH) as f64, (index / WIDTH) as f64);
        if column + row < 20.0 {
            return 0;
        }
        let parts = [-0.375, -0.125, 0.125, 0.375];
        let sum: f64 = parts.iter().flat_map(|i| parts.map(|j| ray(column + i, row + j))).sum();
        (1000.0 * sum / 16.0).round() as u16
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}

fn little_endian() -> Vec<u8> {
    scene().into_iter().flat_map(u16::to_le_bytes).collect()
}

fn png() -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, WIDTH as u32, HEIGHT as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data: Vec<u8> = scene().into_iter().flat_map(u16::to_be_bytes).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    file
}

/// The camera is 0.5 m above the ball at (0.5, 0, 0.1) and looks down: x stays, y and z turn.
fn camera() -> v1::DepthImage {
    v1::DepthImage {
        width: WIDTH as u32,
        height: HEIGHT as u32,
        fx: FOCAL,
        fy: FOCAL,
        cx: CENTER[0],
        cy: CENTER[1],
        depth_scale_m: 0.001,
        base_from_camera: Some(v1::Pose {
            position: Some(v1::Vector3 { x: 0.5, y: 0.0, z: 0.6 }),
            orientation: Some(v1::Quaternion { x: 1.0, y: 0.0, z: 0.0, w: 0.0 }),
        }),
        max_depth_m: 0.6,
        ..Default::default()
    }
}

fn view(encoding: v1::PointEncoding, points: Vec<u8>) -> v1::VisualPrior {
    v1::VisualPrior {
        encoding: encoding.into(),
        points: points.into(),
        depth: Some(camera()),
        ..Default::default()
    }
}

fn request(session_id: &str, view: v1::VisualPrior) -> v1::AddVisualPriorRequest {
    v1::AddVisualPriorRequest { prior: Some(view), ..prior(session_id) }
}

async fn hash(server: &Server, session_id: &str) -> String {
    server.grpc().log(session_id).await.remove(1).state_hash
}

#[track_caller]
fn check(reply: &v1::AddVisualPriorResponse) {
    let flying = reply.set_aside.as_ref().unwrap().flying_points;
    assert!((100..600).contains(&flying), "{flying} pixels at the silhouette");
    assert!((1000..=2000).contains(&reply.accepted_points), "{}", reply.accepted_points);
    assert_eq!(reply.warnings, Vec::<String>::new(), "the viewpoint is the pose's");
    // The ball is where the pose puts it: about (0.5, 0, 0.1), seen from above.
    let place = reply.candidates[0].point.unwrap();
    let from_center = (place.x - 0.5).hypot(place.y).hypot(place.z - 0.1);
    assert!((0.03..0.05).contains(&from_center), "{from_center}");
}

#[tokio::test]
async fn raw_or_as_png_over_both_transports_it_is_the_same_view() {
    let server = Server::start().await;
    let (width, height) = (0, 0);
    let as_png = v1::VisualPrior {
        depth: Some(v1::DepthImage { width, height, ..camera() }),
        ..view(v1::PointEncoding::DepthPng, png())
    };
    let mut hashes = Vec::new();
    for (form, view) in [("raw", view(v1::PointEncoding::DepthU16, little_endian())), ("png", as_png)] {
        for transport in Transport::BOTH {
            let (caller, name) = (server.caller(transport), format!("{form}-{}", transport.name()));
            caller.create(creation(&name)).await.unwrap();
            check(&caller.add_prior(request(&name, view.clone())).await.unwrap());
            hashes.push(hash(&server, &name).await);
        }
    }
    let query = format!(
        "fx={FOCAL}&fy={FOCAL}&cx={}&cy={}&base_from_camera=0.5,0,0.6,1,0,0,0&max_depth_m=0.6&propose=1",
        CENTER[0], CENTER[1]
    );
    server.grpc().create(creation("file")).await.unwrap();
    let path = format!("/v1/sessions/file/priors?{query}");
    let file = server.http().request(Method::POST, &path).header("content-type", "image/png").body(png());
    check(&from_json(&accepted(file).await.unwrap().text().await.unwrap()));
    hashes.push(hash(&server, "file").await);
    assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");

    let server = server.restart().await;
    let again = v1::AddVisualPriorRequest { request_id: "again".into(), ..prior("file") };
    assert_eq!(server.grpc().add_prior(again).await.unwrap().session.unwrap().revision, 3, "it is replayed");
}

#[tokio::test]
async fn a_mask_chooses_pixels_and_clutter_may_be_kept() {
    let server = Server::start().await;
    let mask: Vec<u8> = scene().iter().map(|&depth| u8::from(depth < 690)).collect();
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let depth = v1::DepthImage { mask_u8: mask.clone().into(), max_depth_m: 0.0, ..camera() };
        let masked =
            v1::VisualPrior { depth: Some(depth), ..view(v1::PointEncoding::DepthU16, little_endian()) };
        caller.create(creation(name)).await.unwrap();
        check(&caller.add_prior(request(name, masked.clone())).await.unwrap());
        let logged = async |include_points| {
            let sent =
                v1::ListEventsRequest { session_id: name.into(), include_points, ..Default::default() };
            match caller.events(sent).await.unwrap().events.remove(1).kind {
                Some(v1::event::Kind::VisualPrior(view)) => view,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(logged(true).await, masked, "the log keeps what was sent");
        let bare = logged(false).await;
        assert!(bare.points.is_empty() && bare.depth.unwrap().mask_u8.is_empty());

        let all = format!("{name}-all");
        caller.create(creation(&all)).await.unwrap();
        let kept = v1::VisualPrior { keep_clutter: true, ..masked };
        let reply = caller.add_prior(request(&all, kept)).await.unwrap();
        assert_eq!(reply.set_aside.unwrap().flying_points, 0);
    }
}

#[tokio::test]
async fn what_is_missing_or_impossible_is_refused_by_its_name() {
    let server = Server::start().await;
    server.grpc().begin("ball").await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let spoilt: [(&str, v1::DepthImage); 5] = [
            ("prior.depth.fx", v1::DepthImage { fx: 0.0, ..camera() }),
            ("prior.depth.base_from_camera", v1::DepthImage { base_from_camera: None, ..camera() }),
            ("prior.depth.depth_scale_m", v1::DepthImage { depth_scale_m: -1.0, ..camera() }),
            ("prior.depth.width", v1::DepthImage { width: 4096, height: 4096, ..camera() }),
            ("prior.depth.mask_u8", v1::DepthImage { mask_u8: vec![1].into(), ..camera() }),
        ];
        for (field, depth) in spoilt {
            let view =
                v1::VisualPrior { depth: Some(depth), ..view(v1::PointEncoding::DepthU16, little_endian()) };
            let sent = v1::AddVisualPriorRequest { request_id: "bad".into(), ..request("ball", view) };
            assert_eq!(caller.add_prior(sent).await.unwrap_err().fields, [field]);
        }
    }
    let file = |query: &str| {
        let path = format!("/v1/sessions/ball/priors?{query}");
        server.http().request(Method::POST, &path).header("content-type", "image/png").body(png())
    };
    for (query, field) in [
        ("fx=400", "prior.depth.fy"),
        ("fx=400&fy=400&cx=44&cy=39", "prior.depth.base_from_camera"),
        ("fx=400&fy=400&cx=44&cy=39&base_from_camera=0,0,0.6", "base_from_camera"),
        (
            "fx=400&fy=400&cx=44&cy=39&base_from_camera=0,0,0.6,0,0,0,2",
            "prior.depth.base_from_camera.orientation",
        ),
        ("fx=wide", "fx"),
        ("point_step=16", "point_step"),
    ] {
        assert_eq!(accepted(file(query)).await.unwrap_err().fields, [field], "{query}");
    }
    assert_eq!(server.grpc().get("ball").await.unwrap().revision, 2);
}
